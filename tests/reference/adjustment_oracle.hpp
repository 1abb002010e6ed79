// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The oracle of bundle adjustment: normal equations of all unknowns, without the Schur complement, derivatives by
/// central differences, Levenberg-Marquardt with Nielsen's damping. Written for reading; it uses none of the library. The
/// equations are dense, or sparse where a problem is too large for that.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

#include "eigen.hpp"
TURBOMAP_TEST_EIGEN_BEGIN
#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>
TURBOMAP_TEST_EIGEN_END

namespace turbomap_test {

/// A frame: rotation, translation (world to camera), and further states, if any.
struct oracle_frame {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  Eigen::VectorXd more = Eigen::VectorXd(0);

  int dof() const { return 6 + static_cast<int>(more.size()); }

  /// exp(omega, v) applied on the left; the rest is added.
  oracle_frame moved(const Eigen::VectorXd& step) const {
    const Eigen::Vector3d w = step.head<3>(), v = step.segment<3>(3);
    const double angle = w.norm();
    Eigen::Matrix3d W;
    W << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity() + W + 0.5 * W * W;
    Eigen::Matrix3d left = Eigen::Matrix3d::Identity() + 0.5 * W + W * W / 6;
    if (angle > 1e-9) {
      rotation = Eigen::AngleAxisd(angle, w / angle).toRotationMatrix();
      left = Eigen::Matrix3d::Identity() + (1 - std::cos(angle)) / (angle * angle) * W +
             (angle - std::sin(angle)) / (angle * angle * angle) * W * W;
    }
    oracle_frame result = *this;
    result.R = rotation * R, result.t = rotation * t + left * v;
    if (more.size() > 0) result.more += step.tail(more.size());
    return result;
  }
};

/// One residual block: of up to two frames and a landmark (-1: none).
struct oracle_block {
  int frame = -1, other = -1, landmark = -1;
  /// Whitened residuals.
  std::function<Eigen::VectorXd(const oracle_frame& frame, const oracle_frame& other, const Eigen::Vector3d& landmark)>
      e;
  /// rho and its derivative.
  std::function<void(double chi2, double& rho, double& weight)> kernel;
};

struct oracle_problem {
  std::vector<oracle_frame> frames;
  std::vector<bool> frame_fixed;
  std::vector<Eigen::Vector3d> landmarks;
  std::vector<bool> landmark_fixed;
  std::vector<oracle_block> blocks;
  std::vector<unsigned> held = {};  ///< per frame, bit i: its unknown i stays; empty: none does

  double cost() const {
    double total = 0;
    for (const auto& b : blocks) {
      double rho, weight;
      b.kernel(residual(b).squaredNorm(), rho, weight);
      total += rho;
    }
    return total;
  }

  Eigen::VectorXd residual(const oracle_block& b) const {
    static const oracle_frame none;
    static const Eigen::Vector3d nowhere = Eigen::Vector3d::Zero();
    return b.e(b.frame < 0 ? none : frames[static_cast<std::size_t>(b.frame)],
               b.other < 0 ? none : frames[static_cast<std::size_t>(b.other)],
               b.landmark < 0 ? nowhere : landmarks[static_cast<std::size_t>(b.landmark)]);
  }

  /// First unknown of each frame and landmark; -1: fixed. Returns how many there are.
  int number(std::vector<int>& of_frame, std::vector<int>& of_landmark) const {
    int n = 0;
    of_frame.assign(frames.size(), -1), of_landmark.assign(landmarks.size(), -1);
    for (std::size_t f = 0; f < frames.size(); ++f)
      if (!frame_fixed[f]) of_frame[f] = n, n += frames[f].dof();
    for (std::size_t l = 0; l < landmarks.size(); ++l)
      if (!landmark_fixed[l]) of_landmark[l] = n, n += 3;
    return n;
  }

  oracle_problem moved(const Eigen::VectorXd& step) const {
    std::vector<int> of_frame, of_landmark;
    number(of_frame, of_landmark);
    oracle_problem result = *this;
    for (std::size_t f = 0; f < frames.size(); ++f)
      if (of_frame[f] >= 0) result.frames[f] = frames[f].moved(step.segment(of_frame[f], frames[f].dof()));
    for (std::size_t l = 0; l < landmarks.size(); ++l)
      if (of_landmark[l] >= 0) result.landmarks[l] += step.segment<3>(of_landmark[l]);
    return result;
  }

  /// b = -J^T w e over all unknowns, and every term of H = J^T w J: add_to_H(row, column, value).
  template <class Add>
  void sum_up(Eigen::VectorXd& b, const Add& add_to_H) const {
    std::vector<int> of_frame, of_landmark;
    b = Eigen::VectorXd::Zero(number(of_frame, of_landmark));
    oracle_problem work = *this;
    for (const auto& block : blocks) {
      const Eigen::VectorXd e = residual(block);
      double rho, weight;
      block.kernel(e.squaredNorm(), rho, weight);
      std::vector<int> columns;
      std::vector<Eigen::VectorXd> J;
      const auto differentiate_frame = [&](int f) {
        if (f < 0 || of_frame[static_cast<std::size_t>(f)] < 0) return;
        const oracle_frame at = frames[static_cast<std::size_t>(f)];
        for (int i = 0; i < at.dof(); ++i) {
          const double h = i < 6 ? 1e-6 : 1e-5 * std::max(1.0, std::abs(at.more[i - 6]));
          work.frames[static_cast<std::size_t>(f)] = at.moved(h * Eigen::VectorXd::Unit(at.dof(), i));
          const Eigen::VectorXd up = work.residual(block);
          work.frames[static_cast<std::size_t>(f)] = at.moved(-h * Eigen::VectorXd::Unit(at.dof(), i));
          J.push_back((up - work.residual(block)) / (2 * h)),
              columns.push_back(of_frame[static_cast<std::size_t>(f)] + i);
        }
        work.frames[static_cast<std::size_t>(f)] = at;
      };
      differentiate_frame(block.frame);
      differentiate_frame(block.other);
      if (block.landmark >= 0 && of_landmark[static_cast<std::size_t>(block.landmark)] >= 0) {
        Eigen::Vector3d& X = work.landmarks[static_cast<std::size_t>(block.landmark)];
        const Eigen::Vector3d at = X;
        for (int i = 0; i < 3; ++i) {
          const double h = 1e-6;
          X = at + h * Eigen::Vector3d::Unit(i);
          const Eigen::VectorXd up = work.residual(block);
          X = at - h * Eigen::Vector3d::Unit(i);
          J.push_back((up - work.residual(block)) / (2 * h)),
              columns.push_back(of_landmark[static_cast<std::size_t>(block.landmark)] + i);
          X = at;
        }
      }
      for (std::size_t i = 0; i < J.size(); ++i) {
        for (std::size_t j = 0; j < J.size(); ++j) add_to_H(columns[i], columns[j], weight * J[i].dot(J[j]));
        b[columns[i]] -= weight * J[i].dot(e);
      }
    }
  }

  /// H = J^T w J and b = -J^T w e over all unknowns.
  void normal_equations(Eigen::MatrixXd& H, Eigen::VectorXd& b) const {
    std::vector<int> of_frame, of_landmark;
    const int n = number(of_frame, of_landmark);
    H = Eigen::MatrixXd::Zero(n, n);
    sum_up(b, [&H](int i, int j, double term) { H(i, j) += term; });
    for (std::size_t f = 0; f < held.size(); ++f)
      for (int i = 0; i < frames[f].dof() && of_frame[f] >= 0; ++i)
        if ((held[f] >> i & 1U) != 0) {
          const int k = of_frame[f] + i;
          H.row(k).setZero(), H.col(k).setZero(), b[k] = 0, H(k, k) = 1;
        }
  }
};

/// The normal equations of small problems.
struct dense_equations {
  explicit dense_equations(const oracle_problem& problem) { problem.normal_equations(H, b); }

  Eigen::VectorXd diagonal() const { return H.diagonal(); }
  /// (H + diag(more))^-1 b
  Eigen::VectorXd solve(const Eigen::VectorXd& more) const {
    Eigen::MatrixXd damped = H;
    damped.diagonal() += more;
    return damped.ldlt().solve(b);
  }

  Eigen::MatrixXd H;
  Eigen::VectorXd b;
};

/// Those of large problems. No unknown is held.
struct sparse_equations {
  explicit sparse_equations(const oracle_problem& problem) {
    std::vector<Eigen::Triplet<double>> terms;
    problem.sum_up(b, [&terms](int i, int j, double term) { terms.emplace_back(i, j, term); });
    H.resize(b.size(), b.size());
    H.setFromTriplets(terms.begin(), terms.end());
  }

  Eigen::VectorXd diagonal() const { return H.diagonal(); }
  Eigen::VectorXd solve(const Eigen::VectorXd& more) const {
    Eigen::SparseMatrix<double> damped = H;
    for (Eigen::Index i = 0; i < more.size(); ++i) damped.coeffRef(i, i) += more[i];
    return Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(damped).solve(b);
  }

  Eigen::SparseMatrix<double> H;
  Eigen::VectorXd b;
};

/// Adjusts for so many iterations (one linearisation with all its retries). `scaled`: damps by lambda diag(H), not
/// lambda I. `first`: the first lambda; 0: by the largest entry of diag(H). \return the cost after each
template <class Equations = dense_equations>
std::vector<double> oracle_adjust(oracle_problem& problem, int iterations, bool scaled = false, double first = 0) {
  std::vector<double> costs;
  double cost = problem.cost(), lambda = first;
  for (int i = 0; i < iterations; ++i) {
    const Equations equations(problem);
    Eigen::VectorXd damping = Eigen::VectorXd::Ones(equations.b.size());
    if (scaled) damping = equations.diagonal().cwiseMax(1e-6);
    if (i == 0 && !(first > 0)) lambda = scaled ? 1e-4 : 1e-5 * equations.diagonal().maxCoeff();
    double growth = 2;
    bool accepted = false;
    for (int step = 0; step < 11 && !accepted; ++step) {
      const Eigen::VectorXd dx = equations.solve(lambda * damping);
      const oracle_problem candidate = problem.moved(dx);
      const double after = candidate.cost(),
                   ratio = (cost - after) / dx.dot(lambda * damping.cwiseProduct(dx) + equations.b);
      accepted = ratio > 0;
      if (accepted) {
        lambda *= std::max(1.0 / 3, std::min(2.0 / 3, 1 - std::pow(2 * ratio - 1, 3)));
        problem = candidate, cost = after;
      } else {
        lambda *= growth, growth *= 2;
      }
    }
    if (!accepted) break;
    costs.push_back(cost);
  }
  return costs;
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How well a point is known from its views, as a textbook has it: numeric derivatives, sums and inverses in Eigen.

#include <turbomap/math/linear.hpp>
#include <turbomap/math/strict.hpp>
#include <turbomap/math/symmetric3.hpp>
#include <turbomap/types.hpp>

#include <algorithm>
#include <vector>

#include "two_views.hpp"

TURBOMAP_TEST_EIGEN_BEGIN
#include <Eigen/Eigenvalues>
TURBOMAP_TEST_EIGEN_END

namespace turbomap_test {

/// The library's numbers here, plain or strict.
template <class S>
turbomap::isometry<S> to_isometry(const oracle_pose& T) {
  turbomap::isometry<S> r;
  for (int i = 0; i < 9; ++i) r.R.m[i] = S(T.R(i / 3, i % 3));
  r.t = {S(T.t.x()), S(T.t.y()), S(T.t.z())};
  return r;
}
inline double number(double x) { return x; }
inline double number(turbomap::decision x) { return x.value; }
template <class S>
Eigen::Matrix3d to_eigen(const turbomap::symmetric3<S>& A) {
  Eigen::Matrix3d M;
  M << number(A.xx), number(A.yx), number(A.zx), number(A.yx), number(A.yy), number(A.zy), number(A.zx), number(A.zy),
      number(A.zz);
  return M;
}

/// One view of a point.
template <class Camera>
struct uncertainty_view {
  Camera camera;
  oracle_pose T_cw;
  double bf = 0;  ///< 0: no u_right
  double sigma2 = 1;
  double correlation = 0;

  int size() const { return bf > 0 ? 3 : 2; }
  /// u, v and, with a right image, u_right.
  Eigen::VectorXd operator()(const Eigen::Vector3d& X) const {
    const Eigen::Vector3d x = T_cw * X;
    turbomap::vec2<double> p{};
    if (!camera.project(turbomap::vec3<double>{x.x(), x.y(), x.z()}, p)) return Eigen::VectorXd::Zero(0);
    Eigen::VectorXd e(size());
    e(0) = p.x, e(1) = p.y;
    if (bf > 0) e(2) = p.x - bf / x.z();
    return e;
  }
  /// Of the differences below: 1e-5 of the point's distance.
  double step(const Eigen::Vector3d& X) const { return 1e-5 * (T_cw * X).norm(); }
  /// Whether there is a derivative: the model is defined around the point, and numbers are fine enough for a difference.
  bool differentiable(const Eigen::Vector3d& X) const {
    const double h = step(X);
    if (!(h > 1e-10 * (X.norm() + T_cw.t.norm()))) return false;
    for (int i = 0; i < 3; ++i)
      for (const double d : {h, -h})
        if ((*this)(X + d * Eigen::Vector3d::Unit(i)).size() == 0) return false;
    return true;
  }
  /// By central differences.
  Eigen::MatrixXd derivative(const Eigen::Vector3d& X) const {
    Eigen::MatrixXd J(size(), 3);
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d h = step(X) * Eigen::Vector3d::Unit(i);
      J.col(i) = ((*this)(X + h) - (*this)(X - h)) / (2 * step(X));
    }
    return J;
  }
  Eigen::MatrixXd noise() const {
    Eigen::MatrixXd N = sigma2 * Eigen::MatrixXd::Identity(size(), size());
    if (bf > 0) N(0, 2) = N(2, 0) = correlation * sigma2;
    return N;
  }
};

using Matrix3l = Eigen::Matrix<long double, 3, 3>;

/// The inverse of the sum of all views' information, and that a point lies within its own distance of the farthest camera.
/// In extended numbers: a single near view knows the point 1e6 times as well across its ray as along it.
template <class Camera>
Eigen::Matrix3d oracle_point_covariance(const std::vector<uncertainty_view<Camera>>& views, const Eigen::Vector3d& X) {
  Matrix3l information = Matrix3l::Zero();
  double distance = 0;
  for (const auto& v : views) {
    distance = std::max(distance, (v.T_cw * X).norm());
    if (v(X).size() == 0) continue;
    Eigen::Matrix3d J = Eigen::Matrix3d::Zero(), N = Eigen::Matrix3d::Identity();  // of fixed size: also under nvcc
    J.topRows(v.size()) = v.derivative(X);
    N.topLeftCorner(v.size(), v.size()) = v.noise();
    const Matrix3l K = J.cast<long double>();
    information += K.transpose() * N.inverse().cast<long double>() * K;
  }
  const Matrix3l whole = information + Matrix3l::Identity() / static_cast<long double>(distance * distance);
  return Matrix3l(whole.inverse()).template cast<double>();
}

/// Covariance of the difference between a pixel of the view and the projection of a point known to Sigma.
template <class Camera>
Eigen::MatrixXd oracle_spread(const uncertainty_view<Camera>& view, const Eigen::Vector3d& X,
                              const Eigen::Matrix3d& Sigma) {
  const Eigen::MatrixXd J = view.derivative(X);
  return view.noise() + J * Sigma * J.transpose();
}

TURBOMAP_TEST_EIGEN_BEGIN
/// Whether a textbook's inverse of that is what everybody else's is: Sigma is a covariance as the camera sees it, but for
/// rounding to float, and not so large that nothing is left of the noise.
template <class Camera>
bool is_plain_spread(const uncertainty_view<Camera>& view, const Eigen::Vector3d& X, const Eigen::Matrix3d& Sigma) {
  const Eigen::MatrixXd J = view.derivative(X);
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();  // of fixed size: also under nvcc
  M.topLeftCorner(view.size(), view.size()) = J * Sigma * J.transpose();
  if (!M.allFinite()) return false;
  const Eigen::Vector3d variances = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(M).eigenvalues();
  return variances(0) > -0.01 * (1 - view.correlation) * view.sigma2 && variances(2) < 1e9 * view.sigma2;
}
TURBOMAP_TEST_EIGEN_END

inline Eigen::Matrix3d to_eigen(const turbomap::point_covariance& c) {
  Eigen::Matrix3d C;
  C << c.xx, c.yx, c.zx, c.yx, c.yy, c.zy, c.zx, c.zy, c.zz;
  return C;
}

}  // namespace turbomap_test

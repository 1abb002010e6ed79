// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The linear solver of initialise_inertial(). Its unknowns are one velocity per keyframe, and ten that all edges share. An edge
/// joins two neighbours in time, so velocities are eliminated one after the other, as a filter does it, and found again
/// backwards: O(keyframes), in blocks of 3.

#include <cstddef>

#include "../adjustment/small_cholesky.hpp"
#include "../config.hpp"
#include "../plain_vector.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE
namespace detail {

/// Where the shared unknowns are: biases, two turns of gravity about its basis, its length, the scale.
struct shared_unknowns {
  static constexpr int gyro = 0, acceleration = 3, turn = 6, length = 8, scale = 9, count = 10;
};

/// An edge, whitened: nine residuals, and their derivatives by the velocities of both ends and the shared unknowns.
struct chain_edge {
  static constexpr int columns = 6 + shared_unknowns::count;
  double e[9], J[9 * columns];
};

/// Solves the normal equations of a chain for the step of all unknowns. begin(), add() for each edge in order, solve().
class velocity_chain {
 public:
  static constexpr int shared = shared_unknowns::count, rows = 3 + shared;

  /// \param information,gradient  of what is known of each shared unknown beforehand   \param held  unknowns that do not move
  void begin(const double (&information)[shared], const double (&gradient)[shared], const bool (&held)[shared]) {
    eliminated_.clear();
    for (double& x : A_) x = 0;
    for (double& x : b_) x = 0;
    for (int k = 0; k < shared; ++k) {
      held_[k] = held[k];
      A_[(3 + k) * rows + 3 + k] = held[k] ? 1 : information[k];
      b_[3 + k] = held[k] ? 0 : -gradient[k];
    }
  }

  /// Adds an edge and eliminates the velocity of its first end.
  /// \return false: that is not determined, or a number is not finite
  bool add(const chain_edge& edge) {
    constexpr int n = chain_edge::columns;
    double A[n * n] = {}, b[n] = {};  // first velocity, second velocity, shared; lower triangle
    const auto place = [](int k) { return k < 3 ? k : k + 3; };
    for (int r = 0; r < rows; ++r) {
      b[place(r)] = b_[r];
      for (int c = 0; c <= r; ++c) A[place(r) * n + place(c)] = A_[r * rows + c];
    }
    for (int r = 0; r < n; ++r) {
      if (r >= 6 && held_[r - 6]) continue;
      for (int k = 0; k < 9; ++k) {
        const double d = edge.J[k * n + r];
        b[r] -= d * edge.e[k];
        for (int c = 0; c <= r; ++c)
          if (c < 6 || !held_[c - 6]) A[r * n + c] += d * edge.J[k * n + c];
      }
    }
    step_back back;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c <= r; ++c) back.L[3 * r + c] = A[r * n + c];
    if (!factorise_small<3>(back.L)) return false;
    for (int k = 0; k < 3; ++k) back.z[k] = b[k];
    solve_lower<3>(back.L, back.z);
    for (int r = 0; r < rows; ++r) {
      for (int k = 0; k < 3; ++k) back.Y[r][k] = A[(3 + r) * n + k];
      solve_lower<3>(back.L, back.Y[r]);
    }
    for (int r = 0; r < rows; ++r) {
      b_[r] = b[3 + r] - dot3(back.Y[r], back.z);
      for (int c = 0; c <= r; ++c) A_[r * rows + c] = A[(3 + r) * n + 3 + c] - dot3(back.Y[r], back.Y[c]);
    }
    eliminated_.push_back(back);
    return true;
  }

  /// The step of the shared unknowns, and of each velocity. \return false: singular
  bool solve(double (&step)[shared], plain_vector<vec3<double>>& velocities) {
    double diagonal[rows];
    for (int k = 0; k < rows; ++k) diagonal[k] = A_[k * rows + k];
    constexpr double singular = 1e-13;  // of a pivot: rounding
    if (!factorise_small<rows>(A_, diagonal, singular)) return false;
    double x[rows];  // of the last velocity, and shared
    for (int k = 0; k < rows; ++k) x[k] = b_[k];
    solve_lower<rows>(A_, x), solve_upper<rows>(A_, x);
    velocities.resize(eliminated_.size() + 1);
    velocities.back() = {x[0], x[1], x[2]};
    for (std::size_t i = eliminated_.size(); i-- > 0;) {
      const step_back& back = eliminated_[i];
      double v[3];
      for (int k = 0; k < 3; ++k) {
        v[k] = back.z[k];
        for (int r = 0; r < rows; ++r) v[k] -= back.Y[r][k] * x[r];
      }
      solve_upper<3>(back.L, v);
      for (int k = 0; k < 3; ++k) x[k] = v[k];
      velocities[i] = {v[0], v[1], v[2]};
    }
    for (int k = 0; k < shared; ++k) step[k] = x[3 + k];
    return true;
  }

  /// Variances of the last velocity (3) and the shared unknowns, after solve().
  void variances(double (&variance)[rows]) const {
    for (int k = 0; k < rows; ++k) {
      double x[rows] = {};
      x[k] = 1;
      solve_lower<rows>(A_, x);
      variance[k] = 0;
      for (int r = k; r < rows; ++r) variance[k] += x[r] * x[r];
    }
  }

 private:
  /// What finds an eliminated velocity again: L^T v = z - Y^T (next velocity, shared).
  struct step_back {
    double L[9], Y[rows][3], z[3];
  };
  static double dot3(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

  double A_[rows * rows], b_[rows];  // of the velocity that is next, and of the shared unknowns; later its factor
  bool held_[shared];
  plain_vector<step_back> eliminated_;
};

}  // namespace detail
TURBOMAP_END_NAMESPACE

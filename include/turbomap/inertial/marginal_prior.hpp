// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A window that slides drops its oldest frame. What that frame knew of the next one (its own prior, the inertial edge) need not be
/// lost: it becomes a prior of the next frame, linearised where the states were. In square root form, by QR: no product J^T J loses
/// digits, and a frame of which little is known gives a prior of less than full rank
/// [Demmel et al., Square root marginalization for sliding-window bundle adjustment, ICCV 2021].

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "../adjustment/factor_derivatives.hpp"
#include "../adjustment/pose_information.hpp"
#include "../adjustment/small_cholesky.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../math/linear.hpp"
#include "../math/rotation.hpp"
#include "../plain_vector.hpp"
#include "inertial_frame.hpp"
#include "inertial_residual.hpp"
#include "preintegration.hpp"

namespace turbomap {

/// What is known of all 15 unknowns of a frame: 15 residuals R d + e, where d is how far the state is from `at`. Made by
/// state_marginaliser; a factor of one frame.
struct marginal_prior_factor {
  static constexpr int size = 15;  ///< numbers of a residual
  /// Made by state_marginaliser.
  struct row {
    inertial_state<double> at;  ///< where it was linearised; stays
    double R[15 * 15];          ///< row-major; R^T R is the information
    double e[15];               ///< the residual at `at`, whitened
  };

  /// d: turn and shift of T_cw as in a step, velocity, biases. Agrees with move_state() to first order.
  template <class S, class = detail::this_target>
  TURBOMAP_HD static void difference(const inertial_state<S>& x, const inertial_state<double>& at, S (&d)[15]) {
    const mat3<S> turn = to_isometry<S>(x.T_cw).R * transpose(to_isometry<S>(at.T_cw).R);
    const vec3<S> parts[5] = {rotation_log(turn), translation(x.T_cw) - turn * cast<S>(translation(at.T_cw)),
                              x.velocity - cast<S>(at.velocity), x.bias.gyro - cast<S>(at.bias.gyro),
                              x.bias.acceleration - cast<S>(at.bias.acceleration)};
    for (int k = 0; k < 5; ++k) d[3 * k] = parts[k].x, d[3 * k + 1] = parts[k].y, d[3 * k + 2] = parts[k].z;
  }
  /// Writes R d + e, without unit; always defined.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool residual(const inertial_state<S>& x, const row& r, S* e) const {
    S d[15];
    difference(x, r.at, d);
    for (int k = 0; k < 15; ++k) {
      e[k] = S(r.e[k]);
      for (int m = 0; m < 15; ++m) e[k] = e[k] + S(r.R[15 * k + m]) * d[m];
    }
    return true;
  }
  /// The same with derivatives by the 15 unknowns of the state: 15 x 15, row by row.
  template <class = detail::this_target>
  TURBOMAP_HD bool linearise(const inertial_state<double>& x, const row& r, double* e, double* J) const {
    double d[15];
    difference(x, r.at, d);
    // By a step (omega, v): the inverse left Jacobian of the turn; omega x shift + v.
    const mat3<double> turn = right_jacobian_inverse(vec3<double>{-d[0], -d[1], -d[2]});
    const mat3<double> shift = skew(vec3<double>{-d[3], -d[4], -d[5]});
    for (int k = 0; k < 15; ++k) {
      const double* R = r.R + 15 * k;
      e[k] = r.e[k];
      for (int m = 0; m < 15; ++m) e[k] += R[m] * d[m];
      for (int c = 0; c < 15; ++c) {
        J[15 * k + c] = R[c];
        if (c >= 3) continue;
        J[15 * k + c] = 0;
        for (int m = 0; m < 3; ++m) J[15 * k + c] += R[m] * turn(m, c) + R[3 + m] * shift(m, c);
      }
    }
    return true;
  }
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// What is known of a pose alone, as a prior of a frame, e.g. from what is seen from it.
/// \param seen  at the pose of x   \return false: the pose is not determined, or a number is not finite
inline bool make_pose_prior(const inertial_state<double>& x, const pose_information& seen,
                            marginal_prior_factor::row& prior) {
  double L[36], e[6], diagonal[6];
  for (int i = 0, at = 0; i < 6; ++i)
    for (int j = 0; j <= i; ++j, ++at) L[6 * i + j] = diagonal[i] = seen.H[at];
  if (!factorise_small<6>(L, diagonal, 1e-12)) return false;
  for (int i = 0; i < 6; ++i) e[i] = -seen.b[i];
  solve_lower<6>(L, e);
  if (!detail::all_finite(e, 6)) return false;
  prior = {x, {}, {}};
  for (int i = 0; i < 6; ++i) {
    prior.e[i] = e[i];
    for (int j = i; j < 6; ++j) prior.R[15 * i + j] = L[6 * j + i];
  }
  return true;
}

/// Takes a frame out: add() every factor that goes with it, then prior() is what they say of the next frame.
///
///     state_marginaliser out;
///     out.add(marginal_prior_factor{}, known, oldest);
///     out.add(inertial_factor{...}, edge, oldest, next);
///     out.add(bias_walk_factor{}, walk, oldest, next);
///     marginal_prior_factor::row prior = out.prior(next);
///
/// Landmarks that stay in the window are not marginalised: every frame that sees one would be joined to all others. What
/// the frame saw of them says where it stood, with make_pose_prior().
class state_marginaliser {
 public:
  /// No factors; the memory stays.
  /// \param held  unknowns of the frame that leaves which are known, as bits of frame_input::held
  void clear(std::uint32_t held = 0) { rows_.clear(), held_ = held; }

  /// A factor of the frame that leaves. \param weight  of its information, e.g. that of a robust kernel
  /// \return false: the factor is not defined there; nothing was added
  template <class Factor>
  bool add(const Factor& factor, const typename Factor::row& row, const inertial_state<double>& leaves,
           double weight = 1) {
    double e[Factor::size], J[Factor::size * 15];
    if (!linearise<inertial_frame>(factor, leaves, row, e, J)) return false;
    return append(Factor::size, J, nullptr, e, weight);
  }
  /// A factor between it, the first one, and the frame that stays.
  template <class Factor>
  bool add(const Factor& factor, const typename Factor::row& row, const inertial_state<double>& leaves,
           const inertial_state<double>& stays, double weight = 1) {
    double e[Factor::size], J[2][Factor::size * 15];
    if (!linearise<inertial_frame>(factor, leaves, stays, row, e, J[0], J[1])) return false;
    return append(Factor::size, J[0], J[1], e, weight);
  }

  /// What the factors say of the frame that stays, whatever the other one is. \param stays  the state that they were added with
  marginal_prior_factor::row prior(const inertial_state<double>& stays) {
    const std::size_t first = triangular(0, 0, 15);
    const std::size_t end = triangular(first, 15, 30);
    marginal_prior_factor::row prior{stays, {}, {}};
    prior.at.T_cw = normalised(stays.T_cw);
    for (std::size_t r = first; r < end; ++r) {
      for (std::size_t c = 0; c < 15; ++c) prior.R[15 * (r - first) + c] = rows_[r].x[15 + c];
      prior.e[r - first] = rows_[r].x[30];
    }
    return prior;
  }

 private:
  struct matrix_row {
    double x[31];  ///< by both frames, and the residual
  };

  bool append(int count, const double* leaves, const double* stays, const double* e, double weight) {
    const double root = std::sqrt(weight);
    double squares = 0;  // of what the rows will have, as triangular() sums them
    for (int r = 0; r < count; ++r) squares += e[r] * e[r];
    for (int n = 0; n < 15 * count; ++n)
      squares += leaves[n] * leaves[n] + (stays == nullptr ? 0 : stays[n] * stays[n]);
    if (!(root >= 0) || !detail::is_finite(squares) || !detail::is_finite(weight * squares)) return false;
    for (int r = 0; r < count; ++r) {
      matrix_row row;
      for (int c = 0; c < 15; ++c) {
        row.x[c] = (held_ >> c & 1U) != 0 ? 0 : root * leaves[15 * r + c];
        row.x[15 + c] = stays == nullptr ? 0 : root * stays[15 * r + c];
      }
      row.x[30] = root * e[r];
      rows_.push_back(row);
    }
    return true;
  }

  /// Brings columns [from, to) of the rows from `top` on into echelon form by Householder reflections.
  /// \return the first row that is zero in them
  std::size_t triangular(std::size_t top, std::size_t from, std::size_t to) {
    constexpr double rounding = 1e-11;  // of a column: below it nothing is left of it
    for (std::size_t c = from; c < to; ++c) {
      double below = 0, whole = 0;
      for (std::size_t r = 0; r < rows_.size(); ++r) {
        const double square = rows_[r].x[c] * rows_[r].x[c];
        whole += square, below += r >= top ? square : 0;
      }
      if (!(below > rounding * rounding * whole)) {
        for (std::size_t r = top; r < rows_.size(); ++r) rows_[r].x[c] = 0;
        continue;
      }
      const double norm = std::sqrt(below), head = rows_[top].x[c], pivot = head > 0 ? -norm : norm;
      const double first = head - pivot, scale = 1 / (norm * (norm + std::abs(head)));  // v = (first, rest), 2 / |v|^2
      for (std::size_t m = c + 1; m < 31; ++m) {
        double dot = first * rows_[top].x[m];
        for (std::size_t r = top + 1; r < rows_.size(); ++r) dot += rows_[r].x[c] * rows_[r].x[m];
        rows_[top].x[m] -= scale * dot * first;
        for (std::size_t r = top + 1; r < rows_.size(); ++r) rows_[r].x[m] -= scale * dot * rows_[r].x[c];
      }
      rows_[top].x[c] = pivot;
      for (std::size_t r = top + 1; r < rows_.size(); ++r) rows_[r].x[c] = 0;
      ++top;
    }
    return top;
  }

  plain_vector<matrix_row> rows_;
  std::uint32_t held_ = 0;
};

TURBOMAP_END_NAMESPACE

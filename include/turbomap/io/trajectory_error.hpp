// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Absolute trajectory error: what is left between two paths after one alignment, rigid or, where the scale of one of them
/// means nothing, with a scale.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/linear.hpp"
#include "../span.hpp"
#include "recording_data.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {
/// Positions as the columns of a matrix.
inline Eigen::Map<const Eigen::Matrix<double, 3, Eigen::Dynamic>> matrix_of(span<const vec3<double>> positions) {
  static_assert(sizeof(vec3<double>) == 3 * sizeof(double));
  return {&positions.data()->x, 3, static_cast<Eigen::Index>(positions.size())};
}
}  // namespace detail

/// The rigid transform that brings `from` nearest to `to` in the mean of squares (Umeyama, 1991, without scale). Throws
/// std::invalid_argument unless both have the same length, of three or more: fewer do not define it.
inline isometry<double> rigid_alignment(span<const vec3<double>> from, span<const vec3<double>> to) {
  require(from.size() == to.size(), "to", to.size(), "must be as many positions as `from`");
  require(from.size() >= 3, "from", from.size(), "must be three positions or more");
  const Eigen::Matrix4d T = Eigen::umeyama(detail::matrix_of(from), detail::matrix_of(to), false);
  isometry<double> result;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) result.R(row, column) = T(row, column);
  result.t = {T(0, 3), T(1, 3), T(2, 3)};
  return result;
}

/// Root mean square distance (m) of `estimate` to `truth` after the rigid transform, or (`with_scale`) the similarity, that
/// brings them nearest (Umeyama, 1991). NaN for fewer than three positions, and with scale where all of the estimate are
/// one. Throws std::invalid_argument unless both have the same length.
inline double absolute_trajectory_error(span<const vec3<double>> estimate, span<const vec3<double>> truth,
                                        bool with_scale = false) {
  require(estimate.size() == truth.size(), "truth", truth.size(), "must be as many positions as the estimate");
  if (estimate.size() < 3) return std::nan("");
  const auto from = detail::matrix_of(estimate), to = detail::matrix_of(truth);
  const Eigen::Matrix4d T = Eigen::umeyama(from, to, with_scale);
  const auto moved = (T.topLeftCorner<3, 3>() * from).colwise() + T.topRightCorner<3, 1>();
  return std::sqrt((moved - to).squaredNorm() / static_cast<double>(estimate.size()));
}

/// The camera's centre where ground truth says that it was at `t_ns`: of a pose at that time (10 us: times in files are rounded), else on
/// the line between the poses before and after it, which are half a second apart at most. None elsewhere: ground truth begins late, ends
/// early and has gaps where a motion capture system saw nothing.
inline std::optional<vec3<double>> true_camera_centre(const recording& r, std::int64_t t_ns) {
  constexpr double same_time = 1e4, longest_gap = 5e8;       // ns
  const auto between = [](std::int64_t a, std::int64_t b) {  // a <= b: their difference need not fit in an int64
    return static_cast<double>(static_cast<std::uint64_t>(b) - static_cast<std::uint64_t>(a));
  };
  const auto centre = [&](std::size_t i) {
    const stamped_body_pose& g = r.gt_T_wb[i];
    const rigid_transform<double> T_wb{g.qx, g.qy, g.qz, g.qw, g.px, g.py, g.pz};
    return to_isometry<double>(T_wb) * to_isometry<double>(r.meta.T_bc).t;
  };
  const auto after =
      static_cast<std::size_t>(std::lower_bound(r.gt_t_ns.begin(), r.gt_t_ns.end(), t_ns) - r.gt_t_ns.begin());
  const bool has_before = after > 0, has_after = after < r.gt_t_ns.size();
  const double since = has_before ? between(r.gt_t_ns[after - 1], t_ns) : longest_gap,
               until = has_after ? between(t_ns, r.gt_t_ns[after]) : longest_gap;
  if (std::min(since, until) <= same_time) return centre(since <= until ? after - 1 : after);
  if (!has_before || !has_after || since + until > longest_gap) return std::nullopt;
  const vec3<double> a = centre(after - 1), b = centre(after);
  return a + (since / (since + until)) * (b - a);
}

/// ATE of keyframe poses `T_cw` (one per keyframe of the recording) against its ground truth, over the keyframes whose
/// `alive` is not 0 (empty: all) and whose time ground truth covers. A monocular recording is aligned with scale, which one
/// camera cannot know. NaN for fewer than three such keyframes. Throws std::invalid_argument for wrong sizes or a recording
/// without ground truth.
inline double keyframe_trajectory_error(const recording& r, span<const rigid_transform<float>> T_cw,
                                        span<const std::uint8_t> alive = {}) {
  require(r.has_ground_truth(), "recording", r.gt_t_ns.size(), "must have ground truth");
  require(T_cw.size() == r.keyframe_count(), "T_cw", T_cw.size(), "must have a pose for each keyframe");
  require(alive.empty() || alive.size() == T_cw.size(), "alive", alive.size(), "must have a flag for each keyframe");
  std::vector<vec3<double>> estimate, truth;
  for (std::size_t i = 0; i < T_cw.size(); ++i) {
    if (!alive.empty() && alive[i] == 0) continue;
    const auto centre = true_camera_centre(r, r.t_ns[i]);
    if (!centre) continue;
    estimate.push_back(camera_centre(to_isometry<double>(T_cw[i])));
    truth.push_back(*centre);
  }
  return absolute_trajectory_error(estimate, truth, r.meta.sensor == "monocular");
}

TURBOMAP_END_NAMESPACE

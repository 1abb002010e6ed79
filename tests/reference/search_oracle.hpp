// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The correspondence search as its definition reads: every query keypoint against every candidate, one after the other,
/// in plain double. What the library's search is tested against, and what its speed is compared with.

#include "two_views.hpp"

namespace turbomap_test {

/// One camera of the query against one camera of a neighbour.
struct oracle_pair {
  oracle_pose T_ba;
  bool straight = false;  ///< both images are rectilinear
  Eigen::Matrix3d F;      ///< straight: pixel of a -> line in b
  bool guard = false;     ///< both rigs have one camera only
  Eigen::Vector2d epipole;
  bool no_baseline = false;  ///< too short for its direction to be more than rounding
};

template <class Descriptor, class Camera>
oracle_pair make_oracle_pair(const turbomap::posed_keyframe<Descriptor, Camera>& a, int camera_a,
                             const turbomap::posed_keyframe<Descriptor, Camera>& b, int camera_b) {
  oracle_pair pair;
  const oracle_pose T_aw = oracle_camera_pose(a, camera_a), T_bw = oracle_camera_pose(b, camera_b);
  pair.T_ba = T_bw * T_aw.inverse();
  const Eigen::Vector3d& t = pair.T_ba.t;
  pair.no_baseline = t.norm() <= 1e-6 * (T_aw.t.norm() + T_bw.t.norm());
  Eigen::Matrix3d K_a, K_b, cross;
  pair.straight =
      pinhole_matrix(a.view.cameras[camera_a].camera, K_a) && pinhole_matrix(b.view.cameras[camera_b].camera, K_b);
  if (!pair.straight) return pair;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  pair.F = K_b.inverse().transpose() * cross * pair.T_ba.R * K_a.inverse();
  pair.guard = a.view.camera_count == 1 && b.view.camera_count == 1 && t.z() != 0;
  if (pair.guard) pair.epipole = (K_b * t).hnormalized();
  return pair;
}

/// Can keypoint `i` of the query and keypoint `j` of the neighbour see one point?
template <class Descriptor, class Camera>
bool oracle_consistent(const oracle_pair& pair, const turbomap::keyframe_view<Descriptor, Camera>& a, int i,
                       const turbomap::keyframe_view<Descriptor, Camera>& b, int j,
                       const turbomap::search_options& options, close_calls& calls) {
  const Eigen::Vector2d pixel_a = pixel_of(a, i), pixel_b = pixel_of(b, j);
  const double sigma2_a = oracle_sigma2(options.scales, a.octave[i]),
               sigma2_b = oracle_sigma2(options.scales, b.octave[j]);
  const Eigen::Vector3d line =
      pair.straight ? Eigen::Vector3d(pair.F * pixel_a.homogeneous()) : Eigen::Vector3d::Zero();
  if (pair.straight && line.head<2>().isZero(0)) return false;  // no baseline at all, no line
  calls.any = calls.any || pair.no_baseline;
  if (pair.guard && !a.is_stereo(i) && !b.is_stereo(j)) {
    const double radius = options.epipole_radius * std::sqrt(oracle_scale(options.scales, b.octave[j]));
    if (calls.less((pair.epipole - pixel_b).norm(), radius)) return false;
  }
  if (pair.straight) {
    const double distance = line.dot(pixel_b.homogeneous()), norm2 = line.head<2>().squaredNorm();
    return calls.less(distance * distance, options.line_chi2 * sigma2_b * norm2);
  }
  const Eigen::Vector3d ray_a = bearing_of(a, i), ray_b = bearing_of(b, j);
  if (!calls.at_most((pair.T_ba.R * ray_a).dot(ray_b), options.max_parallax_cosine, 1)) return false;
  Eigen::Vector3d x_a;
  bool shaky = false;
  const bool finite = oracle_triangulate({}, ray_a, pair.T_ba, ray_b, x_a, shaky);
  calls.any = calls.any || shaky;
  if (!finite || !calls.less(0, x_a.z(), x_a.norm())) return false;
  const Eigen::Vector3d x_b = pair.T_ba * x_a;
  if (!calls.less(0, x_b.z(), x_b.norm())) return false;
  Eigen::Vector2d seen;
  if (!oracle_project(a.cameras[a.camera_of(i)].camera, x_a, seen)) return false;
  if (!calls.at_most((seen - pixel_a).squaredNorm(), options.reprojection_chi2 * sigma2_a)) return false;
  if (!oracle_project(b.cameras[b.camera_of(j)].camera, x_b, seen)) return false;
  return calls.at_most((seen - pixel_b).squaredNorm(), options.reprojection_chi2 * sigma2_b);
}

/// All matches in (neighbour, query keypoint) order. The views are in host memory.
/// \param doubtful  when given: the results that hung on a close call, in the same order
template <class Descriptor, class Camera>
std::vector<turbomap::correspondence<typename Descriptor::distance_type>> search_oracle(
    const turbomap::posed_keyframe<Descriptor, Camera>& query,
    turbomap::span<const turbomap::posed_keyframe<Descriptor, Camera>> given, const turbomap::search_options& options,
    std::vector<doubtful_result>* doubtful = nullptr) {
  std::vector<turbomap::posed_keyframe<Descriptor, Camera>> neighbours(given.begin(), given.end());
  const bool across_rig = options.across_rig && query.view.camera_count > 1;
  if (across_rig) neighbours.push_back(query);
  using distance_type = typename Descriptor::distance_type;
  const bool grouped = options.candidate_set == turbomap::candidates::grouped;
  const auto free = [](const auto& keyframe, int i) {
    return keyframe.has_point.empty() || keyframe.has_point[static_cast<std::size_t>(i)] == 0;
  };
  std::vector<turbomap::correspondence<distance_type>> matches;
  const auto query_group = groups_of(query.view);
  for (std::size_t n = 0; n < neighbours.size(); ++n) {
    const auto& neighbour = neighbours[n];
    const auto neighbour_group = groups_of(neighbour.view);
    std::vector<std::vector<oracle_pair>> pairs(static_cast<std::size_t>(query.view.camera_count));
    for (std::size_t a = 0; a < pairs.size(); ++a)
      for (int b = 0; b < neighbour.view.camera_count; ++b)
        pairs[a].push_back(make_oracle_pair(query, static_cast<int>(a), neighbour, b));

    for (int i = 0; i < query.view.keypoint_count; ++i) {
      const std::uint32_t group = query_group[static_cast<std::size_t>(i)];
      if (!free(query, i) || (grouped && group == turbomap::keypoint::no_group)) continue;
      const auto& pairs_of_i = pairs[static_cast<std::size_t>(query.view.camera_of(i))];
      int best = -1;
      auto best_distance = static_cast<distance_type>(options.max_distance);
      close_calls calls;
      for (int j = 0; j < neighbour.view.keypoint_count; ++j) {
        if (!free(neighbour, j) || (grouped && neighbour_group[static_cast<std::size_t>(j)] != group)) continue;
        const auto distance = Descriptor::distance(query.view.descriptor_of(i), neighbour.view.descriptor_of(j));
        if (distance > best_distance) continue;
        if (across_rig && n == given.size() && query.view.camera_of(i) == query.view.camera_of(j)) continue;
        const bool tie = best >= 0 && distance == best_distance;
        if (tie && options.ties == turbomap::tie_rule::lowest_index) continue;  // j ascends
        const auto& pair = pairs_of_i[static_cast<std::size_t>(neighbour.view.camera_of(j))];
        if (!oracle_consistent(pair, query.view, i, neighbour.view, j, options, calls)) continue;
        best = j;
        best_distance = distance;
      }
      const auto n32 = static_cast<std::int32_t>(n);
      if (best >= 0) matches.push_back({n32, i, best, best_distance});
      if (calls.any && doubtful != nullptr) doubtful->push_back({n32, i});
    }
  }
  return matches;
}

}  // namespace turbomap_test

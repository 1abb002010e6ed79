// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The current keyframe's points and covisibility after the fusion of one iteration, as recorded.

#include <cstdint>
#include <vector>

#include <turbomap/config.hpp>
#include "recording_snapshot_source.hpp"

namespace turbomap {

/// One row per keypoint of the current keyframe that sees a point: a rig may see a point twice, and has two rows then.
struct map_update_snapshot {
  std::vector<std::int32_t> keypoint, point;  ///< of the current keyframe; the peer's id
  std::vector<vec3<float>> position, normal;
  std::vector<float> min_distance, max_distance;  ///< m; already 0.8 and 1.2 times the range's ends
  std::vector<descriptor_bytes> descriptor;
  std::vector<std::int32_t> observation_count;  ///< one with u_right counts 2
  std::vector<std::int32_t> reference;          ///< keyframe
  std::vector<std::int64_t> obs_off;            ///< rows of the observations
  std::vector<std::int32_t> obs_kf;             ///< ascending; some are keyframes that are no longer in the map
  std::vector<index_pair> obs_keypoints;        ///< left and right, -1: none
  std::vector<std::int32_t> covis_kf, covis_w;  ///< of the current keyframe, most shared points first

  span<const std::int32_t> observers(std::size_t i) const { return slice(obs_kf, offset_rows(obs_off, i)); }
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

inline void read_map_update(const snapshot_source& from, std::int32_t keyframe, map_update_snapshot& out) {
  from.read("fpost_kp", out.keypoint);
  const std::size_t n = out.keypoint.size();
  from.read("fpost_pt", out.point, n);
  from.read_finite("fpost_pos", out.position, n);
  from.read_finite("fpost_normal", out.normal, n);
  from.read_finite("fpost_mindist", out.min_distance, n);
  from.read_finite("fpost_maxdist", out.max_distance, n);
  from.read("fpost_desc", out.descriptor, n);
  from.read("fpost_nobs", out.observation_count, n);
  from.read("fpost_refkf", out.reference, n);
  from.read("fpost_obs_kf", out.obs_kf);
  from.read("fpost_obs_lr", out.obs_keypoints, out.obs_kf.size());
  from.read_offsets("fpost_obs_off", out.obs_off, n, out.obs_kf.size());
  from.check.in_range("fpost_kp", out.keypoint, 0, from.keypoint_count(keyframe));
  from.check.in_range("fpost_pt", out.point, 0, std::int64_t{1} << 31);
  from.check.in_range("fpost_nobs", out.observation_count, 0, std::int64_t{1} << 31);
  from.check.in_range("fpost_refkf", out.reference, 0, from.keyframe_count());
  from.check.in_range("fpost_obs_kf", out.obs_kf, 0, from.keyframe_count());
  if (!from.recording.has_final()) from.posed("fpost_obs_kf", out.obs_kf);  // culled ones have their pose there
  from.views("fpost_obs_lr", out.obs_keypoints, out.obs_kf);
  for (std::size_t i = 0; i < n; ++i) {
    bool found = false;
    for (const std::int32_t observer : out.observers(i)) found = found || observer == out.reference[i];
    if (!found) from.check.fail_row("fpost_refkf", i, "is not among the point's observers");
  }
  from.read("fpost_covis_kf", out.covis_kf);
  from.read("fpost_covis_w", out.covis_w, out.covis_kf.size());
  from.check.in_range("fpost_covis_kf", out.covis_kf, 0, from.keyframe_count());
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

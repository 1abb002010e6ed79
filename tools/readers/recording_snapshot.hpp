// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The recorded input and output of every stage in one iteration of local mapping: the state at its start, the search,
/// the creation of points, fusion, map update, culling. A further stage adds a file recording_snapshot_*.hpp, a member
/// and a call.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include <turbomap/config.hpp>
#include "recording_snapshot_culling.hpp"
#include "recording_snapshot_fusion.hpp"
#include "recording_snapshot_map_update.hpp"
#include "recording_snapshot_search.hpp"
#include "recording_snapshot_source.hpp"

namespace turbomap {

/// One iteration. The stages that a recording may leave out are optional: each is there whole or not at all.
struct recording_snapshot {
  std::int32_t iteration = 0, keyframe = 0;  ///< the same number: one iteration per keyframe
  std::vector<std::int32_t> kf_alive;        ///< keyframes of the map at the start, ascending
  std::vector<rigid_transform<float>> kf_T_cw;
  std::vector<std::int32_t> covis_kf, covis_w;  ///< the current keyframe's covisible ones, most shared points first
  search_snapshot search;
  creation_snapshot creation;
  std::optional<fusion_snapshot> fusion;
  std::optional<map_update_snapshot> map_update;
  std::optional<culling_snapshot> culling;

  /// Mask of the current keyframe while neighbour i is searched, and of neighbour i.
  span<const std::uint8_t> mask1(std::size_t i) const {
    const std::size_t n = search.neighbours.empty() ? 0 : search.mask1.size() / search.neighbours.size();
    return {search.mask1.data() + i * n, n};
  }
  span<const std::uint8_t> mask2(std::size_t i) const { return slice(search.mask2, offset_rows(search.mask2_off, i)); }
  /// Matches with neighbour i; batch: on the masks of the start (mask1(0) and mask2(i)).
  span<const index_pair> pairs(std::size_t i) const { return slice(search.pairs, offset_rows(search.pairs_off, i)); }
  span<const index_pair> batch_pairs(std::size_t i) const {
    return slice(search.batch_pairs, offset_rows(search.batch_pairs_off, i));
  }
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

inline void read_start(snapshot_source& from, recording_snapshot& s) {
  from.read("kf_alive", s.kf_alive);
  from.read_finite("kf_Tcw", s.kf_T_cw, s.kf_alive.size());
  from.read("covis_kf", s.covis_kf);
  from.read("covis_w", s.covis_w, s.covis_kf.size());
  from.check.in_range("kf_alive", s.kf_alive, 0, from.keyframe_count());
  from.check.rotations("kf_Tcw", s.kf_T_cw);
  from.check.in_range("covis_kf", s.covis_kf, 0, from.keyframe_count());
  from.has_pose.assign(from.recording.keyframe_count(), 0);
  for (std::size_t i = 0; i < s.kf_alive.size(); ++i) {
    if (i > 0 && s.kf_alive[i] <= s.kf_alive[i - 1]) from.check.fail_row("kf_alive", i, "is not above the one before");
    from.has_pose[static_cast<std::size_t>(s.kf_alive[i])] = 1;
  }
}

}  // namespace detail

/// Reads and validates the snapshot of an iteration of the recording in `directory`. Throws bad_file naming file, array
/// and reason.
inline recording_snapshot read_snapshot(const recording& r, const std::filesystem::path& directory,
                                        std::int32_t iteration) {
  const auto where = snapshot_directory(directory, iteration);
  detail::snapshot_source from{r, where, detail::array_checks(where)};
  const detail::json_reader meta(where / "meta.json");
  recording_snapshot s;
  s.iteration = meta.get<std::int32_t>("iter"), s.keyframe = meta.get<std::int32_t>("kf");
  if (s.iteration != iteration) meta.fail("iter", "is not that of the directory");
  if (s.keyframe < 0 || s.keyframe >= from.keyframe_count()) meta.fail("kf", "is not a keyframe of the recording");
  if (meta.get<std::int64_t>("N") != from.keypoint_count(s.keyframe))
    meta.fail("N", "is not the keyframe's keypoint count");
  detail::read_start(from, s);
  if (from.has_pose[static_cast<std::size_t>(s.keyframe)] == 0) meta.fail("kf", "is not in kf_alive");
  detail::read_search(from, s.keyframe, s.search);
  detail::read_creation(from, s.search.pairs.size(), s.creation);
  if (from.has_group({"fs_pos", "fuse_targets", "fuse_call_kf", "fuseb_fwd_state", "fuseb_bwd_state"}))
    detail::read_fusion(from, s.keyframe, s.fusion.emplace());
  if (from.has_group({"fpost_kp", "fpost_pt", "fpost_obs_kf", "fpost_covis_kf"}))
    detail::read_map_update(from, s.keyframe, s.map_update.emplace());
  if (from.has_group({"cull_in_kf", "cull_kf_kp", "cull_pt_id", "cull_status"}))
    detail::read_culling(from, meta, s.culling.emplace());
  return s;
}

TURBOMAP_END_NAMESPACE

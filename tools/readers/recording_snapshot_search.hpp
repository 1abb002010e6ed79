// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The recorded correspondence search and creation of map points of one iteration.

#include <cstdint>
#include <string>
#include <vector>

#include <turbomap/config.hpp>
#include "recording_snapshot_source.hpp"

namespace turbomap {

/// The recorded search for correspondences. Row i belongs to neighbour i; `*_off` have one offset more.
struct search_snapshot {
  std::vector<std::int32_t> neighbours;    ///< keyframe indices, in the order searched
  std::vector<float> baseline;             ///< m, as the peer computed it
  std::vector<vec3<float>> centre_used;    ///< the centre of the current keyframe that it was computed with
  std::vector<std::uint8_t> skipped;       ///< 1: baseline too short, not searched
  std::vector<std::uint8_t> mask1, mask2;  ///< 1: the keypoint has a map point when neighbour i is searched
  std::vector<std::int64_t> mask2_off;     ///< mask1 is [neighbours, keypoints of the current keyframe]
  std::vector<std::int64_t> pairs_off, batch_pairs_off;
  std::vector<index_pair> pairs;        ///< one neighbour after the other, masks changing
  std::vector<index_pair> batch_pairs;  ///< every neighbour on the masks of the start
};

/// What became of each row of search_snapshot::pairs.
struct creation_snapshot {
  std::vector<std::uint8_t> code;     ///< 0 accepted, 1.. the reason why not
  std::vector<std::int8_t> method;    ///< 0 triangulated, 1 stereo of the current, 2 of the neighbour, -1 none
  std::vector<vec3<float>> position;  ///< NaN when none was computed
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

inline void check_pairs(const snapshot_source& from, std::int32_t keyframe, const search_snapshot& s,
                        const char* pairs_name, const std::vector<std::int64_t>& offsets,
                        const std::vector<index_pair>& pairs) {
  const std::int64_t count1 = from.keypoint_count(keyframe);
  for (std::size_t i = 0; i < s.neighbours.size(); ++i) {
    const std::int64_t count2 = from.keypoint_count(s.neighbours[i]);
    for (auto p = offsets[i]; p < offsets[i + 1]; ++p) {
      const auto row = static_cast<std::size_t>(p);
      if (pairs[row][0] < 0 || pairs[row][0] >= count1 || pairs[row][1] < 0 || pairs[row][1] >= count2)
        from.check.fail_row(pairs_name, row,
                            "is (" + std::to_string(pairs[row][0]) + ", " + std::to_string(pairs[row][1]) +
                                "), but the keyframes have " + std::to_string(count1) + " and " +
                                std::to_string(count2) + " keypoints");
    }
  }
}

inline void read_search(const snapshot_source& from, std::int32_t keyframe, search_snapshot& out) {
  from.read("sft_neigh", out.neighbours);
  from.posed("sft_neigh", out.neighbours);
  const std::size_t n = out.neighbours.size();
  from.read_finite("sft_baseline", out.baseline, n);
  from.read_finite("sft_Ow1_used", out.centre_used, n);
  from.read("sft_skipped", out.skipped, n);
  from.read_shape("sft_mask1", out.mask1, {n, static_cast<std::size_t>(from.keypoint_count(keyframe))});
  from.read("sft_mask2", out.mask2);
  from.read_offsets("sft_mask2_off", out.mask2_off, n, out.mask2.size());
  for (std::size_t i = 0; i < n; ++i)
    if (out.mask2_off[i + 1] - out.mask2_off[i] != from.keypoint_count(out.neighbours[i]))
      from.check.fail_row("sft_mask2_off", i, "does not span the keypoints of its neighbour");
  from.check.in_range("sft_skipped", out.skipped, 0, 2);
  from.check.in_range("sft_mask1", out.mask1, 0, 2);
  from.check.in_range("sft_mask2", out.mask2, 0, 2);
  from.read("sft_pairs", out.pairs);
  from.read_offsets("sft_pairs_off", out.pairs_off, n, out.pairs.size());
  from.read("sftb_pairs", out.batch_pairs);
  from.read_offsets("sftb_pairs_off", out.batch_pairs_off, n, out.batch_pairs.size());
  check_pairs(from, keyframe, out, "sft_pairs", out.pairs_off, out.pairs);
  check_pairs(from, keyframe, out, "sftb_pairs", out.batch_pairs_off, out.batch_pairs);
}

inline void read_creation(const snapshot_source& from, std::size_t pairs, creation_snapshot& out) {
  from.read("cnm_code", out.code, pairs);
  from.read("cnm_method", out.method, pairs);
  from.read("cnm_x3D", out.position, pairs);
  from.check.in_range("cnm_code", out.code, 0, 11);
  from.check.in_range("cnm_method", out.method, -1, 3);
  from.check.finite("cnm_x3D", out.position, [&](std::size_t i) { return out.method[i] >= 0; });
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

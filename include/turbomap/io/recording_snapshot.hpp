// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The recorded input and output of every stage in one iteration of local mapping. So far: the state at its start, the
/// correspondence search and the creation of map points. A further stage adds a struct, a read_* function and its call.

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../span.hpp"
#include "recording.hpp"

namespace turbomap {

/// A match: keypoint of the current keyframe, keypoint of the neighbour.
using index_pair = std::array<std::int32_t, 2>;

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

/// One iteration.
struct recording_snapshot {
  std::int32_t iteration = 0, keyframe = 0;  ///< the same number: one iteration a keyframe
  std::vector<std::int32_t> kf_alive;        ///< keyframes of the map at the start, ascending
  std::vector<rigid_transform<float>> kf_T_cw;
  std::vector<std::int32_t> covis_kf, covis_w;  ///< the current keyframe's covisible ones, most shared points first
  search_snapshot search;
  creation_snapshot creation;

  /// Mask of the current keyframe while neighbour i is searched, and of neighbour i.
  span<const std::uint8_t> mask1(std::size_t i) const {
    const std::size_t n = search.neighbours.empty() ? 0 : search.mask1.size() / search.neighbours.size();
    return {search.mask1.data() + i * n, n};
  }
  span<const std::uint8_t> mask2(std::size_t i) const { return part(search.mask2, search.mask2_off, i); }
  /// Matches with neighbour i; batch: on the masks of the start (mask1(0) and mask2(i)).
  span<const index_pair> pairs(std::size_t i) const { return part(search.pairs, search.pairs_off, i); }
  span<const index_pair> batch_pairs(std::size_t i) const {
    return part(search.batch_pairs, search.batch_pairs_off, i);
  }

 private:
  template <class T>
  static span<const T> part(const std::vector<T>& values, const std::vector<std::int64_t>& offsets, std::size_t i) {
    return slice(values, {static_cast<std::size_t>(offsets[i]), static_cast<std::size_t>(offsets[i + 1])});
  }
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Reads arrays of one snapshot and holds what their checks need.
struct snapshot_source {
  const turbomap::recording& recording;
  std::filesystem::path directory;
  array_checks check;

  template <class Row>
  void read(const char* name, std::vector<Row>& rows) const {
    rows = read_npy_rows<Row>(directory / (std::string(name) + ".npy"));
  }
  template <class Row>
  void read(const char* name, std::vector<Row>& rows, std::size_t expected) const {
    read(name, rows);
    check.size(name, rows.size(), expected);
  }
  std::int64_t keypoint_count(std::int32_t keyframe) const {
    return static_cast<std::int64_t>(recording.keypoints(static_cast<std::size_t>(keyframe)).size());
  }
  std::int64_t keyframe_count() const { return static_cast<std::int64_t>(recording.keyframe_count()); }
};

inline void check_pairs(const snapshot_source& from, const recording_snapshot& s, const char* offsets_name,
                        const char* pairs_name, const std::vector<std::int64_t>& offsets,
                        const std::vector<index_pair>& pairs) {
  from.check.size(offsets_name, offsets.size(), s.search.neighbours.size() + 1);
  from.check.offsets(offsets_name, offsets, pairs.size());
  const std::int64_t count1 = from.keypoint_count(s.keyframe);
  for (std::size_t i = 0; i < s.search.neighbours.size(); ++i) {
    const std::int64_t count2 = from.keypoint_count(s.search.neighbours[i]);
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

inline void read_start(const snapshot_source& from, recording_snapshot& s) {
  from.read("kf_alive", s.kf_alive);
  from.read("kf_Tcw", s.kf_T_cw, s.kf_alive.size());
  from.read("covis_kf", s.covis_kf);
  from.read("covis_w", s.covis_w, s.covis_kf.size());
  from.check.in_range("kf_alive", s.kf_alive, 0, from.keyframe_count());
  from.check.finite("kf_Tcw", s.kf_T_cw);
  from.check.rotations("kf_Tcw", s.kf_T_cw);
  from.check.in_range("covis_kf", s.covis_kf, 0, from.keyframe_count());
}

inline void read_search(const snapshot_source& from, recording_snapshot& s) {
  auto& out = s.search;
  from.read("sft_neigh", out.neighbours);
  from.check.in_range("sft_neigh", out.neighbours, 0, from.keyframe_count());
  const std::size_t n = out.neighbours.size();
  from.read("sft_baseline", out.baseline, n);
  from.read("sft_Ow1_used", out.centre_used, n);
  from.read("sft_skipped", out.skipped, n);
  from.check.finite("sft_baseline", out.baseline);
  from.check.finite("sft_Ow1_used", out.centre_used);
  const auto mask1 = read_npy<std::uint8_t>(from.directory / "sft_mask1.npy");
  const auto keypoints = static_cast<std::size_t>(from.keypoint_count(s.keyframe));
  if (mask1.shape != std::vector<std::size_t>{n, keypoints})
    from.check.fail("sft_mask1", "has shape " + shape_text(mask1.shape) + ", not " + shape_text({n, keypoints}));
  out.mask1 = mask1.values;
  from.read("sft_mask2_off", out.mask2_off, n + 1);
  from.read("sft_mask2", out.mask2);
  from.check.offsets("sft_mask2_off", out.mask2_off, out.mask2.size());
  for (std::size_t i = 0; i < n; ++i)
    if (out.mask2_off[i + 1] - out.mask2_off[i] != from.keypoint_count(out.neighbours[i]))
      from.check.fail_row("sft_mask2_off", i, "does not span the keypoints of its neighbour");
  from.check.in_range("sft_skipped", out.skipped, 0, 2);
  from.check.in_range("sft_mask1", out.mask1, 0, 2);
  from.check.in_range("sft_mask2", out.mask2, 0, 2);
  from.read("sft_pairs_off", out.pairs_off);
  from.read("sft_pairs", out.pairs);
  from.read("sftb_pairs_off", out.batch_pairs_off);
  from.read("sftb_pairs", out.batch_pairs);
  check_pairs(from, s, "sft_pairs_off", "sft_pairs", out.pairs_off, out.pairs);
  check_pairs(from, s, "sftb_pairs_off", "sftb_pairs", out.batch_pairs_off, out.batch_pairs);
}

inline void read_creation(const snapshot_source& from, recording_snapshot& s) {
  const std::size_t pairs = s.search.pairs.size();
  from.read("cnm_code", s.creation.code, pairs);
  from.read("cnm_method", s.creation.method, pairs);
  from.read("cnm_x3D", s.creation.position, pairs);
  from.check.in_range("cnm_code", s.creation.code, 0, 11);
  from.check.in_range("cnm_method", s.creation.method, -1, 3);
  from.check.finite("cnm_x3D", s.creation.position, [&](std::size_t i) { return s.creation.method[i] >= 0; });
}

}  // namespace detail

/// Reads and validates the snapshot of an iteration of the recording in `directory`. Throws bad_file naming file, array
/// and reason.
inline recording_snapshot read_snapshot(const recording& r, const std::filesystem::path& directory,
                                        std::int32_t iteration) {
  const auto where = snapshot_directory(directory, iteration);
  const detail::snapshot_source from{r, where, detail::array_checks(where)};
  const detail::json_reader meta(where / "meta.json");
  recording_snapshot s;
  s.iteration = meta.get<std::int32_t>("iter"), s.keyframe = meta.get<std::int32_t>("kf");
  if (s.iteration != iteration) meta.fail("iter", "is not that of the directory");
  if (s.keyframe < 0 || s.keyframe >= from.keyframe_count()) meta.fail("kf", "is not a keyframe of the recording");
  if (meta.get<std::int64_t>("N") != from.keypoint_count(s.keyframe))
    meta.fail("N", "is not the keyframe's keypoint count");
  detail::read_start(from, s);
  detail::read_search(from, s);
  detail::read_creation(from, s);
  return s;
}

TURBOMAP_END_NAMESPACE

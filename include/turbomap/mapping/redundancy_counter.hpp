// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How many points of a keyframe are redundant, counted in the user's map: for one keyframe, or for many that share points
/// (redundancy_counter).

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../config.hpp"
#include "../culling/redundancy.hpp"
#include "../map/map_traits.hpp"
#include "../map/numbering.hpp"
#include "../map/observation_counts.hpp"
#include "../map/read_ahead.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "../store/keyframe_handle.hpp"
#include "handle_table.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Keyframes that see the point at `octave` or finer, but no more than `enough`: counting ends there. A prefix sum of the
/// kept counts; without them, one walk over the observations. `scratch` is a list of keyframes, reused memory.
/// O(octaves), or O(views x enough).
template <class Map, class List>
std::uint32_t observers_up_to(const Map& map, typename map_traits<Map>::point point, int octave, std::uint32_t enough,
                              [[maybe_unused]] List& scratch) {
  using traits = map_traits<Map>;
  if constexpr (counts_octaves_v<Map>) {
    const auto& counts = traits::octave_counts(map, point);
    return count_up_to({counts.data(), counts.size()}, octave, enough);
  } else {
    using keyframe = typename traits::keyframe;
    scratch.clear();
    traits::for_each_observation(map, point, [&](const keyframe& observer, std::size_t keypoint) {
      if (scratch.size() >= enough || keypoint_of(map, observer, keypoint).octave > octave) return;
      for (const keyframe& k : scratch)
        if (k == observer) return;  // by another camera of its rig
      scratch.push_back(observer);
    });
    return static_cast<std::uint32_t>(scratch.size());
  }
}

/// Whether a keypoint is near enough to count, where the depth matters. No branch: which are cannot be predicted.
inline int is_near(const keypoint& k, const keyframe_culling_options& options) {
  return static_cast<int>(k.depth >= 0) & static_cast<int>(k.depth <= options.max_depth);
}

/// Points of the keyframe that count, and how many of them are redundant. A short sum per point where the map keeps counts
/// (counts_octaves_v), else a walk over its views. `scratch` is a list of keyframes, reused memory. O(keypoints), or O(views of the
/// points).
template <class Map, class List>
redundancy count_redundant(const Map& map, typename map_traits<Map>::keyframe keyframe,
                           const keyframe_culling_options& options, List& scratch) {
  using traits = map_traits<Map>;
  const std::uint32_t enough = observers_with_own(options);
  redundancy count;
  for (std::size_t i = 0; i < keypoint_count_of(map, keyframe); ++i) {
    const auto point = traits::point_at(map, keyframe, i);
    if (point == typename traits::point{} || !traits::alive(map, point)) continue;
    const auto& k = keypoint_of(map, keyframe, i);
    if (options.max_depth > 0 && is_near(k, options) == 0) continue;
    ++count.points;
    count.redundant += observers_up_to(map, point, k.octave + options.octave_slack, enough, scratch) >= enough ? 1 : 0;
  }
  return count;
}

/// Counts as count_redundant() does, for many keyframes that share points: of each point the octave from which on enough
/// keyframes see it is found once, and known until forget(). Which keypoints of a keyframe count is found once too, as long as
/// the keyframe is in the store. Where a map keeps no counts, or has no indices of points, it is count_redundant(). Make one and
/// use it again: its memory is reused.
template <class Map>
class redundancy_counter {
 public:
  using traits = map_traits<Map>;                                                        ///< how the map is read
  using keyframe = typename traits::keyframe;                                            ///< names a keyframe
  using point = typename traits::point;                                                  ///< names a point
  static constexpr bool keeps = counts_octaves_v<Map> && point_numbering<Map>::indexed;  ///< anything between calls

  /// Nothing is known any more: the map, or the options, may be others. O(points that were known).
  void clear() {
    for (const std::uint32_t i : known_) enough_[i] = unknown;
    known_.clear(), observers_.clear();  // names keep objects alive
  }
  /// Keyframes that are in the store by this table (null: none) are remembered from now on: which of their keypoints count, which
  /// never changes. It takes five bytes per keypoint that counts, until drop_keypoints() or until the place in the store is another's.
  /// The table must outlive the calls that follow.
  void remember_by(const handle_table* stored) { stored_ = stored; }
  /// Gives the memory of a keyframe's keypoints back. \param id  of a keyframe that is in the store yet
  void drop_keypoints(std::uint64_t id) {
    keyframe_handle handle;
    if (stored_ == nullptr || !stored_->find(id, handle) || handle.slot >= remembered_.size()) return;
    remembered_[handle.slot] = {};
  }
  /// The points of a keyframe are looked up again.
  void forget(const Map& map, const keyframe& k) {
    if constexpr (keeps) {
      for (std::size_t i = 0; i < keypoint_count_of(map, k); ++i) {
        const point p = traits::point_at(map, k, i);
        if (p == point{}) continue;
        const auto at = static_cast<std::size_t>(traits::index(map, p));
        if (at < enough_.size() && enough_[at] != unknown) enough_[at] = stale;
      }
    }
  }
  /// As count_redundant().
  redundancy operator()(const Map& map, const keyframe& k, const keyframe_culling_options& options) {
    if constexpr (!keeps) {
      return count_redundant(map, k, options, observers_);
    } else {
      redundancy count;
      const counted_keypoints& counted = keypoints_that_count(map, k, options);
      const std::size_t listed = list(map, k, counted);
      look_up_stale(map, k, counted, listed, options);
      for (std::size_t n = 0; n < listed; ++n) {
        const auto [i, p] = listed_[n];
        const std::uint16_t enough = enough_[p];
        count.points += enough != dead ? 1 : 0;
        count.redundant += counted.octaves[i] + options.octave_slack >= enough ? 1 : 0;
      }
      return count;
    }
  }

 private:
  /// Of one keyframe: what never changes.
  struct counted_keypoints {
    keyframe_handle of;                     ///< the keyframe; none: not known
    std::size_t all = 0;                    ///< its keypoints, those that do not count too
    float max_depth = 0;                    ///< keyframe_culling_options::max_depth by which these count
    plain_vector<std::uint32_t> keypoints;  ///< ascending
    plain_vector<std::uint8_t> octaves;
  };
  struct view {
    std::uint32_t entry, point;  ///< of counted_keypoints; by index
  };
  // In enough_, besides octaves and beyond_octaves.
  static constexpr std::uint16_t dead = beyond_octaves + 1;         ///< does not count
  static constexpr std::uint16_t stale = 2 * beyond_octaves;        ///< to be looked up
  static constexpr std::uint16_t unknown = 2 * beyond_octaves + 1;  ///< that, and not in known_

  const counted_keypoints& keypoints_that_count(const Map& map, const keyframe& k,
                                                const keyframe_culling_options& options) {
    keyframe_handle handle;
    const std::size_t all = keypoint_count_of(map, k);
    const bool remember = stored_ != nullptr && stored_->find(traits::id(map, k), handle);
    if (remember && handle.slot >= remembered_.size()) remembered_.resize(handle.slot + std::size_t{1});
    counted_keypoints& counted = remember ? remembered_[handle.slot] : passing_;
    if (remember && counted.of == handle && counted.all == all && counted.max_depth == options.max_depth)
      return counted;
    counted.of = {};  // until all of them are listed
    // Those that are near cannot be predicted: written first, then kept or not.
    const bool at_any_depth = !(options.max_depth > 0);
    if (near_.size() < all) near_.resize(all);
    std::size_t count = 0;
    for (std::size_t i = 0; i < all; ++i) {
      near_[count] = static_cast<std::uint32_t>(i);
      count += at_any_depth ? std::size_t{1} : static_cast<std::size_t>(is_near(keypoint_of(map, k, i), options));
    }
    counted.keypoints.resize(count), counted.octaves.resize(count);
    for (std::size_t n = 0; n < count; ++n) {
      counted.keypoints[n] = near_[n];
      counted.octaves[n] = keypoint_of(map, k, near_[n]).octave;
    }
    counted.all = all, counted.max_depth = options.max_depth, counted.of = handle;
    return counted;
  }
  /// Whether a slot is empty cannot be predicted: those with a point are listed first, without a branch.
  std::size_t list(const Map& map, const keyframe& k, const counted_keypoints& counted) {
    const std::size_t keypoints = counted.keypoints.size();
    if (listed_.size() < keypoints) listed_.resize(keypoints);
    std::size_t listed = 0;
    for (std::size_t i = 0; i < keypoints; ++i) {
      const point p = traits::point_at(map, k, counted.keypoints[i]);
      const bool there = !(p == point{});
      listed_[listed] = {static_cast<std::uint32_t>(i), there ? static_cast<std::uint32_t>(traits::index(map, p)) : 0U};
      listed += static_cast<std::size_t>(there);
    }
    return listed;
  }
  /// Those of the list that are not known. Their counts lie scattered: they are listed first, so that memory is asked ahead.
  void look_up_stale(const Map& map, const keyframe& k, const counted_keypoints& counted, std::size_t listed,
                     const keyframe_culling_options& options) {
    if (stale_.size() < listed) stale_.resize(listed);
    std::size_t stale_count = 0;
    for (std::size_t n = 0; n < listed; ++n) {
      const std::uint32_t p = listed_[n].point;
      if (p >= enough_.size()) enough_.resize(p + p / 2 + std::size_t{16}, unknown);
      stale_[stale_count] = listed_[n];
      stale_count += enough_[p] >= stale ? std::size_t{1} : 0;
    }
    for_each_ahead<static_cast<unsigned>(point_data::octaves)>(
        map, stale_count, [&](std::size_t n) { return traits::point_at(map, k, counted.keypoints[stale_[n].entry]); },
        [&](std::size_t n, const point& p) {
          if (enough_[stale_[n].point] >= stale) look_up(map, p, stale_[n].point, options);
        });
  }
  void look_up(const Map& map, const point& p, std::uint32_t index, const keyframe_culling_options& options) {
    if (enough_[index] == unknown) known_.push_back(index);
    enough_[index] = dead;
    if (!traits::alive(map, p)) return;
    const auto& counts = traits::octave_counts(map, p);
    enough_[index] = enough_from({counts.data(), counts.size()}, observers_with_own(options));
  }

  plain_vector<std::uint16_t> enough_;  ///< by index of the point
  plain_vector<std::uint32_t> known_;   ///< indices
  list_of<keyframe> observers_;         ///< scratch where nothing is kept
  plain_vector<view> listed_, stale_;   ///< of one keyframe
  const handle_table* stored_ = nullptr;
  std::vector<counted_keypoints> remembered_;  ///< by place in the store
  counted_keypoints passing_;                  ///< of a keyframe that is not in the store
  plain_vector<std::uint32_t> near_;           ///< scratch
};

TURBOMAP_END_NAMESPACE

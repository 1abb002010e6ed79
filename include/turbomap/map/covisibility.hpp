// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which keyframes see the same points as one keyframe, and how many.

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../plain_sort.hpp"
#include "../plain_vector.hpp"
#include "map_traits.hpp"
#include "numbering.hpp"
#include "read_ahead.hpp"

namespace turbomap {

/// As a limit: all of them.
inline constexpr std::size_t no_limit = static_cast<std::size_t>(-1);

/// As a filter of keyframes: accepts each of them.
struct every_keyframe {
  /// Every keyframe counts.
  template <class Keyframe>
  bool operator()(const Keyframe&) const {
    return true;
  }
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// A keyframe and how many points it shares with another.
template <class Keyframe>
struct covisible {
  Keyframe keyframe;  ///< its name.
  int shared_points;  ///< how many points both see.
};

/// Computes covisibilities; make one and use it again: its memory is reused.
template <class Map>
class covisibility {
 public:
  using traits = map_traits<Map>;              ///< how the map is read.
  using keyframe = typename traits::keyframe;  ///< the name of a keyframe.

  /// Keyframes that share at least `min_shared` points with `query`, most shared first, equal ones in order of insertion.
  /// Without any, the one that shares most (with any points at all) is left, as in [ORB-SLAM3]. A point counts once per
  /// keyframe, however many cameras see it.
  /// \param limit   the best ones, no more than so many
  /// \param accept  accept(keyframe): only these are looked at, as if the others shared nothing
  /// O(observations of its points + k log k). The caller holds the guard.
  template <class Accept = every_keyframe>
  const list_of<covisible<keyframe>>& operator()(const Map& map, keyframe query, int min_shared,
                                                 std::size_t limit = no_limit, Accept accept = {}) {
    count(map, query);
    rank(map, query, min_shared, limit, accept);
    return result_;
  }

 private:
  /// Of an observer.
  struct tally {
    std::uint64_t last_point = 0;  ///< serial of the last point that it was seen to observe
    int shared = 0;
  };

  template <class Accept>
  void rank(const Map& map, keyframe query, int min_shared, std::size_t limit, Accept accept) {
    result_.clear();
    covisible<keyframe> best{};
    std::uint64_t best_id = 0;
    for (const keyframe& k : observers_) {
      if (k == query || !accept(k)) continue;
      const covisible<keyframe> c{k, tallies_[place(map, k)].shared};
      if (c.shared_points >= min_shared) result_.push_back(c);
      const std::uint64_t id = traits::id(map, k);
      if (c.shared_points > best.shared_points || (c.shared_points == best.shared_points && id < best_id))
        best = c, best_id = id;
    }
    if (result_.empty() && best.shared_points > 0) result_.push_back(best);
    const auto first = [&](const covisible<keyframe>& a, const covisible<keyframe>& b) {
      return a.shared_points != b.shared_points ? a.shared_points > b.shared_points
                                                : traits::id(map, a.keyframe) < traits::id(map, b.keyframe);
    };
    const std::size_t keep = std::min(limit, result_.size());
    sort_plain(result_.data(), result_.size(), first);
    result_.resize(keep);
  }
  /// Each observer is looked up in one place per observation: this is the whole cost. What tallies hold of earlier calls is told
  /// by its serials, so nothing is emptied.
  void count(const Map& map, keyframe query) {
    if constexpr (!indexed) observer_numbers_.clear();
    counted_.clear(), observers_.clear();
    const std::uint64_t first = serial_ + 1;
    for_each_slot_ahead<point_data::entry + point_data::views>(map, query, [&](std::size_t, const auto& point) {
      if (point == typename traits::point{} || !traits::alive(map, point)) return;
      const std::size_t known = counted_.size();
      if (counted_.place(map, point) != known) return;  // two cameras of the query see it
      const std::uint64_t serial = ++serial_;
      traits::for_each_observation(map, point, [&](keyframe k, std::size_t) {
        const std::size_t at = place(map, k);
        if (at >= tallies_.size()) tallies_.resize(at + at / 2 + 16);
        tally& t = tallies_[at];
        if (t.last_point < first) {
          observers_.push_back(k);
          t = {};
        }
        t.shared += t.last_point != serial ? 1 : 0;  // else another camera of the same rig
        t.last_point = serial;
      });
    });
  }
  std::size_t place(const Map& map, const keyframe& k) {
    if constexpr (indexed)
      return static_cast<std::size_t>(traits::index(map, k));
    else
      return observer_numbers_.place(map, k);
  }

  static constexpr bool indexed = detail::has_map_index<Map, keyframe>::value;

  keyframe_numbering<Map> observer_numbers_;
  point_numbering<Map> counted_;
  list_of<keyframe> observers_;
  plain_vector<tally> tallies_;  ///< by index, or by number
  std::uint64_t serial_ = 0;     ///< of points, over all calls
  list_of<covisible<keyframe>> result_;
};

TURBOMAP_END_NAMESPACE

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
    for (std::size_t i = 1; i < observers_.size(); ++i)  // 0 is the query
      if (shared_[i] != 0 && !accept(observers_[i])) shared_[i] = 0;
    rank(map, min_shared, limit);
    return result_;
  }

 private:
  void rank(const Map& map, int min_shared, std::size_t limit) {
    result_.clear();
    covisible<keyframe> best{};
    std::uint64_t best_id = 0;
    for (std::size_t i = 1; i < observers_.size(); ++i) {
      if (shared_[i] == 0) continue;
      const covisible<keyframe> c{observers_[i], shared_[i]};
      if (c.shared_points >= min_shared) result_.push_back(c);
      const std::uint64_t id = traits::id(map, c.keyframe);
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
  void count(const Map& map, keyframe query) {
    observer_numbers_.clear(), counted_.clear();
    observers_.assign(1, query), shared_.assign(1, 0), last_point_.assign(1, 0);
    observer_numbers_.place(map, query);
    const std::size_t keypoints = keypoint_count_of(map, query);
    for (std::size_t i = 0; i < keypoints; ++i) {
      const auto point = traits::point_at(map, query, i);
      if (point == typename traits::point{} || !traits::alive(map, point)) continue;
      const std::size_t serial = counted_.size() + 1;
      if (counted_.place(map, point) + 1 != serial) continue;  // two cameras of the query see it
      traits::for_each_observation(map, point, [&](keyframe k, std::size_t) {
        const std::size_t at = observer_numbers_.place(map, k);
        if (at == observers_.size()) observers_.push_back(k), shared_.push_back(0), last_point_.push_back(0);
        shared_[at] += last_point_[at] != serial ? 1 : 0;  // else another camera of the same rig
        last_point_[at] = serial;
      });
    }
  }

  keyframe_numbering<Map> observer_numbers_;
  point_numbering<Map> counted_;
  list_of<keyframe> observers_;
  plain_vector<int> shared_;
  plain_vector<std::size_t> last_point_;
  list_of<covisible<keyframe>> result_;
};

TURBOMAP_END_NAMESPACE

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
#include "number_points.hpp"
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
    rank(map, query, min_shared, limit, accept,
         [&](std::size_t i) { return tallies_[place(map, observers_[i])].shared; });
    return result_;
  }

  /// The same of each of `queries`, which differ: visit(list) for one after the other. A point that several of them see is
  /// read once for up to 16 of them, so this takes less time than one call for each where they see the same things.
  /// visit() must not use this object.
  template <class Accept, class Visit>
  void of_each(const Map& map, const list_of<keyframe>& queries, int min_shared, std::size_t limit, Accept accept,
               Visit visit) {
    for (std::size_t first = 0; first < queries.size(); first += row::size) {
      const std::size_t count = std::min(queries.size() - first, row::size);
      count_rows(map, queries.data() + first, count);
      for (std::size_t q = 0; q < count; ++q) {
        rank(map, queries[first + q], min_shared, limit, accept, [&](std::size_t i) { return rows_[i].shared[q]; });
        visit(result_);
      }
    }
  }

 private:
  /// Of an observer.
  struct tally {
    std::uint64_t last_point = 0;  ///< serial of the last point that it was seen to observe
    int shared = 0;                ///< or, of several queries, the observer's row
  };
  /// What an observer shares with each of several queries.
  struct row {
    static constexpr std::size_t size = 16;  ///< a cache line
    std::int32_t shared[size];
  };

  /// \param shared  shared(i): with the i-th observer
  template <class Accept, class Shared>
  void rank(const Map& map, keyframe query, int min_shared, std::size_t limit, Accept accept, Shared shared) {
    result_.clear();
    covisible<keyframe> best{};
    std::uint64_t best_id = 0;
    for (std::size_t i = 0; i < observers_.size(); ++i) {
      const keyframe& k = observers_[i];
      const covisible<keyframe> c{k, shared(i)};
      if (c.shared_points == 0 || k == query || !accept(k)) continue;
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
  /// Counts the points that each keyframe shares with the query. Its cost is one look at a tally per observation. Tallies are not
  /// emptied between calls: the serial in a tally says whether it is of an earlier call.
  void count(const Map& map, keyframe query) {
    if constexpr (!indexed) observer_numbers_.clear();
    counted_.clear(), observers_.clear(), points_.clear();
    number_points_of(map, query, 0, keypoint_count_of(map, query), counted_, scratch_,
                     [&](const auto& point, std::size_t, bool is_new) {
                       if (is_new) points_.push_back(point);  // else two cameras of the query see it
                     });
    const std::uint64_t first = serial_ + 1;
    const auto each = [&](std::size_t i) -> const auto& { return points_[i]; };
    for_each_ahead<point_data::entry + point_data::views>(
        map, points_.size(), each, [&](std::size_t, const auto& point) {
          if (!traits::alive(map, point)) return;
          const std::uint64_t serial = ++serial_;
          traits::for_each_observation(map, point, [&](keyframe k, std::size_t) {
            if (k == keyframe{}) return;  // a list that contradicts the map
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
  /// The same for several queries. The first pass lists their points, and which queries see each. The second pass counts, for each
  /// keyframe that sees such a point, the points that it shares with each query.
  void count_rows(const Map& map, const keyframe* queries, std::size_t count) {
    if constexpr (!indexed) observer_numbers_.clear();
    counted_.clear(), observers_.clear(), points_.clear(), seen_by_.clear(), rows_.clear();
    for (std::size_t q = 0; q < count; ++q)
      number_points_of(map, queries[q], 0, keypoint_count_of(map, queries[q]), counted_, scratch_,
                       [&](const auto& point, std::size_t number, bool is_new) {
                         if (is_new) points_.push_back(point), seen_by_.push_back(0U);
                         seen_by_[number] |= 1U << q;
                       });
    const std::uint64_t first = serial_ + 1;
    const auto at = [&](std::size_t i) -> const auto& { return points_[i]; };
    for_each_ahead<point_data::entry + point_data::views>(
        map, points_.size(), at, [&](std::size_t i, const auto& point) {
          if (!traits::alive(map, point)) return;
          const std::uint64_t serial = ++serial_;
          row add;
          for (std::size_t q = 0; q < row::size; ++q) add.shared[q] = static_cast<std::int32_t>(seen_by_[i] >> q & 1U);
          traits::for_each_observation(map, point, [&](keyframe k, std::size_t) {
            if (k == keyframe{}) return;
            const std::size_t number = place(map, k);
            if (number >= tallies_.size()) tallies_.resize(number + number / 2 + 16);
            tally& t = tallies_[number];
            if (t.last_point == serial) return;  // another camera of the same rig
            if (t.last_point < first) {
              t.shared = static_cast<int>(rows_.size());
              observers_.push_back(k), rows_.push_back(row{});
            }
            t.last_point = serial;
            row& sum = rows_[static_cast<std::size_t>(t.shared)];
            for (std::size_t q = 0; q < row::size; ++q) sum.shared[q] += add.shared[q];
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
  list_of<typename traits::point> points_, scratch_;  ///< points_ by number in counted_
  // Of several queries:
  plain_vector<std::uint32_t> seen_by_;  ///< of each point: bit q is of query q
  plain_vector<row> rows_;               ///< of each observer
};

TURBOMAP_END_NAMESPACE

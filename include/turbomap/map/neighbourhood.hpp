// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which keyframes local mapping works with: neighbours to search correspondences in, targets to look for duplicates in
/// [ORB-SLAM3].

#include <cstddef>

#include "../config.hpp"
#include "../error.hpp"
#include "../plain_vector.hpp"
#include "covisibility.hpp"
#include "map_traits.hpp"
#include "neighbourhood_options.hpp"
#include "numbering.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Throws std::invalid_argument naming the option that is out of range.
inline void check(const neighbourhood_options& o) {
  require(o.min_shared_points >= 0, "options.min_shared_points", o.min_shared_points, "must not be negative");
  require(o.neighbours >= 0, "options.neighbours", o.neighbours, "must not be negative");
  require(o.temporal_neighbours >= 0, "options.temporal_neighbours", o.temporal_neighbours, "must not be negative");
  require(o.second_neighbours >= 0, "options.second_neighbours", o.second_neighbours, "must not be negative");
  require(o.temporal_targets >= 0, "options.temporal_targets", o.temporal_targets, "must not be negative");
}

/// Chooses keyframes around one; make one and use it again: its memory is reused. The caller holds the guard.
///
/// `accept(keyframe)` says which keyframes may be chosen, e.g. those that are in a keyframe store. The others do not use up
/// the limits of the options.
/// Every call throws std::invalid_argument for a negative option.
template <class Map>
class neighbourhood {
 public:
  /// Of the map.
  using traits = map_traits<Map>;
  /// A name of a keyframe.
  using keyframe = typename traits::keyframe;

  /// The best covisible keyframes of `query`, most shared points first, then its predecessors in time (with previous() of the
  /// traits) while there are too few.
  template <class Accept = every_keyframe>
  const list_of<keyframe>& neighbours(const Map& map, keyframe query, const neighbourhood_options& options,
                                      Accept accept = {}) {
    check(options);
    choose_neighbours(map, query, options, accept);
    add_predecessors(map, query, options.temporal_neighbours, accept, neighbours_);
    return neighbours_;
  }

  /// The neighbours, each followed by its own best covisible keyframes, each keyframe once and never the query, then
  /// predecessors in time of the query.
  template <class Accept = every_keyframe>
  const list_of<keyframe>& targets(const Map& map, keyframe query, const neighbourhood_options& options,
                                   Accept accept = {}) {
    check(options);
    choose_neighbours(map, query, options, accept);
    seen_.clear(), targets_.clear();
    seen_.place(map, query);
    const auto add = [&](keyframe k) {
      const std::size_t known = seen_.size();
      if (seen_.place(map, k) == known) targets_.push_back(k);
    };
    for (const keyframe& n : neighbours_) add(n);
    if (options.second_neighbours > 0)
      covisibility_.of_each(map, neighbours_, options.min_shared_points,
                            static_cast<std::size_t>(options.second_neighbours), accept, [&](const auto& list) {
                              for (const auto& c : list) add(c.keyframe);
                            });
    add_predecessors(map, query, options.temporal_targets, accept, targets_);
    return targets_;
  }

  /// The covisible keyframes of `query`, all or so many, most shared points first.
  template <class Accept = every_keyframe>
  const list_of<keyframe>& covisible_keyframes(const Map& map, keyframe query, const neighbourhood_options& options,
                                               Accept accept = {}, std::size_t limit = no_limit) {
    check(options);
    targets_.clear();
    for (const auto& c : covisibility_(map, query, options.min_shared_points, limit, accept))
      targets_.push_back(c.keyframe);
    return targets_;
  }

 private:
  template <class Accept>
  void choose_neighbours(const Map& map, keyframe query, const neighbourhood_options& options, Accept accept) {
    neighbours_.clear();
    if (options.neighbours == 0) return;
    for (const auto& c :
         covisibility_(map, query, options.min_shared_points, static_cast<std::size_t>(options.neighbours), accept))
      neighbours_.push_back(c.keyframe);
  }

  template <class Accept>
  [[gnu::noinline]] void add_predecessors([[maybe_unused]] const Map& map, [[maybe_unused]] keyframe query,
                                          [[maybe_unused]] int wanted, [[maybe_unused]] Accept accept,
                                          [[maybe_unused]] list_of<keyframe>& list) {
    if constexpr (detail::map_has_v<Map, detail::map_temporal_member>) {
      if (wanted <= 0) return;
      seen_.clear();
      seen_.place(map, query);
      for (const keyframe& k : list) seen_.place(map, k);
      keyframe slow = query;  // half as fast: in a circle, which no edit makes, the other one meets it
      bool advance = false;
      for (keyframe k = traits::previous(map, query);
           !(k == keyframe{}) && !(k == slow) && list.size() < static_cast<std::size_t>(wanted);
           k = traits::previous(map, k), advance = !advance) {
        const std::size_t known = seen_.size();
        if (seen_.place(map, k) == known && accept(k)) list.push_back(k);
        if (advance) slow = traits::previous(map, slow);
      }
    }
  }

  covisibility<Map> covisibility_;
  keyframe_numbering<Map> seen_;
  list_of<keyframe> neighbours_, targets_;
};

TURBOMAP_END_NAMESPACE

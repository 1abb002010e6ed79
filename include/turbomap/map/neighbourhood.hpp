// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which keyframes local mapping works with: neighbours to search correspondences in, targets to look for duplicates in
/// [ORB-SLAM3].

#include <cstddef>
#include <vector>

#include "../config.hpp"
#include "covisibility.hpp"
#include "map_traits.hpp"
#include "numbering.hpp"

namespace turbomap {

/// Options of the neighbourhood. Defaults are those of [ORB-SLAM3].
struct neighbourhood_options {
  int min_shared_points = 15;   ///< keyframes that share fewer are not covisible, unless no other is
  int neighbours = 10;          ///< best covisible keyframes; 30 without stereo depth
  int temporal_neighbours = 0;  ///< predecessors in time are added while there are fewer; 11 for inertial systems
  int second_neighbours = 20;   ///< duplicates are also looked for in so many covisible keyframes of each neighbour
  int temporal_targets = 0;     ///< predecessors in time are added while there are fewer targets; 20 inertial
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Chooses keyframes around one; make one and use it again: its memory is reused. The caller holds the guard.
template <class Map>
class neighbourhood {
 public:
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;

  /// The best covisible keyframes of `query`, most shared points first, then its predecessors in time (with previous() of the
  /// traits) while there are too few.
  const std::vector<keyframe>& neighbours(const Map& map, keyframe query, const neighbourhood_options& options) {
    neighbours_.clear();
    for (const auto& c : covisibility_(map, query, options.min_shared_points, limit(options.neighbours)))
      neighbours_.push_back(c.keyframe);
    add_predecessors(map, query, options.temporal_neighbours, neighbours_);
    return neighbours_;
  }

  /// The neighbours, each followed by its own best covisible keyframes, each keyframe once and never the query, then
  /// predecessors in time of the query.
  const std::vector<keyframe>& targets(const Map& map, keyframe query, const neighbourhood_options& options) {
    neighbourhood_options plain = options;
    plain.temporal_neighbours = 0;
    neighbours(map, query, plain);
    seen_.clear(), targets_.clear();
    seen_.place(map, query);
    const auto add = [&](keyframe k) {
      const std::size_t known = seen_.size();
      if (seen_.place(map, k) == known) targets_.push_back(k);
    };
    for (const keyframe n : neighbours_) add(n);
    for (const keyframe n : neighbours_)
      for (const auto& c : covisibility_(map, n, options.min_shared_points, limit(options.second_neighbours)))
        add(c.keyframe);
    add_predecessors(map, query, options.temporal_targets, targets_);
    return targets_;
  }

  /// All covisible keyframes of `query`, most shared points first.
  const std::vector<keyframe>& covisible_keyframes(const Map& map, keyframe query,
                                                   const neighbourhood_options& options) {
    targets_.clear();
    for (const auto& c : covisibility_(map, query, options.min_shared_points)) targets_.push_back(c.keyframe);
    return targets_;
  }

 private:
  static std::size_t limit(int n) { return n > 0 ? static_cast<std::size_t>(n) : static_cast<std::size_t>(-1); }

  void add_predecessors([[maybe_unused]] const Map& map, [[maybe_unused]] keyframe query, [[maybe_unused]] int wanted,
                        [[maybe_unused]] std::vector<keyframe>& list) {
    if constexpr (detail::map_has_v<Map, detail::map_temporal_member>) {
      if (wanted <= 0) return;
      seen_.clear();
      seen_.place(map, query);
      for (const keyframe k : list) seen_.place(map, k);
      for (keyframe k = traits::previous(map, query);
           !(k == keyframe{}) && list.size() < static_cast<std::size_t>(wanted); k = traits::previous(map, k)) {
        const std::size_t known = seen_.size();
        if (seen_.place(map, k) == known) list.push_back(k);
      }
    }
  }

  covisibility<Map> covisibility_;
  keyframe_numbering<Map> seen_;
  std::vector<keyframe> neighbours_, targets_;
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What all stages of local mapping share. A stage brings one map-free algorithm to the user's map, always in three steps:
///
///     snapshot   copies what the algorithm reads from the map, under the map's guard
///     compute    runs the algorithm on the copies and on resident keyframes, without the guard
///     commit     applies the result to the map as it is by then, under the guard; every entry is looked at again
///
/// A stage is a class with these three members and an operator() that calls them. It keeps its memory: make one, use it for
/// every keyframe.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../map/map_fault.hpp"
#include "../map/map_traits.hpp"
#include "../math/rotation.hpp"
#include "../store/keyframe_store.hpp"
#include "guard_times.hpp"
#include "handle_table.hpp"
#include "look_again.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Holds map_guard(map) while it lives, and notes for how long. Waiting for the guard does not count. A mirror hears at once that the
/// whole map was moved: a stage reads some things from the map and others from its mirror.
template <class Map>
class timed_guard {
 public:
  /// Waits for the guard. \param commits  held to apply what creation or fusion found
  timed_guard(Map& map, guard_times& times, bool commits = false)
      : guard_(map_guard(map)), times_(times), commits_(commits), begin_(clock::now()) {
    hear_refresh(map);
  }
  timed_guard(const timed_guard&) = delete;
  timed_guard& operator=(const timed_guard&) = delete;
  ~timed_guard() { times_.add(std::chrono::duration<double, std::milli>(clock::now() - begin_).count(), commits_); }

 private:
  using clock = std::chrono::steady_clock;
  decltype(map_guard(std::declval<Map&>())) guard_;
  guard_times& times_;
  bool commits_;
  clock::time_point begin_;
};

/// The store that a stage on this map reads under this policy.
template <class Map, class Policy>
using store_of =
    keyframe_store<typename map_traits<Map>::descriptor, typename map_traits<Map>::camera, memory_of_t<Policy>>;

/// What a stage works on. Cheap to make and to copy: it only refers.
template <class Map, class Policy>
struct mapping_scope {
  context<Policy>& ctx;          ///< policy, stream and scratch memory
  Map& map;                      ///< the user's
  store_of<Map, Policy>& store;  ///< resident keyframes
  const handle_table& stored;    ///< which keyframes of the map are in the store, by id
  guard_times& held;             ///< where the stage's guard times go
  /// What becomes of parts of the map that cannot be used. Default: the first one ends the stage.
  fault_sink faults = {};
  /// local_mapper_options::points_read_per_guard.
  int points_read_per_guard = default_points_read_per_guard;

  /// Holds the map's guard while it lives, and notes for how long.
  timed_guard<Map> guard() const { return timed_guard<Map>(map, held); }
  /// The same, to apply what creation or fusion found.
  timed_guard<Map> commit_guard() const { return timed_guard<Map>(map, held, true); }

  /// Works on the map in parts, each under the guard, so that others may enter in between.
  /// \param begin   begin() comes before the first part: what has to be read at once
  /// \param resume  resume() comes before each other part: reads anew what the parts before rely on
  /// \param part    part(most) works on so many items at most; false: it was the last one
  template <class Begin, class Resume, class Part>
  void in_parts(Begin begin, Resume resume, Part part) const {
    require(points_read_per_guard >= 0, "points_read_per_guard", points_read_per_guard, "must not be negative");
    const std::size_t most =
        points_read_per_guard == 0 ? static_cast<std::size_t>(-1) : static_cast<std::size_t>(points_read_per_guard);
    for (bool first = true, more = true; more; first = false) {
      const auto held_now = guard();
      if (first)
        begin();
      else
        resume();
      more = part(most);
    }
  }

  /// Whether a keyframe can be searched: it is alive, in the store, and has a pose. The caller holds the guard.
  bool can_use(typename map_traits<Map>::keyframe k) const {
    using traits = map_traits<Map>;
    if (k == typename traits::keyframe{} || !traits::alive(map, k)) return false;
    const std::uint64_t id = traits::id(map, k);
    if (!stored.contains(id)) return false;
    if (is_pose(pose_of(map, k))) return true;
    faults({map_fault::bad_pose, id, 0, 0});
    return false;
  }
};
/// From its members.
template <class Map, class Policy, class Store>
mapping_scope(context<Policy>&, Map&, Store&, const handle_table&, guard_times&) -> mapping_scope<Map, Policy>;

TURBOMAP_END_NAMESPACE

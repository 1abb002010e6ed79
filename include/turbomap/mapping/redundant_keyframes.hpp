// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which keyframes the map can do without: those whose points enough others see, at an octave that is fine enough [TurboMap §IV-F],
/// [ORB-SLAM3]. They are looked at one after the other, since each that is taken out changes the counts of the next.

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "../config.hpp"
#include "../culling/redundancy.hpp"
#include "../error.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/observation_counts.hpp"
#include "../map/validate.hpp"
#include "../span.hpp"
#include "look_again.hpp"
#include "redundancy_counter.hpp"
#include "temporal_guards.hpp"

namespace turbomap {

/// What was counted, and decided.
enum class culling_verdict : std::uint8_t {
  needed,     ///< not redundant
  erased,     ///< redundant, and taken out
  protected_  ///< not to be erased (may_erase), or dead already: not counted
};

/// One keyframe that was looked at; `id` outlives the keyframe.
template <class Keyframe>
struct culling_record {
  Keyframe keyframe;        ///< its name in the map
  std::uint64_t id;         ///< its id
  redundancy count;         ///< its counted observations
  culling_verdict verdict;  ///< what became of it
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// As a hook: does nothing.
struct ignore_keyframe {
  /// Does nothing.
  template <class Keyframe>
  void operator()(const Keyframe&) const {}
};

namespace detail {

/// Whether others keep a keyframe, or it is gone already.
template <class Map>
bool is_protected(const Map& map, const typename map_traits<Map>::keyframe& keyframe,
                  const typename map_traits<Map>::keyframe& current) {
  using traits = map_traits<Map>;
  if (!traits::alive(map, keyframe) || keyframe == current) return true;
  if constexpr (map_has_v<Map, map_may_erase_member>) return !traits::may_erase(map, keyframe);
  return false;
}
template <class Map>
void check_culling(const keyframe_culling_options& options) {
  static_assert(require_map_traits<Map>());
  check(options);
  require(!options.temporal_guards || map_has_v<Map, map_temporal_member>, "options.temporal_guards",
          options.temporal_guards, "needs map_traits with time, previous and next");
}

}  // namespace detail

/// Looks at one keyframe as cull_keyframes() does, and changes nothing: the verdict `erased` says that it is to be.
/// \param state  of the current keyframe, where options.temporal_guards asks
template <class Map>
culling_record<typename map_traits<Map>::keyframe> judge_keyframe(const Map& map,
                                                                  const typename map_traits<Map>::keyframe& current,
                                                                  const typename map_traits<Map>::keyframe& keyframe,
                                                                  const keyframe_culling_options& options,
                                                                  const temporal_state<Map>& state, fault_sink faults,
                                                                  redundancy_counter<Map>& counter) {
  using traits = map_traits<Map>;
  look_again(map, keyframe);
  if (detail::is_protected(map, keyframe, current))
    return {keyframe, traits::alive(map, keyframe) ? traits::id(map, keyframe) : 0, {}, culling_verdict::protected_};
  const std::uint64_t id = traits::id(map, keyframe);
  // Counting without kept counts looks at the views.
  if constexpr (!counts_octaves_v<Map>)
    if (!require_consistent_keyframe(map, keyframe, faults)) return {keyframe, id, {}, culling_verdict::protected_};
  redundancy count = counter(map, keyframe, options);
  bool erase = is_redundant(count, options);
  const auto look_up_again = [&] {
    counter.forget(map, keyframe);
    count = counter(map, keyframe, options);
    erase = erase && is_redundant(count, options);
  };
  if (redundancy_counter<Map>::keeps && erase) look_up_again();
  erase = erase && !detail::is_kept_by_time(map, keyframe, state, options);
  if (is_copy_v<Map> && erase && look_at_all(map, keyframe, options.fewest_measurements)) {
    look_up_again();
    erase = erase && traits::alive(map, keyframe);
  }
  if constexpr (counts_octaves_v<Map>)
    erase = erase && require_removable(map, keyframe, options.fewest_measurements, faults);
  if (erase) counter.forget(map, keyframe);
  return {keyframe, id, count, erase ? culling_verdict::erased : culling_verdict::needed};
}

/// Looks at each candidate in the given order (covisibility, most shared points first) and takes out those that are
/// redundant, at once: the next ones are counted without them. A keyframe is checked before it is changed: slots and
/// observations that contradict each other are refused (inconsistent_map) with the keyframe, and all after it, as they were.
/// The caller holds the guard of the map, or holds it for one candidate at a time by calling with one. keyframe_culling also lets
/// others have it while a large keyframe is taken out.
///
/// Inertial systems: bridge_motion() in `erasing`, or erase_keyframe() of the traits, merges the preintegration of the removed
/// keyframe into its successor's.
/// \param current     the keyframe that local mapping works on: the guards look back from it
/// \param candidates  keyframes; dead ones and those that may_erase() protects are passed over
/// \param records     one entry per candidate, appended
/// \param touched     null, or a pointer to a list: points that lost a view and live on are appended
/// \param erasing     erasing(keyframe): called before a keyframe is taken out
/// \param faults      where to note contradictions instead; the keyframe then stays and the next is looked at
/// \param counter     what it knows from before is trusted where it keeps a keyframe, and looked up again before one is erased
/// \throws std::invalid_argument  an option out of range
/// O(keypoints of the candidates + views of removed ones).
template <class Map, class Records, class Touched, class Erasing>
void cull_keyframes(Map& map, typename map_traits<Map>::keyframe current,
                    span<const typename map_traits<Map>::keyframe> candidates, const keyframe_culling_options& options,
                    Records& records, Touched touched, const Erasing& erasing, fault_sink faults,
                    redundancy_counter<Map>& counter) {
  detail::check_culling<Map>(options);
  records.reserve(records.size() + candidates.size());
  temporal_state<Map> state = detail::time_of(map, current, options);
  for (const auto& keyframe : candidates) {
    records.push_back(judge_keyframe(map, current, keyframe, options, state, faults, counter));
    if (records.back().verdict != culling_verdict::erased) continue;
    if constexpr (!std::is_null_pointer_v<Touched>)
      if (touched != nullptr) touched->reserve(touched->size() + keypoint_count_of(map, keyframe));
    erasing(keyframe);
    erase_keyframe(map, keyframe, options.fewest_measurements, touched);
    state = detail::time_of(map, current, options);
  }
}

/// The same with a counter of its own, which knows nothing from before.
template <class Map, class Records, class Touched = std::nullptr_t, class Erasing = ignore_keyframe>
void cull_keyframes(Map& map, typename map_traits<Map>::keyframe current,
                    span<const typename map_traits<Map>::keyframe> candidates, const keyframe_culling_options& options,
                    Records& records, Touched touched = nullptr, const Erasing& erasing = {}, fault_sink faults = {}) {
  redundancy_counter<Map> counter;
  cull_keyframes(map, current, candidates, options, records, touched, erasing, faults, counter);
}

TURBOMAP_END_NAMESPACE

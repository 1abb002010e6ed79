// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that takes redundant keyframes out of the map: found by the counts of observations per octave, one after the
/// other, each removal taking effect on the next count [TurboMap §IV-F], [ORB-SLAM3].

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "../config.hpp"
#include "../culling/redundancy.hpp"
#include "../error.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/neighbourhood.hpp"
#include "../map/observation_counts.hpp"
#include "../map/validate.hpp"
#include "../math/strict.hpp"
#include "../span.hpp"
#include "look_again.hpp"
#include "redundancy_counter.hpp"
#include "stage.hpp"

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

/// Where the current keyframe stands in time: what the guards of inertial systems ask for.
template <class Map>
struct temporal_state {
  using keyframe = typename map_traits<Map>::keyframe;  ///< names a keyframe
  std::size_t keyframes = 0;                            ///< in the map; more than needed may be left uncounted
  std::uint64_t first_kept = 0;                         ///< id of the earliest keyframe of the last ones, which stay
  std::uint64_t old_before = 0;                         ///< ids below are older than the keep_keyframes-th predecessor

  /// Follows previous() from the current keyframe, no farther than needed.
  static temporal_state of(const Map& map, keyframe current, const keyframe_culling_options& options) {
    using traits = map_traits<Map>;
    temporal_state state;
    const keyframe none{};
    state.first_kept = traits::id(map, current);
    for (keyframe k = current; !(k == none); k = traits::previous(map, k)) {
      if (state.keyframes <= static_cast<std::size_t>(options.keep_last)) state.first_kept = traits::id(map, k);
      if (state.keyframes <= static_cast<std::size_t>(options.keep_keyframes)) state.old_before = traits::id(map, k);
      if (++state.keyframes > static_cast<std::size_t>(options.keep_keyframes) + 1 &&
          state.keyframes > static_cast<std::size_t>(options.keep_last) + 1)
        break;
    }
    return state;
  }
};

/// Whether a removal would leave a gap in time that the inertial measurements do not bridge.
template <class Map>
bool leaves_gap(const Map& map, typename map_traits<Map>::keyframe keyframe, const temporal_state<Map>& state,
                const keyframe_culling_options& options) {
  using traits = map_traits<Map>;
  if (state.keyframes <= static_cast<std::size_t>(options.keep_keyframes)) return true;
  const std::uint64_t id = traits::id(map, keyframe);
  if (id >= state.first_kept) return true;
  const auto before = traits::previous(map, keyframe), after = traits::next(map, keyframe);
  const typename traits::keyframe none{};
  if (before == none || after == none) return true;
  // Rounded first: a time that the traits compute by a product must not be fused with the difference, or gaps of exactly the
  // limit would be decided by the compiler's flags.
  const double end = detail::rounded(static_cast<double>(traits::time(map, after)));
  const double begin = detail::rounded(static_cast<double>(traits::time(map, before)));
  const decision gap = decision(end) - decision(begin);
  const bool old = options.inertial_initialised && id < state.old_before;
  return !(gap < decision(options.max_gap) || (old && gap < decision(options.max_old_gap)));
}

/// As a hook: does nothing.
struct ignore_keyframe {
  /// Does nothing.
  template <class Keyframe>
  void operator()(const Keyframe&) const {}
};

/// Looks at each candidate in the given order (covisibility, most shared points first) and takes out those that are
/// redundant, at once: the next ones are counted without them. A keyframe is checked before it is changed: slots and
/// observations that contradict each other are refused (inconsistent_map) with the keyframe, and all after it, as they were.
/// The caller holds the guard of the map, or holds it for one candidate at a time by calling with one.
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
  using traits = map_traits<Map>;
  static_assert(require_map_traits<Map>());
  check(options);
  records.reserve(records.size() + candidates.size());
  constexpr bool has_time = detail::map_has_v<Map, detail::map_temporal_member>;
  require(!options.temporal_guards || has_time, "options.temporal_guards", options.temporal_guards,
          "needs map_traits with time, previous and next");
  [[maybe_unused]] temporal_state<Map> state;
  if constexpr (has_time)
    if (options.temporal_guards) state = temporal_state<Map>::of(map, current, options);
  for (const auto& keyframe : candidates) {
    look_again(map, keyframe);
    bool protect = !traits::alive(map, keyframe) || keyframe == current;
    if constexpr (detail::map_has_v<Map, detail::map_may_erase_member>)
      protect = protect || !traits::may_erase(map, keyframe);
    if (protect) {
      records.push_back(
          {keyframe, traits::alive(map, keyframe) ? traits::id(map, keyframe) : 0, {}, culling_verdict::protected_});
      continue;
    }
    const std::uint64_t id = traits::id(map, keyframe);
    // Counting without kept counts looks at the views.
    bool sound = true;
    if constexpr (!counts_octaves_v<Map>) sound = require_consistent_keyframe(map, keyframe, faults);
    if (!sound) {
      records.push_back({keyframe, id, {}, culling_verdict::protected_});
      continue;
    }
    redundancy count = counter(map, keyframe, options);
    bool erase = is_redundant(count, options);
    const auto look_up_again = [&] {
      counter.forget(map, keyframe);
      count = counter(map, keyframe, options);
      erase = erase && is_redundant(count, options);
    };
    if (redundancy_counter<Map>::keeps && erase) look_up_again();
    if constexpr (has_time)
      if (erase && options.temporal_guards) erase = !leaves_gap(map, keyframe, state, options);
    if (is_copy_v<Map> && erase && look_at_all(map, keyframe, options.fewest_measurements)) {
      look_up_again();
      erase = erase && traits::alive(map, keyframe);
    }
    if constexpr (counts_octaves_v<Map>)
      erase = erase && require_removable(map, keyframe, options.fewest_measurements, faults);
    if (erase) {
      if constexpr (!std::is_null_pointer_v<Touched>)
        if (touched != nullptr) touched->reserve(touched->size() + keypoint_count_of(map, keyframe));
      counter.forget(map, keyframe);
      erasing(keyframe);
      erase_keyframe(map, keyframe, options.fewest_measurements, touched);
      if constexpr (has_time)
        if (options.temporal_guards) state = temporal_state<Map>::of(map, current, options);
    }
    records.push_back({keyframe, id, count, erase ? culling_verdict::erased : culling_verdict::needed});
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

/// The stage: keyframes that share points with the current one are looked at, those that share most first. It counts and
/// decides under the guard, one keyframe per hold, because each removal changes the counts of the next: its snapshot is the
/// list of candidates, and compute() a short sum inside commit().
template <class Map, class Policy>
class keyframe_culling {
 public:
  /// @{
  /// Types of the map, as its traits name them; `scope` is what a stage is called with.
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using scope = mapping_scope<Map, Policy>;
  /// @}

  /// Chooses the candidates: covisible keyframes that are in the store.
  /// \param most  no more than so many, those that share most; 0: all
  const list_of<keyframe>& snapshot(const scope& s, keyframe current, const neighbourhood_options& options,
                                    int most = 0) {
    const auto guard = s.guard();
    touched_.clear(), counter_.clear();
    const auto in_store = [&](keyframe k) {
      return traits::alive(s.map, k) && s.stored.contains(traits::id(s.map, k));
    };
    return candidates_ = neighbourhood_.covisible_keyframes(s.map, current, options, in_store,
                                                            most > 0 ? static_cast<std::size_t>(most) : no_limit);
  }
  /// Takes one candidate out if it is redundant. \param erased  erased(id): its id is free, called under the guard
  template <class Erasing, class Erased>
  void commit(const scope& s, keyframe current, keyframe candidate, const keyframe_culling_options& options,
              const Erasing& erasing, const Erased& erased) {
    const auto guard = s.guard();
    if (!traits::alive(s.map, candidate)) return;
    records_.clear();
    counter_.remember_by(&s.stored);
    cull_keyframes(s.map, current, span<const keyframe>(&candidate, 1), options, records_, &touched_, erasing, s.faults,
                   counter_);
    for (const auto& record : records_)
      if (record.verdict == culling_verdict::erased) {
        counter_.drop_keypoints(record.id);
        erased(record.id);
      }
  }
  /// Points that lost a view since snapshot() and live on: their appearance is due.
  const list_of<point>& touched() const { return touched_; }

 private:
  neighbourhood<Map> neighbourhood_;
  list_of<keyframe> candidates_;
  list_of<culling_record<keyframe>> records_;
  list_of<point> touched_;
  redundancy_counter<Map> counter_;
};

TURBOMAP_END_NAMESPACE

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
#include "erasure_in_parts.hpp"
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
/// Whether time keeps a keyframe, where the options ask. \param state  of now
template <class Map>
bool is_kept_by_time([[maybe_unused]] const Map& map,
                     [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe,
                     [[maybe_unused]] const temporal_state<Map>& state,
                     [[maybe_unused]] const keyframe_culling_options& options) {
  if constexpr (map_has_v<Map, map_temporal_member>)
    return options.temporal_guards && leaves_gap(map, keyframe, state, options);
  else
    return false;
}
/// Where the current keyframe stands in time, if the options ask.
template <class Map>
temporal_state<Map> time_of([[maybe_unused]] const Map& map,
                            [[maybe_unused]] const typename map_traits<Map>::keyframe& current,
                            const keyframe_culling_options& options) {
  if constexpr (map_has_v<Map, map_temporal_member>)
    if (options.temporal_guards) return temporal_state<Map>::of(map, current, options);
  return {};
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

/// The stage: keyframes that share points with the current one are looked at, those that share most first. It counts and
/// decides under the guard, one keyframe per hold, because each removal changes the counts of the next: its snapshot is the
/// list of candidates, and compute() a short sum inside commit(). A keyframe of many points is decided on in one hold, and taken out
/// in others.
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

  /// Chooses the candidates: covisible keyframes that are in the store, behind one that an exception left half taken out.
  /// \param most  no more than so many, those that share most; 0: all
  const list_of<keyframe>& snapshot(const scope& s, keyframe current, const neighbourhood_options& options,
                                    int most = 0) {
    const auto guard = s.guard();
    touched_.clear(), counter_.clear();
    const auto in_store = [&](keyframe k) {
      return traits::alive(s.map, k) && s.stored.contains(traits::id(s.map, k));
    };
    candidates_ = neighbourhood_.covisible_keyframes(s.map, current, options, in_store,
                                                     most > 0 ? static_cast<std::size_t>(most) : no_limit);
    if (!parts_.active()) return candidates_;
    look_again(s.map, parts_.of());
    if (!s.stored.contains(parts_.id()) || !traits::alive(s.map, parts_.of()))
      parts_.end();
    else if (!(parts_.of() == current))
      put_first(parts_.of());
    return candidates_;
  }
  /// Takes one candidate out if it is redundant: in the hold in which that is found, or, if it sees more points than a quarter of
  /// points_read_per_guard, in further ones, so many points in each. It is alive in between, sees fewer points, and others may do
  /// to it what they like. It stays, with the points that it sees yet, once somebody keeps it (may_erase, or its neighbours in time),
  /// erases it, or made it contradict itself. Whether it is redundant is not asked again: fewer points would say something else.
  /// After another exception it is the first candidate of the next snapshot(), and goes on.
  ///
  /// All of these are called under the guard:
  /// \param erasing  erasing(keyframe): it is redundant, and sees all its points yet (again, and fewer: after an exception)
  /// \param leaving  leaving(keyframe): it sees none any more, and is erased now
  /// \param erased   erased(id): its id is free
  template <class Erasing, class Leaving, class Erased>
  void commit(const scope& s, keyframe current, keyframe candidate, const keyframe_culling_options& options,
              const Erasing& erasing, const Leaving& leaving, const Erased& erased) {
    detail::check_culling<Map>(options);
    const bool again = parts_.is_of(candidate);
    std::uint64_t id = parts_.id();
    bool goes = false;
    s.in_parts(
        [&] {
          goes = again ? !is_kept(s, current, candidate, options) : is_to_go(s, current, candidate, options, id);
          if (!goes) return;
          touched_.reserve(touched_.size() + keypoint_count_of(s.map, candidate));
          erasing(candidate);
        },
        [&] { goes = !is_kept(s, current, candidate, options); },
        [&](std::size_t most) {
          const bool begun = parts_.is_of(candidate);
          if (!goes) {
            if (begun) parts_.end();
            return false;
          }
          const std::size_t points = (most - 1) / 4 + 1;  // to take one away is as long as to read four
          if (!begun) parts_.begin(candidate, id);
          if (begun) {
            const erasure_part part = parts_(s.map, points, options.fewest_measurements, touched_, s.faults);
            if (part != erasure_part::last) return part == erasure_part::some;
          } else if (sees_more_points(s.map, candidate, points)) {
            return true;
          } else {
            fade_keypoints(s.map, candidate, 0, keypoint_count_of(s.map, candidate), options.fewest_measurements,
                           &touched_);
          }
          leaving(candidate);
          traits::erase_keyframe(s.map, candidate);
          parts_.end();
          counter_.drop_keypoints(id);
          erased(id);
          return false;
        });
  }
  /// Nothing is known of the map any more: it starts anew.
  void clear() {
    parts_.end();
    candidates_.clear(), touched_.clear();
  }
  /// Points that lost a view since snapshot(): the appearance of those that live on is due, also where commit() threw. Some are
  /// named twice.
  const list_of<point>& touched() const { return touched_; }

 private:
  /// Whether a candidate is redundant, and nobody keeps it. \param id  is set to its id
  bool is_to_go(const scope& s, const keyframe& current, const keyframe& candidate,
                const keyframe_culling_options& options, std::uint64_t& id) {
    if (!traits::alive(s.map, candidate) || !has_time(s, current, options)) return false;
    counter_.remember_by(&s.stored);
    const auto record = judge_keyframe(s.map, current, candidate, options, detail::time_of(s.map, current, options),
                                       s.faults, counter_);
    id = record.id;
    return record.verdict == culling_verdict::erased;
  }
  /// Whether one that was to go stays after all.
  static bool is_kept(const scope& s, const keyframe& current, const keyframe& candidate,
                      const keyframe_culling_options& options) {
    look_again(s.map, candidate);
    return detail::is_protected(s.map, candidate, current) || !has_time(s, current, options) ||
           detail::is_kept_by_time(s.map, candidate, detail::time_of(s.map, current, options), options);
  }
  /// Where guards in time look back from a keyframe, it is there.
  static bool has_time(const scope& s, const keyframe& current, const keyframe_culling_options& options) {
    if (!options.temporal_guards) return true;
    look_again(s.map, current);
    return traits::alive(s.map, current);
  }
  void put_first(const keyframe& k) {
    std::size_t at = 0;
    while (at < candidates_.size() && !(candidates_[at] == k)) ++at;
    if (at == candidates_.size()) candidates_.push_back(k);
    for (; at > 0; --at) candidates_[at] = candidates_[at - 1];
    candidates_[0] = k;
  }
  static bool sees_more_points(const Map& map, const keyframe& k, std::size_t points) {
    std::size_t seen = 0;
    for (std::size_t i = 0; i < keypoint_count_of(map, k); ++i)
      seen += traits::point_at(map, k, i) == point{} ? std::size_t{0} : std::size_t{1};
    return seen > points;
  }

  neighbourhood<Map> neighbourhood_;
  list_of<keyframe> candidates_;
  erasure_in_parts<Map> parts_;
  list_of<point> touched_;
  redundancy_counter<Map> counter_;
};

TURBOMAP_END_NAMESPACE

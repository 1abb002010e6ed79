// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Redundant keyframes: found by the counts of observations per octave, and taken out one after the other, each removal
/// taking effect on the next count [TurboMap §IV-F], [ORB-SLAM3].

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/observation_counts.hpp"
#include "../map/validate.hpp"
#include "../math/strict.hpp"
#include "../span.hpp"

namespace turbomap {

/// Options of keyframe culling. Defaults are those of [ORB-SLAM3] for stereo without an inertial unit.
struct keyframe_culling_options {
  float redundant_share =
      0.9F;              ///< redundant: more than this share of its points (0.5 stereo-inertial); product in float
  int observers = 3;     ///< a point is redundant when more than so many other keyframes see it...
  int octave_slack = 1;  ///< ...at an octave no coarser than its own plus this
  float max_depth = 0;   ///< m, > 0 (stereo): only points with a depth in [0, max_depth] count; 0: all (monocular)
  int fewest_measurements = 2;   ///< a point dies when a removal leaves it so many measurements or fewer
  bool temporal_guards = false;  ///< inertial: the rules below; the map's traits have time(), previous() and next()
  int keep_keyframes = 21;       ///< none is taken while there are so many or fewer
  int keep_last = 2;             ///< the current keyframe and so many before it, by their place in time, stay
  double max_gap = 0.5;          ///< s between the neighbours in time that a removal leaves side by side
  double max_old_gap = 3;  ///< s, the same for keyframes before the keep_keyframes-th predecessor, once initialised
  bool inertial_initialised = true;
};

/// What was counted, and decided.
enum class culling_verdict : std::uint8_t {
  needed,     ///< not redundant
  erased,     ///< redundant, and taken out
  protected_  ///< not to be erased (may_erase), or dead already: not counted
};

/// The points of a keyframe, and those of them that others see as well.
struct redundancy {
  int points = 0;
  int redundant = 0;
};

/// One keyframe that was looked at; `id` outlives the keyframe.
template <class Keyframe>
struct culling_record {
  Keyframe keyframe;
  std::uint64_t id;
  redundancy count;
  culling_verdict verdict;
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Points of the keyframe that count, and how many of them are redundant. A short sum a point where the map keeps counts
/// (counts_octaves_v). `scratch` is reused memory. O(keypoints).
template <class Map>
redundancy count_redundant(const Map& map, typename map_traits<Map>::keyframe keyframe,
                           const keyframe_culling_options& options, std::vector<std::uint32_t>& scratch) {
  using traits = map_traits<Map>;
  redundancy count;
  const std::size_t keypoints = traits::keypoint_count(map, keyframe);
  // The keyframe itself is one of the observers, at the finest octave of its cameras, so never coarser than this view.
  const auto enough = static_cast<std::uint32_t>(options.observers) + 2;
  for (std::size_t i = 0; i < keypoints; ++i) {
    const auto point = traits::point_at(map, keyframe, i);
    if (point == typename traits::point{} || !traits::alive(map, point)) continue;
    const auto& k = traits::keypoint(map, keyframe, i);
    if (options.max_depth > 0 && !(k.depth >= 0 && k.depth <= options.max_depth)) continue;
    ++count.points;
    count.redundant += observers_up_to(map, point, k.octave + options.octave_slack, enough, scratch) >= enough ? 1 : 0;
  }
  return count;
}

/// redundant > share * points, the product in float: what the recorded peer computes.
inline bool is_redundant(const redundancy& count, const keyframe_culling_options& options) {
  const float limit = options.redundant_share * static_cast<float>(count.points);
  return static_cast<float>(count.redundant) > limit;
}

namespace detail {
inline void check(const keyframe_culling_options& o) {
  require(o.redundant_share >= 0 && o.redundant_share <= 1, "options.redundant_share", o.redundant_share,
          "must be in [0, 1]");
  require(o.observers >= 0, "options.observers", o.observers, "must not be negative");
  require(o.octave_slack >= 0 && o.octave_slack <= 255, "options.octave_slack", o.octave_slack,
          "must be in [0, 255]: octaves are bytes");
  require(o.max_depth >= 0, "options.max_depth", o.max_depth, "must not be negative");
  require(o.keep_keyframes >= 0, "options.keep_keyframes", o.keep_keyframes, "must not be negative");
  require(o.keep_last >= 0, "options.keep_last", o.keep_last, "must not be negative");
  require(o.max_gap >= 0, "options.max_gap", o.max_gap, "must not be negative");
  require(o.max_old_gap >= 0, "options.max_old_gap", o.max_old_gap, "must not be negative");
}
}  // namespace detail

/// Where the current keyframe stands in time: what the guards of inertial systems ask for.
template <class Map>
struct temporal_state {
  using keyframe = typename map_traits<Map>::keyframe;
  std::size_t keyframes = 0;     ///< in the map; more than needed may be left uncounted
  std::uint64_t first_kept = 0;  ///< id of the earliest keyframe of the last ones, which stay
  std::uint64_t old_before = 0;  ///< ids below are older than the keep_keyframes-th predecessor

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

/// Looks at each candidate in the given order (covisibility, most shared points first) and takes out those that are
/// redundant, at once: the next ones are counted without them. A keyframe is checked before it is changed: slots and
/// observations that contradict each other are refused (inconsistent_map) with the keyframe, and all after it, as they were.
/// The caller holds the guard of the map, or holds it for one candidate at a time by calling with one.
///
/// Inertial systems: traits' erase_keyframe() merges the preintegration of the removed keyframe into its successor's.
/// \param current     the keyframe that local mapping works on: the guards look back from it
/// \param candidates  keyframes; dead ones and those that may_erase() protects are passed over
/// \param records     one entry a candidate, appended
/// \param touched     points that lost a view and live on, appended when given
/// \param erasing     called before a keyframe is taken out, when given
/// \throws std::invalid_argument  an option out of range
/// O(keypoints of the candidates + views of removed ones).
template <class Map>
void cull_keyframes(Map& map, typename map_traits<Map>::keyframe current,
                    span<const typename map_traits<Map>::keyframe> candidates, const keyframe_culling_options& options,
                    std::vector<culling_record<typename map_traits<Map>::keyframe>>& records,
                    std::vector<typename map_traits<Map>::point>* touched = nullptr,
                    const std::function<void(typename map_traits<Map>::keyframe)>& erasing = {}) {
  using traits = map_traits<Map>;
  static_assert(require_map_traits<Map>());
  detail::check(options);
  records.reserve(records.size() + candidates.size());
  std::vector<std::uint32_t> scratch;
  constexpr bool has_time = detail::map_has_v<Map, detail::map_temporal_member>;
  require(!options.temporal_guards || has_time, "options.temporal_guards", options.temporal_guards,
          "needs map_traits with time, previous and next");
  [[maybe_unused]] temporal_state<Map> state;
  if constexpr (has_time)
    if (options.temporal_guards) state = temporal_state<Map>::of(map, current, options);
  for (const auto keyframe : candidates) {
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
    if constexpr (!counts_octaves_v<Map>) require_consistent_keyframe(map, keyframe);
    const redundancy count = count_redundant(map, keyframe, options, scratch);
    bool erase = is_redundant(count, options);
    if constexpr (has_time)
      if (erase && options.temporal_guards) erase = !leaves_gap(map, keyframe, state, options);
    if (erase) {
      if constexpr (counts_octaves_v<Map>) require_consistent_keyframe(map, keyframe);
      if (touched != nullptr) touched->reserve(touched->size() + traits::keypoint_count(map, keyframe));
      if (erasing) erasing(keyframe);
      erase_keyframe(map, keyframe, options.fewest_measurements, touched);
      if constexpr (has_time)
        if (options.temporal_guards) state = temporal_state<Map>::of(map, current, options);
    }
    records.push_back({keyframe, id, count, erase ? culling_verdict::erased : culling_verdict::needed});
  }
}

TURBOMAP_END_NAMESPACE

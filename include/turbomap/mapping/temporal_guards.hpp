// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Keyframes of a system with an IMU that time keeps in the map: too few would be left, it is one of the last, or the gap between the
/// keyframes before and after it would be longer than what the IMU measured can bridge.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../culling/redundancy.hpp"
#include "../map/map_traits.hpp"
#include "../math/strict.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Where the current keyframe stands in time: what the guards of inertial systems ask for.
template <class Map>
struct temporal_state {
  using keyframe = typename map_traits<Map>::keyframe;  ///< names a keyframe
  std::size_t keyframes = 0;                            ///< back to where its chain begins; not more than needed
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

namespace detail {

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

}  // namespace detail

TURBOMAP_END_NAMESPACE

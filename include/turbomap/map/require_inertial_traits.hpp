// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether a specialisation of inertial_traits is right, member by member, as require_map_traits.hpp does it for map_traits.
/// A part of inertial_traits.hpp.

#include "../config.hpp"
#include "../traits.hpp"
#include "inertial_members.hpp"
#include "map_members.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Explains in words what is wrong with inertial_traits<Map>: `static_assert(require_inertial_traits<Map>());`.
template <class Map>
constexpr bool require_inertial_traits() {
  constexpr bool specialised = !detail::inertial_has_v<Map, detail::not_specialised_member>;  // one thing at a time
  static_assert(specialised, "turbomap: specialise turbomap::inertial_traits for your map type; see docs/inertial.md");
  if constexpr (specialised) {
    static_assert(detail::inertial_fit<Map, detail::inertial_initialised>::value,
                  "turbomap: inertial_traits needs `static bool initialised(const Map&)`; see docs/inertial.md");
    static_assert(detail::inertial_fit<Map, detail::inertial_gravity>::value,
                  "turbomap: inertial_traits needs `static vec3<double> gravity(const Map&)`; see docs/inertial.md");
    static_assert(
        detail::inertial_fit<Map, detail::inertial_T_bc>::value,
        "turbomap: inertial_traits needs `static rigid_transform<double> T_bc(const Map&)`; see docs/inertial.md");
    static_assert(
        detail::inertial_fit<Map, detail::inertial_velocity>::value,
        "turbomap: inertial_traits needs `static vec3<double> velocity(const Map&, keyframe)`; see docs/inertial.md");
    static_assert(
        detail::inertial_fit<Map, detail::inertial_bias>::value,
        "turbomap: inertial_traits needs `static imu_bias<double> bias(const Map&, keyframe)`; see docs/inertial.md");
    static_assert(
        detail::inertial_fit<Map, detail::inertial_motion>::value,
        "turbomap: inertial_traits needs `static bool motion(const Map&, keyframe, preintegration<double>&)`; "
        "see docs/inertial.md");
    static_assert(
        detail::inertial_fit<Map, detail::inertial_set_velocity>::value,
        "turbomap: inertial_traits needs `static void set_velocity(Map&, keyframe, const vec3<double>&)`; see "
        "docs/inertial.md");
    static_assert(
        detail::inertial_fit<Map, detail::inertial_set_bias>::value,
        "turbomap: inertial_traits needs `static void set_bias(Map&, keyframe, const imu_bias<double>&)`; see "
        "docs/inertial.md");
    static_assert(detail::inertial_fit<Map, detail::inertial_set_motion>::value,
                  "turbomap: inertial_traits needs `static void set_motion(Map&, keyframe, const "
                  "preintegration<double>&)`; see docs/inertial.md");
    static_assert(detail::inertial_fit<Map, detail::inertial_clear_motion>::value,
                  "turbomap: inertial_traits needs `static void clear_motion(Map&, keyframe)`; see docs/inertial.md");
    static_assert(detail::inertial_usable_or_absent_v<Map, detail::inertial_refined_member, detail::named_refined>,
                  "turbomap: inertial_traits::refined must be `static bool refined(const Map&)`; see docs/inertial.md");
    static_assert(detail::inertial_usable_or_absent_v<Map, detail::inertial_join_member, detail::named_join_samples>,
                  "turbomap: inertial_traits::join_samples must be `static void join_samples(Map&, keyframe removed, "
                  "keyframe after)`; see docs/inertial.md");
    static_assert(detail::inertial_usable_or_absent_v<Map, detail::inertial_bias_member, detail::named_bias_changed>,
                  "turbomap: inertial_traits::bias_changed must be `static void bias_changed(Map&, keyframe, const "
                  "imu_bias<double>&)`; see docs/inertial.md");
    static_assert(detail::inertial_usable_or_absent_v<Map, detail::inertial_initialise_member,
                                                      detail::named_set_gravity, detail::named_set_initialised>,
                  "turbomap: inertial_traits needs both or neither of `static void set_gravity(Map&, const "
                  "vec3<double>&)` and `static void set_initialised(Map&, bool)`; see docs/inertial.md");
  }
  constexpr bool temporal = detail::map_has_v<Map, detail::map_temporal_member>;
  static_assert(temporal, "turbomap: a map with an IMU needs map_traits with time, previous and next; see docs/map.md");
  return true;  // an error has been said
}

TURBOMAP_END_NAMESPACE

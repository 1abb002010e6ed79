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

#define TURBOMAP_NEEDS(member, signature)                         \
  static_assert(detail::inertial_fit<Map, detail::member>::value, \
                "turbomap: inertial_traits needs `" signature "`; see docs/inertial.md")
/// Explains in words what is wrong with inertial_traits<Map>: `static_assert(require_inertial_traits<Map>());`.
template <class Map>
constexpr bool require_inertial_traits() {
  constexpr bool specialised = !detail::inertial_has_v<Map, detail::not_specialised_member>;  // one thing at a time
  static_assert(specialised, "turbomap: specialise turbomap::inertial_traits for your map type; see docs/inertial.md");
  if constexpr (specialised) {
    TURBOMAP_NEEDS(inertial_initialised, "static bool initialised(const Map&)");
    TURBOMAP_NEEDS(inertial_gravity, "static vec3<double> gravity(const Map&)");
    TURBOMAP_NEEDS(inertial_T_bc, "static rigid_transform<double> T_bc(const Map&)");
    TURBOMAP_NEEDS(inertial_velocity, "static vec3<double> velocity(const Map&, keyframe)");
    TURBOMAP_NEEDS(inertial_bias, "static imu_bias<double> bias(const Map&, keyframe)");
    TURBOMAP_NEEDS(inertial_motion, "static bool motion(const Map&, keyframe, preintegration<double>&)");
    TURBOMAP_NEEDS(inertial_set_velocity, "static void set_velocity(Map&, keyframe, const vec3<double>&)");
    TURBOMAP_NEEDS(inertial_set_bias, "static void set_bias(Map&, keyframe, const imu_bias<double>&)");
    TURBOMAP_NEEDS(inertial_set_motion, "static void set_motion(Map&, keyframe, const preintegration<double>&)");
    TURBOMAP_NEEDS(inertial_clear_motion, "static void clear_motion(Map&, keyframe)");
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

#undef TURBOMAP_NEEDS

TURBOMAP_END_NAMESPACE

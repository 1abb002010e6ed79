// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether a specialisation of inertial_traits is right, member by member, as require_map_traits.hpp does it for map_traits.
///
/// Included by inertial_traits.hpp.

#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../inertial/preintegration.hpp"
#include "../traits.hpp"
#include "../types.hpp"
#include "inertial_traits.hpp"
#include "map_traits.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class M>
using map_keyframe = typename map_traits<M>::keyframe;
template <class M>
map_keyframe<M> keyframe_of_map();
template <class S>
const S& a_const();

// M: the map, T: its inertial_traits.
template <class M, class T>
using inertial_initialised = fits<decltype(T::initialised(read_map<M>())), bool>;
template <class M, class T>
using inertial_gravity = fits<decltype(T::gravity(read_map<M>())), vec3<double>>;
template <class M, class T>
using inertial_T_bc = fits<decltype(T::T_bc(read_map<M>())), rigid_transform<double>>;
template <class M, class T>
using inertial_velocity = fits<decltype(T::velocity(read_map<M>(), keyframe_of_map<M>())), vec3<double>>;
template <class M, class T>
using inertial_bias = fits<decltype(T::bias(read_map<M>(), keyframe_of_map<M>())), imu_bias<double>>;
template <class M, class T>
using inertial_motion =
    fits<decltype(T::motion(read_map<M>(), keyframe_of_map<M>(), std::declval<preintegration<double>&>())), bool>;
template <class M, class T>
using inertial_set_velocity =
    fits<decltype(T::set_velocity(write_map<M>(), keyframe_of_map<M>(), a_const<vec3<double>>())), anything>;
template <class M, class T>
using inertial_set_bias =
    fits<decltype(T::set_bias(write_map<M>(), keyframe_of_map<M>(), a_const<imu_bias<double>>())), anything>;
template <class M, class T>
using inertial_set_motion =
    fits<decltype(T::set_motion(write_map<M>(), keyframe_of_map<M>(), a_const<preintegration<double>>())), anything>;
template <class M, class T>
using inertial_clear_motion = fits<decltype(T::clear_motion(write_map<M>(), keyframe_of_map<M>())), anything>;

template <class M, class T>
using inertial_refined_member = if_converts<decltype(T::refined(read_map<M>())), bool>;
template <class M, class T>
using inertial_join_member = decltype(T::join_samples(write_map<M>(), keyframe_of_map<M>(), keyframe_of_map<M>()));
template <class M, class T>
using inertial_bias_member =
    decltype(T::bias_changed(write_map<M>(), keyframe_of_map<M>(), a_const<imu_bias<double>>()));
template <class M, class T>
using inertial_initialise_member = std::void_t<decltype(T::set_gravity(write_map<M>(), a_const<vec3<double>>())),
                                               decltype(T::set_initialised(write_map<M>(), bool{}))>;

/// Every optional member: see has_name().
struct optional_inertial_names {
  int refined, join_samples, bias_changed, set_gravity, set_initialised;
};
template <class M, class T>
using named_refined = decltype(&T::refined);
template <class M, class T>
using named_join_samples = decltype(&T::join_samples);
template <class M, class T>
using named_bias_changed = decltype(&T::bias_changed);
template <class M, class T>
using named_set_gravity = decltype(&T::set_gravity);
template <class M, class T>
using named_set_initialised = decltype(&T::set_initialised);

template <class Map, template <class, class> class Member>
inline constexpr bool inertial_has_v = has_member<Member, Map, inertial_traits<Map>>::value;
template <class Map, template <class, class> class Member>
using inertial_fit = typename fit_of_member<Member, Map, inertial_traits<Map>>::type;
template <class Map, template <class, class> class Member, template <class, class> class... Names>
inline constexpr bool inertial_usable_or_absent_v =
    inertial_has_v<Map, Member> || !(has_name<Names, inertial_traits<Map>, optional_inertial_names>() || ...);

}  // namespace detail

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

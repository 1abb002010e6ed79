// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The members of inertial_traits as the library calls them, and which optional ones a map has: inertial_has_v. A part of
/// inertial_traits.hpp.

#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../inertial/preintegration.hpp"
#include "../traits.hpp"
#include "../types.hpp"
#include "map_members.hpp"
#include "map_traits.hpp"

namespace turbomap {

template <class Map>
struct inertial_traits;  // inertial_traits.hpp

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

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
using inertial_velocity = fits<decltype(T::velocity(read_map<M>(), a_keyframe<map_traits<M>>())), vec3<double>>;
template <class M, class T>
using inertial_bias = fits<decltype(T::bias(read_map<M>(), a_keyframe<map_traits<M>>())), imu_bias<double>>;
template <class M, class T>
using inertial_motion =
    fits<decltype(T::motion(read_map<M>(), a_keyframe<map_traits<M>>(), std::declval<preintegration<double>&>())),
         bool>;
template <class M, class T>
using inertial_set_velocity =
    fits<decltype(T::set_velocity(write_map<M>(), a_keyframe<map_traits<M>>(), a_const<vec3<double>>())), anything>;
template <class M, class T>
using inertial_set_bias =
    fits<decltype(T::set_bias(write_map<M>(), a_keyframe<map_traits<M>>(), a_const<imu_bias<double>>())), anything>;
template <class M, class T>
using inertial_set_motion =
    fits<decltype(T::set_motion(write_map<M>(), a_keyframe<map_traits<M>>(), a_const<preintegration<double>>())),
         anything>;
template <class M, class T>
using inertial_clear_motion = fits<decltype(T::clear_motion(write_map<M>(), a_keyframe<map_traits<M>>())), anything>;

template <class M, class T>
using inertial_refined_member = if_converts<decltype(T::refined(read_map<M>())), bool>;
template <class M, class T>
using inertial_join_member =
    decltype(T::join_samples(write_map<M>(), a_keyframe<map_traits<M>>(), a_keyframe<map_traits<M>>()));
template <class M, class T>
using inertial_bias_member =
    decltype(T::bias_changed(write_map<M>(), a_keyframe<map_traits<M>>(), a_const<imu_bias<double>>()));
template <class M, class T>
using inertial_initialise_member = std::void_t<decltype(T::set_gravity(write_map<M>(), a_const<vec3<double>>())),
                                               decltype(T::set_initialised(write_map<M>(), bool{}))>;

/// Every optional member: see has_name().
struct optional_inertial_names {
  int refined, join_samples, bias_changed, set_gravity, set_initialised;
};
TURBOMAP_NAMED_MEMBER(refined);
TURBOMAP_NAMED_MEMBER(join_samples);
TURBOMAP_NAMED_MEMBER(bias_changed);
TURBOMAP_NAMED_MEMBER(set_gravity);
TURBOMAP_NAMED_MEMBER(set_initialised);

template <class Map, template <class, class> class Member>
inline constexpr bool inertial_has_v = has_member<Member, Map, inertial_traits<Map>>::value;
template <class Map, template <class, class> class Member>
using inertial_fit = typename fit_of_member<Member, Map, inertial_traits<Map>>::type;
template <class Map, template <class, class> class Member, template <class, class> class... Names>
inline constexpr bool inertial_usable_or_absent_v =
    inertial_has_v<Map, Member> || !(has_name<Names, inertial_traits<Map>, optional_inertial_names>() || ...);

}  // namespace detail

TURBOMAP_END_NAMESPACE

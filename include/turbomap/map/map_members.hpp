// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which optional members map_traits of a map have: map_has_v<Map, map_guard_member> and its like. A member that cannot be called
/// as the library would is as good as absent here; require_map_traits.hpp makes an error of it. A part of map_traits.hpp.

#include <cstddef>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../traits.hpp"
#include "../types.hpp"

namespace turbomap {

template <class Map>
struct map_traits;  // map_traits.hpp

}  // namespace turbomap

/// named_X<M, T>, for has_name(): there is one where traits T have a member X, whatever it takes.
#define TURBOMAP_NAMED_MEMBER(member) \
  template <class M, class T>         \
  using named_##member = decltype(&T::member)

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

struct any_probe {
  template <class T>
  void operator()(T) const {}
};

// M: the map, T: its traits; the names of keyframe and point come from T.
template <class T>
using keyframe_of = std::decay_t<typename T::keyframe>;
template <class T>
using point_of = std::decay_t<typename T::point>;
// What the arguments of a member are.
template <class M>
const M& read_map();
template <class M>
M& write_map();
template <class T>
keyframe_of<T> a_keyframe();
template <class T>
point_of<T> a_point();
template <class M, class T>
using map_keypoint_count_member = if_converts<decltype(T::keypoint_count(read_map<M>(), a_keyframe<T>())), std::size_t>;
template <class M, class T>
using map_keypoint_member =
    std::void_t<map_keypoint_count_member<M, T>,
                if_converts<decltype(T::keypoint(read_map<M>(), a_keyframe<T>(), std::size_t{})), turbomap::keypoint>>;
template <class M, class T>
using map_adjust_member =
    std::void_t<decltype(T::set_position(write_map<M>(), a_point<T>(), std::declval<const vec3<double>&>())),
                decltype(T::set_pose(write_map<M>(), a_keyframe<T>(), std::declval<const rigid_transform<double>&>()))>;
template <class M, class T>
using map_counts_member = std::void_t<decltype(T::octave_counts(read_map<M>(), a_point<T>()).size()),
                                      decltype(T::change_octave_count(write_map<M>(), a_point<T>(), int{}, int{}))>;
template <class M, class T>
using map_prefetch_member = decltype(T::prefetch(read_map<M>(), a_point<T>(), unsigned{}));
template <class M, class T>
using map_reserve_member = decltype(T::reserve_observations(write_map<M>(), a_point<T>(), std::size_t{}));
template <class M, class T>
using map_covariance_member =
    std::void_t<if_converts<decltype(T::covariance(read_map<M>(), a_point<T>())), point_covariance>,
                decltype(T::set_covariance(write_map<M>(), a_point<T>(), std::declval<const point_covariance&>()))>;
template <class M, class T>
using map_found_member = if_converts<decltype(T::found_ratio(read_map<M>(), a_point<T>())), float>;
template <class M, class T>
using map_may_erase_member = if_converts<decltype(T::may_erase(read_map<M>(), a_keyframe<T>())), bool>;
template <class M, class T>
using map_origin_member = if_converts<decltype(T::is_origin(read_map<M>(), a_keyframe<T>())), bool>;
template <class M, class T>
using map_temporal_member =
    std::void_t<if_converts<decltype(T::time(read_map<M>(), a_keyframe<T>())), double>,
                if_converts<decltype(T::previous(read_map<M>(), a_keyframe<T>())), keyframe_of<T>>,
                if_converts<decltype(T::next(read_map<M>(), a_keyframe<T>())), keyframe_of<T>>>;
template <class M, class T>
using map_index_member = std::void_t<if_converts<decltype(T::index(read_map<M>(), a_keyframe<T>())), std::size_t>,
                                     if_converts<decltype(T::index(read_map<M>(), a_point<T>())), std::size_t>>;
template <class M, class T>
using map_mirrored_member = std::integral_constant<bool, T::mirrored>;
template <class M, class T>
using map_guard_member = if_lock<decltype(T::guard(write_map<M>()))>;
/// Only the copy of a user's map that the library keeps has it: look_again.hpp.
template <class M, class T>
using map_look_member = decltype(T::look_again(read_map<M>(), a_keyframe<T>()));
/// The same: observation_counts.hpp.
template <class M, class T>
using map_measurements_member =
    std::void_t<map_look_member<M, T>, decltype(T::kept_measurements(read_map<M>(), a_point<T>()))>;
template <class M, class T>
using map_all_member = std::void_t<decltype(T::for_each_keyframe(read_map<M>(), any_probe{})),
                                   decltype(T::for_each_point(read_map<M>(), any_probe{}))>;

template <class M, class T>
using map_created_member = decltype(T::created(write_map<M>(), a_point<T>()));
template <class M, class T>
using map_merged_member = decltype(T::merged(write_map<M>(), a_point<T>(), a_point<T>()));
template <class M, class T>
using map_erased_member = decltype(T::erased(write_map<M>(), a_point<T>()));

template <class Map, template <class, class> class Member>
inline constexpr bool map_has_v = has_member<Member, Map, map_traits<Map>>::value;

/// What *name is, for names that are pointers of any kind; void for others.
template <class Name, class = void>
struct pointee {
  using type = void;
};
template <class Name>
struct pointee<Name, std::void_t<decltype(*std::declval<const Name&>())>> {
  using type = std::decay_t<decltype(*std::declval<const Name&>())>;
};
/// Whether keyframe_traits of what a keyframe's name points to describe its keypoints.
template <class M, class T>
using keypoints_by_keyframe_traits = std::enable_if_t<has_keyframe_traits_v<typename pointee<keyframe_of<T>>::type>>;
template <class Map>
inline constexpr bool describes_keypoints_v =
    map_has_v<Map, map_keypoint_member> || map_has_v<Map, keypoints_by_keyframe_traits>;

}  // namespace detail

TURBOMAP_END_NAMESPACE

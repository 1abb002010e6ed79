// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether the optional members of map_traits are what their author takes them for. One that cannot be called as the library would,
/// or gives something else, would be passed over without a word: so that is an error. So are the names below that are taken for
/// those of members, such as `lock` for `guard`. Any other name is the user's own. A part of require_map_traits.hpp.

#include <type_traits>

#include "../config.hpp"
#include "../traits.hpp"
#include "../types.hpp"
#include "map_members.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Every optional member: see has_name().
struct optional_names {
  int may_erase, is_origin, found_ratio, reserve_observations, octave_counts, change_octave_count, covariance,
      set_covariance, set_position, set_pose, time, previous, next, created, merged, erased, for_each_keyframe,
      for_each_point, keypoint_count, keypoint, index, mirrored, prefetch;
};
TURBOMAP_NAMED_MEMBER(may_erase);
TURBOMAP_NAMED_MEMBER(is_origin);
TURBOMAP_NAMED_MEMBER(found_ratio);
TURBOMAP_NAMED_MEMBER(reserve_observations);
TURBOMAP_NAMED_MEMBER(octave_counts);
TURBOMAP_NAMED_MEMBER(change_octave_count);
TURBOMAP_NAMED_MEMBER(covariance);
TURBOMAP_NAMED_MEMBER(set_covariance);
TURBOMAP_NAMED_MEMBER(set_position);
TURBOMAP_NAMED_MEMBER(set_pose);
TURBOMAP_NAMED_MEMBER(time);
TURBOMAP_NAMED_MEMBER(previous);
TURBOMAP_NAMED_MEMBER(next);
TURBOMAP_NAMED_MEMBER(created);
TURBOMAP_NAMED_MEMBER(merged);
TURBOMAP_NAMED_MEMBER(erased);
TURBOMAP_NAMED_MEMBER(for_each_keyframe);
TURBOMAP_NAMED_MEMBER(for_each_point);

TURBOMAP_NAMED_MEMBER(keypoint_count);
TURBOMAP_NAMED_MEMBER(keypoint);
template <class M, class T>
using type_keypoint = typename T::keypoint;
TURBOMAP_NAMED_MEMBER(index);
template <class M, class T>
using type_index = typename T::index;
TURBOMAP_NAMED_MEMBER(prefetch);
TURBOMAP_NAMED_MEMBER(mirrored);

// Functions whose names are taken for those of optional members.
template <class M, class T>
using near_guard_lock = decltype(T::lock(write_map<M>()));
template <class M, class T>
using near_guard_lock_guard = decltype(T::lock_guard(write_map<M>()));
template <class M, class T>
using near_guard_scoped_lock = decltype(T::scoped_lock(write_map<M>()));
template <class M, class T>
using near_guard_get_guard = decltype(T::get_guard(write_map<M>()));
template <class M, class T>
using near_guard_guards = decltype(T::guards(write_map<M>()));
template <class M, class T>
using near_guard_acquire = decltype(T::acquire(write_map<M>()));
template <class M, class T>
using near_may_erase_can_erase = decltype(T::can_erase(read_map<M>(), a_keyframe<T>()));
template <class M, class T>
using near_may_erase_may_cull = decltype(T::may_cull(read_map<M>(), a_keyframe<T>()));
template <class M, class T>
using near_may_erase_mayErase = decltype(T::mayErase(read_map<M>(), a_keyframe<T>()));
template <class M, class T>
using near_may_erase_erasable = decltype(T::erasable(read_map<M>(), a_keyframe<T>()));
template <class M, class T>
using near_is_origin_origin = decltype(T::origin(read_map<M>(), a_keyframe<T>()));
template <class M, class T>
using near_is_origin_is_fixed = decltype(T::is_fixed(read_map<M>(), a_keyframe<T>()));
template <class M, class T>
using near_is_origin_isOrigin = decltype(T::isOrigin(read_map<M>(), a_keyframe<T>()));
template <class M, class T>
using near_found_ratio_ratio_found = decltype(T::ratio_found(read_map<M>(), a_point<T>()));
template <class M, class T>
using near_found_ratio_get_found_ratio = decltype(T::get_found_ratio(read_map<M>(), a_point<T>()));
template <class M, class T>
using near_found_ratio_foundRatio = decltype(T::foundRatio(read_map<M>(), a_point<T>()));
template <class M, class T>
using near_set_pose_setPose = decltype(T::setPose(write_map<M>(), a_keyframe<T>(), rigid_transform<double>{}));
template <class M, class T>
using near_set_pose_SetPose = decltype(T::SetPose(write_map<M>(), a_keyframe<T>(), rigid_transform<double>{}));
template <class M, class T>
using near_set_position_setPosition = decltype(T::setPosition(write_map<M>(), a_point<T>(), vec3<double>{}));
template <class M, class T>
using near_set_position_SetPosition = decltype(T::SetPosition(write_map<M>(), a_point<T>(), vec3<double>{}));
template <class M, class T>
using near_set_position_SetWorldPos = decltype(T::SetWorldPos(write_map<M>(), a_point<T>(), vec3<double>{}));
template <class M, class T>
using near_created_create = decltype(T::create(write_map<M>(), a_point<T>()));
template <class M, class T>
using near_created_on_created = decltype(T::on_created(write_map<M>(), a_point<T>()));

template <class Map, template <class, class> class... Members>
inline constexpr bool has_any_v = (map_has_v<Map, Members> || ...);

/// Whether an optional member can be used, or is not there at all.
template <class Map, template <class, class> class Member, template <class, class> class... Names>
inline constexpr bool usable_or_absent_v =
    map_has_v<Map, Member> || !(has_name<Names, map_traits<Map>, optional_names>() || ...);

/// What require_map_traits() says of optional members.
template <class Map>
constexpr bool check_optional_members() {
  static_assert(
      map_has_v<Map, map_guard_member> || !has_name<guard_name, map_traits<Map>, guard_names>(),
      "turbomap: map_traits::guard must be `static Lock guard(Map&)`, and return by value what holds the lock "
      "while it lives, e.g. std::unique_lock<std::mutex>; see docs/map.md");
  static_assert(
      usable_or_absent_v<Map, map_may_erase_member, named_may_erase>,
      "turbomap: map_traits::may_erase must be `static bool may_erase(const Map&, keyframe)`; see docs/map.md");
  static_assert(
      usable_or_absent_v<Map, map_origin_member, named_is_origin>,
      "turbomap: map_traits::is_origin must be `static bool is_origin(const Map&, keyframe)`; see docs/map.md");
  static_assert(
      usable_or_absent_v<Map, map_found_member, named_found_ratio>,
      "turbomap: map_traits::found_ratio must be `static float found_ratio(const Map&, point)`; see docs/map.md");
  static_assert(usable_or_absent_v<Map, map_reserve_member, named_reserve_observations>,
                "turbomap: map_traits::reserve_observations must be `static void reserve_observations(Map&, point, "
                "std::size_t)`; see docs/map.md");
  static_assert(
      usable_or_absent_v<Map, map_counts_member, named_octave_counts, named_change_octave_count>,
      "turbomap: map_traits needs both or neither of `static span<const std::uint32_t> octave_counts(const Map&, "
      "point)` and `static void change_octave_count(Map&, point, int, int)`; see docs/map.md");
  static_assert(
      usable_or_absent_v<Map, map_prefetch_member, named_prefetch>,
      "turbomap: map_traits::prefetch must be `static void prefetch(const Map&, point, unsigned)`; see docs/map.md");
  static_assert(
      usable_or_absent_v<Map, map_covariance_member, named_covariance, named_set_covariance>,
      "turbomap: map_traits needs both or neither of `static point_covariance covariance(const Map&, point)` and "
      "`static void set_covariance(Map&, point, const point_covariance&)`; see docs/map.md");
  static_assert(
      usable_or_absent_v<Map, map_adjust_member, named_set_position, named_set_pose>,
      "turbomap: map_traits needs both or neither of `static void set_position(Map&, point, const "
      "vec3<double>&)` and `static void set_pose(Map&, keyframe, const rigid_transform<double>&)`; see docs/map.md");
  static_assert(
      usable_or_absent_v<Map, map_temporal_member, named_time, named_previous, named_next>,
      "turbomap: map_traits needs all or none of `static double time(const Map&, keyframe)`, `static keyframe "
      "previous(const Map&, keyframe)` and `static keyframe next(const Map&, keyframe)`; see docs/map.md");
  static_assert(
      usable_or_absent_v<Map, map_all_member, named_for_each_keyframe, named_for_each_point>,
      "turbomap: map_traits needs both or neither of `template <class F> static void for_each_keyframe(const Map&, "
      "F)` and `template <class F> static void for_each_point(const Map&, F)`; see docs/map.md");
  static_assert(usable_or_absent_v<Map, map_created_member, named_created>,
                "turbomap: map_traits::created must be `static void created(Map&, point)`; see docs/map.md");
  static_assert(
      usable_or_absent_v<Map, map_merged_member, named_merged>,
      "turbomap: map_traits::merged must be `static void merged(Map&, point from, point into)`; see docs/map.md");
  static_assert(usable_or_absent_v<Map, map_erased_member, named_erased>,
                "turbomap: map_traits::erased must be `static void erased(Map&, point)`; see docs/map.md");
  static_assert(
      !describes_keypoints_v<Map> || map_has_v<Map, type_keypoint> ||
          usable_or_absent_v<Map, map_keypoint_member, named_keypoint_count, named_keypoint>,
      "turbomap: map_traits needs both or neither of `static std::size_t keypoint_count(const Map&, keyframe)` "
      "and `static keypoint keypoint(const Map&, keyframe, std::size_t)` where a keyframe is named by a pointer "
      "to a type with keyframe_traits; see docs/map.md");
  static_assert(map_has_v<Map, type_index> || usable_or_absent_v<Map, map_index_member, named_index>,
                "turbomap: map_traits needs both or neither of `static std::size_t index(const Map&, keyframe)` and "
                "`static std::size_t index(const Map&, point)`; see docs/map.md");
  static_assert(usable_or_absent_v<Map, map_mirrored_member, named_mirrored>,
                "turbomap: map_traits::mirrored must be `static constexpr bool mirrored = true;`; see docs/map.md");
  static_assert(map_has_v<Map, map_guard_member> ||
                    !has_any_v<Map, near_guard_lock, near_guard_lock_guard, near_guard_scoped_lock,
                               near_guard_get_guard, near_guard_guards, near_guard_acquire>,
                "turbomap: map_traits has no `guard`, but a function of a similar name (lock, lock_guard, scoped_lock, "
                "get_guard, guards, acquire): rename it; see docs/map.md");
  static_assert(
      map_has_v<Map, map_may_erase_member> || !has_any_v<Map, near_may_erase_can_erase, near_may_erase_may_cull,
                                                         near_may_erase_mayErase, near_may_erase_erasable>,
      "turbomap: map_traits has no `may_erase`, but a function of a similar name (can_erase, may_cull, mayErase, "
      "erasable): rename it; see docs/map.md");
  static_assert(map_has_v<Map, map_origin_member> ||
                    !has_any_v<Map, near_is_origin_origin, near_is_origin_is_fixed, near_is_origin_isOrigin>,
                "turbomap: map_traits has no `is_origin`, but a function of a similar name (origin, is_fixed, "
                "isOrigin): rename it; see docs/map.md");
  static_assert(
      map_has_v<Map, map_found_member> ||
          !has_any_v<Map, near_found_ratio_ratio_found, near_found_ratio_get_found_ratio, near_found_ratio_foundRatio>,
      "turbomap: map_traits has no `found_ratio`, but a function of a similar name (ratio_found, get_found_ratio, "
      "foundRatio): rename it; see docs/map.md");
  // Where one of the two is there, the other is asked for above.
  static_assert(
      has_name<named_set_pose, map_traits<Map>, optional_names>() ||
          has_name<named_set_position, map_traits<Map>, optional_names>() ||
          !has_any_v<Map, near_set_pose_setPose, near_set_pose_SetPose, near_set_position_setPosition,
                     near_set_position_SetPosition, near_set_position_SetWorldPos>,
      "turbomap: map_traits has no `set_pose` and `set_position`, but a function of a similar name (setPose, SetPose, "
      "setPosition, SetPosition, SetWorldPos): rename it; see docs/map.md");
  static_assert(
      map_has_v<Map, map_created_member> || !has_any_v<Map, near_created_create, near_created_on_created>,
      "turbomap: map_traits has no `created`, but a function of a similar name (create, on_created): rename it; see "
      "docs/map.md");
  return true;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How the library reads and changes the user's map, whatever it is: a small struct that they specialise once.
///
/// This is the interface, as code. A specialisation has static members only; they run on the host, under the guard below.
/// Reads may be called at any time; writes are called by commits only, one after the other, and must not throw, but for
/// add_point() and reserve_observations(): everything that can be refused has been refused before the first one. A write
/// changes one side only (a slot, or an observation list): map_edit.hpp calls them in pairs and keeps the counts, so that no
/// user has to.
///
///     template <>
///     struct turbomap::map_traits<my::Map> {
///       using keyframe = my::KeyFrame*;     // names a keyframe: copied, compared by ==; keyframe{} names none
///       using point = my::MapPoint*;        // names a point, in the same way
///       using descriptor = turbomap::binary_descriptor<256>;
///       using camera = turbomap::pinhole<float>;  // of the rigs in the keyframe store
///
///       // Keyframes
///       static std::uint64_t id(const my::Map&, keyframe);            // unique; ascends in order of insertion
///       static bool alive(const my::Map&, keyframe);                  // in the map, not bad
///       static turbomap::rigid_transform<double> pose(const my::Map&, keyframe);  // T_cw, world to body
///       static std::size_t keypoint_count(const my::Map&, keyframe);  // this and the next one are not needed where a
///       static turbomap::keypoint keypoint(const my::Map&, keyframe, std::size_t i);  // keyframe is named by a pointer
///                                                                     // to a type that has keyframe_traits
///       static point point_at(const my::Map&, keyframe, std::size_t i);           // the slot: point{} holds none
///
///       // Points
///       static std::uint64_t id(const my::Map&, point);               // unique; ascends in order of creation
///       static bool alive(const my::Map&, point);
///       static point replacement(const my::Map&, point);              // of a merged point; point{}: none
///       static turbomap::vec3<double> position(const my::Map&, point);            // world, m
///       static turbomap::vec3<float> normal(const my::Map&, point);   // mean of unit rays from the cameras to the point
///       static float min_distance(const my::Map&, point);             // m: the range in which the pyramid sees it
///       static float max_distance(const my::Map&, point);
///       static const descriptor::element* descriptor_data(const my::Map&, point);  // or an object with data(), by value too;
///                                                            // valid until the next call of a member, read at once
///       static keyframe reference(const my::Map&, point);
///       template <class F>
///       static void for_each_observation(const my::Map&, point, F f); // f(keyframe, std::size_t keypoint)
///
///       // Writes
///       static point add_point(my::Map&, const turbomap::vec3<double>& position, keyframe reference);
///       static void set_position(my::Map&, point, const turbomap::vec3<double>&);
///       static void set_appearance(my::Map&, point, const turbomap::vec3<float>& normal, float min_distance,
///                                  float max_distance, const descriptor::element* descriptor);
///       static void set_reference(my::Map&, point, keyframe);
///       static void set_point(my::Map&, keyframe, std::size_t i, point);          // the slot; point{} empties it
///       static void add_observation(my::Map&, point, keyframe, std::size_t i);
///       static void erase_observation(my::Map&, point, keyframe, std::size_t i);
///       static void retire(my::Map&, point, point replacement);       // no longer alive; point{}: erased, not merged
///       static void erase_keyframe(my::Map&, keyframe);               // its slots are empty by then
///       static void set_pose(my::Map&, keyframe, const turbomap::rigid_transform<double>& T_cw);
///
///       // Optional
///       static constexpr bool mirrored = true;  // reads are expensive: stages read a copy. Has conditions: local_mapping.md
///       static turbomap::span<const std::uint32_t> octave_counts(const my::Map&, point);  // see observation_counts.hpp
///       static void change_octave_count(my::Map&, point, int octave, int change);         // both or neither
///       static void reserve_observations(my::Map&, point, std::size_t more);  // may throw: add_observation then does not
///       static std::size_t index(const my::Map&, keyframe);           // small and unique among the living, e.g. a place in
///       static std::size_t index(const my::Map&, point);              //    an array: replaces tables of ids
///       static void prefetch(const my::Map&, point, unsigned what);   // asks memory for what is read soon: see point_data.
///                                                                     // The point may be dead, or its memory gone
///       static turbomap::point_covariance covariance(const my::Map&, point);   // how well its position is known; these
///       static void set_covariance(my::Map&, point, const turbomap::point_covariance&);        // two: both or neither
///       static float found_ratio(const my::Map&, point);              // found / visible in tracking; else taken as 1
///       static bool may_erase(const my::Map&, keyframe);              // false: culling leaves it (the first one, ...)
///       static bool is_origin(const my::Map&, keyframe);              // adjustments hold it: the frame of reference
///       static double time(const my::Map&, keyframe);                 // s: temporal guards of inertial systems,
///       static keyframe previous(const my::Map&, keyframe);           //    with these two; keyframe{} at the ends
///       static keyframe next(const my::Map&, keyframe);
///       static std::unique_lock<std::mutex> guard(my::Map&);          // held while a snapshot is read or a plan applied
///       static void created(my::Map&, point);                         // after the change is complete, under the guard: what
///       static void merged(my::Map&, point from, point into);         //    your own structures need to know of it at once
///       static void erased(my::Map&, point);
///       template <class F> static void for_each_keyframe(const my::Map&, F f);            // for validate(), and to scale a
///       template <class F> static void for_each_point(const my::Map&, F f);               // monocular map by its IMU
///     };
///
/// See docs/map.md and examples/02_your_own_types.cpp.

#include <cstddef>

#include "../config.hpp"
#include "../span.hpp"
#include "../traits.hpp"
#include "../types.hpp"
#include "map_members.hpp"
#include "require_map_traits.hpp"

namespace turbomap {

/// Specialise this for your map type: see above.
template <class Map>
struct map_traits {
  using turbomap_not_specialised = void;  ///< only here, so that a missing specialisation is found.
};

/// What is read soon of a point, for prefetch() of the traits. Sums are given. The point is never point{}, but it may be dead, or
/// its memory gone. prefetch_line() (prefetch.hpp) does no harm at any address, a read does: prefetch() reads only where it has
/// checked that it may, for example an array at an index below its size. Of __builtin_prefetch alone g++ leaves nothing.
enum class point_data : unsigned {
  entry = 1,       ///< whether it is alive, its position, its reference, where its observations are
  views = 2,       ///< its observations; `entry` of the same point was asked for some points before
  appearance = 4,  ///< normal, range, descriptor
  octaves = 8      ///< its octave counts
};
/// The set of both, as prefetch() of the traits gets it.
constexpr unsigned operator+(point_data a, point_data b) { return static_cast<unsigned>(a) | static_cast<unsigned>(b); }

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// The number of keypoints of a keyframe: by map_traits, or by keyframe_traits of what its name points to.
template <class Map>
std::size_t keypoint_count_of([[maybe_unused]] const Map& map, const typename map_traits<Map>::keyframe& keyframe) {
  if constexpr (detail::map_has_v<Map, detail::map_keypoint_count_member>) {
    return map_traits<Map>::keypoint_count(map, keyframe);
  } else {
    using described = typename detail::pointee<typename map_traits<Map>::keyframe>::type;
    return keyframe_traits<described>::keypoint_count(*keyframe);
  }
}
/// One keypoint of a keyframe, in the same way: by value or reference, as the traits give it.
template <class Map>
decltype(auto) keypoint_of([[maybe_unused]] const Map& map, const typename map_traits<Map>::keyframe& keyframe,
                           std::size_t i) {
  if constexpr (detail::map_has_v<Map, detail::map_keypoint_member>) {
    return map_traits<Map>::keypoint(map, keyframe, i);
  } else {
    using described = typename detail::pointee<typename map_traits<Map>::keyframe>::type;
    return keyframe_traits<described>::keypoint(*keyframe, i);
  }
}

/// The pose of a keyframe in double, whatever scalar the map has.
template <class Map>
rigid_transform<double> pose_of(const Map& map, typename map_traits<Map>::keyframe keyframe) {
  const auto& T = map_traits<Map>::pose(map, keyframe);
  rigid_transform<double> T_cw;
  T_cw.qx = T.qx, T_cw.qy = T.qy, T_cw.qz = T.qz, T_cw.qw = T.qw;
  T_cw.tx = T.tx, T_cw.ty = T.ty, T_cw.tz = T.tz;
  return T_cw;
}
/// The position of a point in double, whatever scalar the map has; world, m.
template <class Map>
vec3<double> position_of(const Map& map, const typename map_traits<Map>::point& point) {
  const auto& x = map_traits<Map>::position(map, point);
  return {x.x, x.y, x.z};
}
/// Whether nothing moved a pose meanwhile: equal to the last bit.
inline bool is_same_pose(const rigid_transform<double>& a, const rigid_transform<double>& b) {
  return a.qx == b.qx && a.qy == b.qy && a.qz == b.qz && a.qw == b.qw && a.tx == b.tx && a.ty == b.ty && a.tz == b.tz;
}

/// Holds the user's guard of the map, if there is one, while it lives.
template <class Map>
auto map_guard([[maybe_unused]] Map& map) {
  if constexpr (detail::map_has_v<Map, detail::map_guard_member>)
    return map_traits<Map>::guard(map);
  else
    return nullptr;
}
/// Whether map_traits<Map> have a guard. A system in which several threads use the map says so once, beside its traits:
/// `static_assert(turbomap::guarded_v<my::Map>);`.
template <class Map>
inline constexpr bool guarded_v = detail::map_has_v<Map, detail::map_guard_member>;
/// Whether map_traits<Map> can move keyframes and points: without set_pose() and set_position() the stage `adjustment` is
/// off. A system that is to be adjusted says so once: `static_assert(turbomap::adjustable_v<my::Map>);`.
template <class Map>
inline constexpr bool adjustable_v = detail::map_has_v<Map, detail::map_adjust_member>;

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// What map_traits must have, and what it may have: one type without each member.

#include <doctest/doctest.h>

#include <turbomap/map/map_traits.hpp>

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <type_traits>
#include <utility>

#include "scenes/lying_map.hpp"
#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"

namespace users {

/// Members that a map's traits may lack.
enum class member {
  keyframe_name,
  point_name,
  descriptor_name,
  camera_name,
  keyframe_id,
  keyframe_alive,
  pose,
  keypoint_count,
  keypoint,
  point_at,
  point_id,
  point_alive,
  replacement,
  position,
  normal,
  min_distance,
  max_distance,
  descriptor_data,
  reference,
  for_each_observation,
  add_point,
  set_appearance,
  set_reference,
  set_point,
  add_observation,
  erase_observation,
  retire,
  erase_keyframe,
  last_required = erase_keyframe,
  set_position,
  set_pose,
  octave_counts,
  change_octave_count,
  reserve_observations,
  covariance,
  set_covariance,
  found_ratio,
  may_erase,
  time,
  previous,
  next,
  guard,
  for_each_keyframe,
  for_each_point,
  nothing
};

struct some_keyframe {
  int number;
  friend bool operator==(const some_keyframe& a, const some_keyframe& b) { return a.number == b.number; }
};
struct some_point {
  int number;
  friend bool operator==(const some_point& a, const some_point& b) { return a.number == b.number; }
};

/// A map with traits that lack one member.
template <member Lacks>
struct map_without {
  std::mutex mutex;
};

template <bool There>
struct keyframe_name {
  using keyframe = some_keyframe;
};
template <>
struct keyframe_name<false> {};
template <bool There>
struct point_name {
  using point = some_point;
};
template <>
struct point_name<false> {};
template <bool There>
struct descriptor_name {
  using descriptor = turbomap_test::map_descriptor;
};
template <>
struct descriptor_name<false> {};
template <bool There>
struct camera_name {
  using camera = turbomap_test::map_camera;
};
template <>
struct camera_name<false> {};

}  // namespace users

template <users::member L>
struct turbomap::map_traits<users::map_without<L>> : users::keyframe_name<L != users::member::keyframe_name>,
                                                     users::point_name<L != users::member::point_name>,
                                                     users::descriptor_name<L != users::member::descriptor_name>,
                                                     users::camera_name<L != users::member::camera_name> {
  using M = users::map_without<L>;
  using K = users::some_keyframe;
  using P = users::some_point;
  using m = users::member;
  /// T, and no function at all when it is the member that lacks.
  template <m Member, m X, class T>
  using unless = std::enable_if_t<Member != X, T>;

  template <m X = L>
  static unless<m::keyframe_id, X, std::uint64_t> id(const M&, K) {
    return 0;
  }
  template <m X = L>
  static unless<m::keyframe_alive, X, bool> alive(const M&, K) {
    return true;
  }
  template <m X = L>
  static unless<m::pose, X, turbomap::rigid_transform<float>> pose(const M&, K) {
    return {};
  }
  template <m X = L>
  static unless<m::keypoint_count, X, int> keypoint_count(const M&, K) {
    return 0;
  }
  template <m X = L>
  static unless<m::keypoint, X, turbomap::keypoint> keypoint(const M&, K, std::size_t) {
    return {};
  }
  template <m X = L>
  static unless<m::point_at, X, P> point_at(const M&, K, std::size_t) {
    return {};
  }
  template <m X = L>
  static unless<m::point_id, X, unsigned> id(const M&, P) {
    return 0;
  }
  template <m X = L>
  static unless<m::point_alive, X, bool> alive(const M&, P) {
    return true;
  }
  template <m X = L>
  static unless<m::replacement, X, P> replacement(const M&, P) {
    return {};
  }
  template <m X = L>
  static unless<m::position, X, turbomap::vec3<float>> position(const M&, P) {
    return {};
  }
  template <m X = L>
  static unless<m::normal, X, turbomap::vec3<float>> normal(const M&, P) {
    return {};
  }
  template <m X = L>
  static unless<m::min_distance, X, double> min_distance(const M&, P) {
    return 0;
  }
  template <m X = L>
  static unless<m::max_distance, X, double> max_distance(const M&, P) {
    return 0;
  }
  template <m X = L>
  static unless<m::descriptor_data, X, std::uint8_t*> descriptor_data(const M&, P) {
    return nullptr;
  }
  template <m X = L>
  static unless<m::reference, X, K> reference(const M&, P) {
    return {};
  }
  template <class F, m X = L>
  static unless<m::for_each_observation, X, void> for_each_observation(const M&, P, F) {}
  template <m X = L>
  static unless<m::add_point, X, P> add_point(M&, const turbomap::vec3<double>&, K) {
    return {};
  }
  template <m X = L>
  static unless<m::set_position, X, void> set_position(M&, P, const turbomap::vec3<double>&) {}
  template <m X = L>
  static unless<m::set_appearance, X, void> set_appearance(M&, P, const turbomap::vec3<float>&, float, float,
                                                           const std::uint8_t*) {}
  template <m X = L>
  static unless<m::set_reference, X, void> set_reference(M&, P, K) {}
  template <m X = L>
  static unless<m::set_point, X, void> set_point(M&, K, std::size_t, P) {}
  template <m X = L>
  static unless<m::add_observation, X, void> add_observation(M&, P, K, std::size_t) {}
  template <m X = L>
  static unless<m::erase_observation, X, void> erase_observation(M&, P, K, std::size_t) {}
  template <m X = L>
  static unless<m::retire, X, void> retire(M&, P, P) {}
  template <m X = L>
  static unless<m::erase_keyframe, X, void> erase_keyframe(M&, K) {}
  template <m X = L>
  static unless<m::set_pose, X, void> set_pose(M&, K, const turbomap::rigid_transform<double>&) {}
  template <m X = L>
  static unless<m::octave_counts, X, turbomap::span<const std::uint32_t>> octave_counts(const M&, P) {
    return {};
  }
  template <m X = L>
  static unless<m::change_octave_count, X, void> change_octave_count(M&, P, int, int) {}
  template <m X = L>
  static unless<m::reserve_observations, X, void> reserve_observations(M&, P, std::size_t) {}
  template <m X = L>
  static unless<m::covariance, X, turbomap::point_covariance> covariance(const M&, P) {
    return {};
  }
  template <m X = L>
  static unless<m::set_covariance, X, void> set_covariance(M&, P, const turbomap::point_covariance&) {}
  template <m X = L>
  static unless<m::found_ratio, X, float> found_ratio(const M&, P) {
    return 1;
  }
  template <m X = L>
  static unless<m::may_erase, X, bool> may_erase(const M&, K) {
    return true;
  }
  template <m X = L>
  static unless<m::time, X, double> time(const M&, K) {
    return 0;
  }
  template <m X = L>
  static unless<m::previous, X, K> previous(const M&, K) {
    return {};
  }
  template <m X = L>
  static unless<m::next, X, K> next(const M&, K) {
    return {};
  }
  template <m X = L>
  static unless<m::guard, X, std::unique_lock<std::mutex>> guard(M& map) {
    return std::unique_lock<std::mutex>(map.mutex);
  }
  template <class F, m X = L>
  static unless<m::for_each_keyframe, X, void> for_each_keyframe(const M&, F) {}
  template <class F, m X = L>
  static unless<m::for_each_point, X, void> for_each_point(const M&, F) {}
};

namespace {

using namespace turbomap_test;
using users::map_without;
using users::member;

struct unknown {};

static_assert(turbomap::has_map_traits_v<flat_map>);
static_assert(turbomap::has_map_traits_v<pointer_map>);
static_assert(turbomap::has_map_traits_v<lying_map>);
static_assert(turbomap::has_map_traits_v<map_without<member::nothing>>);
static_assert(!turbomap::has_map_traits_v<unknown>);
static_assert(turbomap::require_map_traits<pointer_map>());

template <int... Members>
constexpr bool all_required(std::integer_sequence<int, Members...>) {
  return (!turbomap::has_map_traits_v<map_without<static_cast<member>(Members)>> && ...);
}
constexpr int required = static_cast<int>(member::last_required) + 1;
static_assert(all_required(std::make_integer_sequence<int, required>()));

template <int... Members>
constexpr bool all_optional(std::integer_sequence<int, Members...>) {
  return (turbomap::has_map_traits_v<map_without<static_cast<member>(required + Members)>> && ...);
}
static_assert(all_optional(std::make_integer_sequence<int, static_cast<int>(member::nothing) - required>()));

/// Whether an optional group is there, when `Lacks` is not.
template <member Lacks, template <class, class> class Group>
constexpr bool has_without = turbomap::detail::map_has_v<map_without<Lacks>, Group>;

// One of the members of a group is missing: the group is not there.
static_assert(has_without<member::nothing, turbomap::detail::map_counts_member>);
static_assert(!has_without<member::octave_counts, turbomap::detail::map_counts_member>);
static_assert(!has_without<member::change_octave_count, turbomap::detail::map_counts_member>);
static_assert(has_without<member::nothing, turbomap::detail::map_temporal_member>);
static_assert(!has_without<member::time, turbomap::detail::map_temporal_member>);
static_assert(!has_without<member::previous, turbomap::detail::map_temporal_member>);
static_assert(!has_without<member::next, turbomap::detail::map_temporal_member>);
static_assert(has_without<member::nothing, turbomap::detail::map_all_member>);
static_assert(!has_without<member::for_each_keyframe, turbomap::detail::map_all_member>);
static_assert(!has_without<member::for_each_point, turbomap::detail::map_all_member>);
static_assert(has_without<member::nothing, turbomap::detail::map_adjust_member>);
static_assert(!has_without<member::set_position, turbomap::detail::map_adjust_member>);
static_assert(!has_without<member::set_pose, turbomap::detail::map_adjust_member>);
static_assert(!has_without<member::reserve_observations, turbomap::detail::map_reserve_member>);
static_assert(has_without<member::nothing, turbomap::detail::map_covariance_member>);
static_assert(!has_without<member::covariance, turbomap::detail::map_covariance_member>);
static_assert(!has_without<member::set_covariance, turbomap::detail::map_covariance_member>);
static_assert(!has_without<member::found_ratio, turbomap::detail::map_found_member>);
static_assert(!has_without<member::may_erase, turbomap::detail::map_may_erase_member>);
static_assert(!has_without<member::guard, turbomap::detail::map_guard_member>);
// simple_map has them all but a guard: it is not synchronised.
static_assert(turbomap::detail::map_has_v<flat_map, turbomap::detail::map_counts_member>);
static_assert(turbomap::detail::map_has_v<flat_map, turbomap::detail::map_reserve_member>);
static_assert(turbomap::detail::map_has_v<flat_map, turbomap::detail::map_covariance_member>);
static_assert(turbomap::detail::map_has_v<flat_map, turbomap::detail::map_found_member>);
static_assert(turbomap::detail::map_has_v<flat_map, turbomap::detail::map_may_erase_member>);
static_assert(turbomap::detail::map_has_v<flat_map, turbomap::detail::map_temporal_member>);
static_assert(turbomap::detail::map_has_v<flat_map, turbomap::detail::map_all_member>);
static_assert(turbomap::detail::map_has_v<flat_map, turbomap::detail::map_adjust_member>);
static_assert(!turbomap::detail::map_has_v<flat_map, turbomap::detail::map_guard_member>);
static_assert(!turbomap::detail::map_has_v<pointer_map, turbomap::detail::map_counts_member>);

TEST_CASE("the guard of a map is held while it lives") {
  map_without<member::nothing> map;
  {
    const auto guard = turbomap::map_guard(map);
    CHECK(guard.owns_lock());
    CHECK(guard.mutex() == &map.mutex);
  }
  CHECK(map.mutex.try_lock());
  map.mutex.unlock();
  map_without<member::guard> unguarded;
  CHECK(turbomap::map_guard(unguarded) == nullptr);
}

}  // namespace

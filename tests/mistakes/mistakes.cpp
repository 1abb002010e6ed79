// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Traits with one mistake in them, which the compiler is told by -D: mistakes.txt lists them with what must be said of each.
/// Without any it compiles.

#ifdef WITH_MAPPER
#include <turbomap/local_mapper.hpp>
#endif
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/camera/rig.hpp>
#include <turbomap/descriptor/binary.hpp>
#ifdef WITH_IMU
#include <turbomap/map/inertial_traits.hpp>
#endif
#include <turbomap/map/map_traits.hpp>
#include <turbomap/traits.hpp>

#include <array>
#include <mutex>
#include <string>

namespace my {
struct Point {};
#ifdef NAMES_NOT_COMPARED
struct PointName {
  int index = -1;
};
#else
using PointName = Point*;
#endif
struct KeyFrame {};
struct Map {
  std::mutex mutex;
};
}  // namespace my

#ifndef NO_KEYFRAME_TRAITS
template <>
struct turbomap::keyframe_traits<my::KeyFrame> {
#ifndef NO_DESCRIPTOR
  using descriptor = turbomap::binary_descriptor<256>;
#endif
  using rig = turbomap::mono_rig<turbomap::pinhole<float>>;
  static rig cameras(const my::KeyFrame&) { return {}; }
#ifdef STRING_COUNT
  static std::string keypoint_count(const my::KeyFrame&) { return {}; }
#else
  static std::size_t keypoint_count(const my::KeyFrame&) { return 0; }
#endif
#ifndef NO_KEYPOINT
  static turbomap::keypoint keypoint(const my::KeyFrame&, std::size_t) { return {}; }
#endif
#ifdef FLOAT_DESCRIPTOR
  static const float* descriptor_data(const my::KeyFrame&, std::size_t) { return nullptr; }
#elif defined(HALF_DESCRIPTOR)
  static std::array<std::uint8_t, 16> descriptor_data(const my::KeyFrame&, std::size_t) { return {}; }
#else
  static const std::uint8_t* descriptor_data(const my::KeyFrame&, std::size_t) { return nullptr; }
#endif
#ifdef WRITING_KEYFRAME_GUARD
  static std::unique_lock<std::mutex> guard(my::KeyFrame&) { return {}; }
#endif
#ifdef KEYFRAME_LOCK
  static std::unique_lock<std::mutex> lock(const my::KeyFrame&) { return {}; }
#endif
#ifdef BOUNDS_OF_NOTHING
  static turbomap::image_bounds bounds() { return {}; }
#endif
};
#endif

#ifndef NO_MAP_TRAITS
template <>
struct turbomap::map_traits<my::Map> {
  using map = my::Map;
  using keyframe = my::KeyFrame*;
  using point = my::PointName;
  using descriptor = turbomap::binary_descriptor<256>;
#ifndef NO_CAMERA
  using camera = turbomap::pinhole<float>;
#endif
#ifdef STRING_ID
  static std::string id(const map&, keyframe) { return {}; }
#else
  static std::uint64_t id(const map&, keyframe) { return 0; }
#endif
  static bool alive(const map&, keyframe) { return true; }
#ifdef VECTOR_POSE
  static turbomap::vec3<double> pose(const map&, keyframe) { return {}; }
#else
  static turbomap::rigid_transform<double> pose(const map&, keyframe) { return {}; }
#endif
#ifndef NO_POINT_AT
  static point point_at(const map&, keyframe, std::size_t) { return {}; }
#endif
  static std::uint64_t id(const map&, point) { return 0; }
#ifndef NO_ALIVE_OF_POINT
  static bool alive(const map&, point) { return true; }
#endif
  static point replacement(const map&, point) { return {}; }
#ifdef WRITING_POSITION
  static turbomap::vec3<double> position(map&, point) { return {}; }
#else
  static turbomap::vec3<double> position(const map&, point) { return {}; }
#endif
  static turbomap::vec3<float> normal(const map&, point) { return {}; }
  static float min_distance(const map&, point) { return 0; }
  static float max_distance(const map&, point) { return 0; }
  static const std::uint8_t* descriptor_data(const map&, point) { return nullptr; }
  static keyframe reference(const map&, point) { return {}; }
  template <class F>
  static void for_each_observation(const map&, point, F) {}
  static point add_point(map&, const turbomap::vec3<double>&, keyframe) { return {}; }
  static void set_appearance(map&, point, const turbomap::vec3<float>&, float, float, const std::uint8_t*) {}
  static void set_reference(map&, point, keyframe) {}
  static void set_point(map&, keyframe, std::size_t, point) {}
  static void add_observation(map&, point, keyframe, std::size_t) {}
  static void erase_observation(map&, point, keyframe, std::size_t) {}
#ifndef NO_RETIRE
  static void retire(map&, point, point) {}
#endif
  static void erase_keyframe(map&, keyframe) {}
#ifdef SET_POSE_IN_CAMELS
  static void SetPose(map&, keyframe, const turbomap::rigid_transform<double>&) {}
#else
  static void set_pose(map&, keyframe, const turbomap::rigid_transform<double>&) {}
#endif
#ifdef SET_POSITION_IN_CAMELS
  static void setPosition(map&, point, const turbomap::vec3<double>&) {}
#elif !defined(NO_SET_POSITION)
  static void set_position(map&, point, const turbomap::vec3<double>&) {}
#endif
#ifdef ON_CREATED
  static void on_created(map&, point) {}
#endif

#ifdef KEYPOINT_ALONE
  static turbomap::keypoint keypoint(const map&, keyframe, std::size_t) { return {}; }
#endif
#ifdef STRING_KEYPOINT_COUNT
  static std::string keypoint_count(const map&, keyframe) { return {}; }
  static turbomap::keypoint keypoint(const map&, keyframe, std::size_t) { return {}; }
#endif
#ifdef INDEX_OF_KEYFRAME_ALONE
  static std::size_t index(const map&, keyframe) { return 0; }
#endif
#ifdef MIRRORED_AT_RUN_TIME
  static inline bool mirrored = true;
#endif
#ifdef VOID_MAY_ERASE
  static void may_erase(const map&, keyframe) {}
#endif
#ifdef VOID_ORIGIN
  static void is_origin(const map&, keyframe) {}
#endif
#ifdef STRING_FOUND_RATIO
  static std::string found_ratio(const map&, point) { return {}; }
#endif
#ifdef PREVIOUS_IS_ID
  static double time(const map&, keyframe) { return 0; }
  static std::uint64_t previous(const map&, keyframe) { return 0; }
  static std::uint64_t next(const map&, keyframe) { return 0; }
#endif
#ifdef COVARIANCE_IS_NUMBER
  static double covariance(const map&, point) { return 0; }
  static void set_covariance(map&, point, const turbomap::point_covariance&) {}
#endif
#ifdef OWN_TYPES
  using keypoint = turbomap::keypoint;
  using index = std::size_t;
#endif
#ifdef WRITING_MAY_ERASE
  static bool may_erase(map&, keyframe) { return true; }
#endif
#ifdef CAN_ERASE
  static bool can_erase(const map&, keyframe) { return true; }
#endif
#ifdef FOUND_RATIO_OF_KEYFRAME
  static float found_ratio(const map&, keyframe) { return 1; }
#endif
#ifdef MERGED_OF_ONE
  static void merged(map&, point) {}
#endif
#if defined(TIME_ALONE) || defined(WITH_IMU)
  static double time(const map&, keyframe) { return 0; }
#endif
#ifdef WITH_IMU
  static keyframe previous(const map&, keyframe) { return {}; }
  static keyframe next(const map&, keyframe) { return {}; }
#endif
#ifdef GUARD_OF_NOTHING
  static std::unique_lock<std::mutex> guard() { return {}; }
#endif
#ifdef GUARD_IS_MUTEX
  static std::mutex& guard(map& m) { return m.mutex; }
#endif
#ifdef GUARD_CALLED_LOCK
  static std::unique_lock<std::mutex> lock(map& m) { return std::unique_lock<std::mutex>(m.mutex); }
#else
  using lock = std::lock_guard<std::mutex>;  // a type of the user's is no mistake
#endif
};
#endif

#ifdef WITH_IMU
#ifndef NO_INERTIAL_TRAITS
template <>
struct turbomap::inertial_traits<my::Map> {
  using map = my::Map;
  using keyframe = my::KeyFrame*;
  using motion_type = turbomap::preintegration<double>;
  static bool initialised(const map&) { return false; }
  static turbomap::vec3<double> gravity(const map&) { return {}; }
  static turbomap::rigid_transform<double> T_bc(const map&) { return {}; }
#ifdef WRITING_VELOCITY
  static turbomap::vec3<double> velocity(map&, keyframe) { return {}; }
#else
  static turbomap::vec3<double> velocity(const map&, keyframe) { return {}; }
#endif
#ifdef VECTOR_BIAS
  static turbomap::vec3<double> bias(const map&, keyframe) { return {}; }
#else
  static turbomap::imu_bias<double> bias(const map&, keyframe) { return {}; }
#endif
  static bool motion(const map&, keyframe, motion_type&) { return false; }
  static void set_velocity(map&, keyframe, const turbomap::vec3<double>&) {}
  static void set_bias(map&, keyframe, const turbomap::imu_bias<double>&) {}
  static void set_motion(map&, keyframe, const motion_type&) {}
#ifndef NO_CLEAR_MOTION
  static void clear_motion(map&, keyframe) {}
#endif
#ifdef WRITING_REFINED
  static bool refined(map&) { return true; }
#endif
#ifdef JOIN_ONE
  static void join_samples(map&, keyframe) {}
#endif
#ifdef BIAS_CHANGED_OF_NOTHING
  static void bias_changed(map&, keyframe) {}
#endif
#ifdef SET_GRAVITY_ALONE
  static void set_gravity(map&, const turbomap::vec3<double>&) {}
#endif
};
#endif
static_assert(turbomap::require_inertial_traits<my::Map>());
#endif

#ifdef UNGUARDED
static_assert(turbomap::guarded_v<my::Map>, "my::Map is used by several threads");
#endif

#ifdef WITH_MAPPER
void use(my::Map& map, my::KeyFrame& keyframe) {
  turbomap::context ctx;
  turbomap::keyframe_store<turbomap::binary_descriptor<256>, turbomap::pinhole<float>> store;
  turbomap::local_mapper_hooks<my::Map> hooks;
  hooks.stop = [] { return false; };
  turbomap::local_mapper mapper(ctx, map, store, turbomap::local_mapper_options::monocular(), hooks);
  mapper.insert(&keyframe, keyframe);
  mapper.remove(1);
  mapper.process(&keyframe);
  mapper.watch({});
  mapper.changed(&keyframe);
  mapper.refresh();
  mapper.update_geometry({});
  mapper.update_appearance({});
  mapper.reset();
  const turbomap::mapping_report& report = mapper.report();
  const turbomap::local_adjustment_summary summary = mapper.adjust_globally(&keyframe, {});
  const turbomap::fusion_summary fused = mapper.fuse_around(&keyframe);
  static_cast<void>(report), static_cast<void>(summary), static_cast<void>(fused);
  mapper.options().deadline_ms = static_cast<double>(mapper.iterations()) + mapper.last_search().neighbour_count();
  static_cast<void>(mapper.stored().contains(1));
}
#elif defined(CONST_MAP)
static_assert(turbomap::require_map_traits<const my::Map>());
#elif defined(KEYFRAME_ALONE)
static_assert(turbomap::require_keyframe_traits<my::KeyFrame>());
#else
static_assert(turbomap::require_map_traits<my::Map>());
#endif

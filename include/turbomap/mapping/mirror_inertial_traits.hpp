// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// inertial_traits of a map_mirror. The mirror copies nothing of what an IMU told: it is read from the user's map each time, a
/// few numbers per keyframe of a window, and written there. Only names are translated.

#include <type_traits>

#include "../config.hpp"
#include "../inertial/preintegration.hpp"
#include "../map/inertial_traits.hpp"
#include "../types.hpp"
#include "map_mirror.hpp"

namespace turbomap {

/// A mirror as inertial stages see it.
template <class Map>
struct inertial_traits<map_mirror<Map>> {
  /// @{
  /// As the member of this name of inertial_traits (map/inertial_traits.hpp), of the user's map.
  using mirror = map_mirror<Map>;
  using user = inertial_traits<Map>;
  using keyframe = map_keyframe_id;

  static bool initialised(const mirror& m) { return user::initialised(m.map()); }
  template <class M = Map, class = std::enable_if_t<detail::inertial_has_v<M, detail::inertial_refined_member>>>
  static bool refined(const map_mirror<M>& m) {
    return user::refined(m.map());
  }
  static vec3<double> gravity(const mirror& m) { return user::gravity(m.map()); }
  static rigid_transform<double> T_bc(const mirror& m) { return user::T_bc(m.map()); }
  static vec3<double> velocity(const mirror& m, keyframe k) { return user::velocity(m.map(), m.name(k)); }
  static imu_bias<double> bias(const mirror& m, keyframe k) { return user::bias(m.map(), m.name(k)); }
  static bool motion(const mirror& m, keyframe k, preintegration<double>& motion) {
    return user::motion(m.map(), m.name(k), motion);
  }
  static void set_velocity(mirror& m, keyframe k, const vec3<double>& velocity) {
    user::set_velocity(m.map(), m.name(k), velocity);
  }
  static void set_bias(mirror& m, keyframe k, const imu_bias<double>& bias) {
    user::set_bias(m.map(), m.name(k), bias);
  }
  static void set_motion(mirror& m, keyframe k, const preintegration<double>& motion) {
    user::set_motion(m.map(), m.name(k), motion);
  }
  static void clear_motion(mirror& m, keyframe k) { user::clear_motion(m.map(), m.name(k)); }
  template <class M = Map, class = std::enable_if_t<detail::inertial_has_v<M, detail::inertial_join_member>>>
  static void join_samples(map_mirror<M>& m, keyframe removed, keyframe after) {
    user::join_samples(m.map(), m.name(removed), m.name(after));
  }
  template <class M = Map, class = std::enable_if_t<detail::inertial_has_v<M, detail::inertial_bias_member>>>
  static void bias_changed(map_mirror<M>& m, keyframe k, const imu_bias<double>& bias) {
    user::bias_changed(m.map(), m.name(k), bias);
  }
  /// @}
};

}  // namespace turbomap

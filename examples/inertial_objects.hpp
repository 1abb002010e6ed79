// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The system of object_graph.hpp with an IMU: its keyframes know those before and after them in time, a velocity, biases, and
/// what the IMU measured since the one before. Below them what the library asks for beside the traits of object_graph.hpp. Locks
/// are as there: what is written here holds the lock of the map, the guard, and that of the keyframe.

#include <array>
#include <deque>
#include <optional>
#include <turbomap/inertial/preintegration.hpp>
#include <turbomap/map/inertial_traits.hpp>

#include "object_graph.hpp"

// ---- The system. ----------------------------------------------------------------------------------------------------
namespace my {

struct InertialKeyFrame : KeyFrame {
  double time = 0;  // s
  InertialKeyFrame *previous = nullptr, *next = nullptr;
  std::array<double, 3> velocity{}, gyro_bias{}, acceleration_bias{};  // m/s, rad/s, m/s^2
  std::optional<turbomap::preintegration<double>> measured;            // since `previous`
};

struct InertialMap : Map {
  std::deque<InertialKeyFrame> inertial_keyframes;  // instead of Map::keyframes
  bool imu_initialised = false;
  std::array<double, 3> gravity{0, 9.81, 0};  // m/s^2: the first camera looks ahead, its v points down
};

}  // namespace my

// ---- How to read and change the map: as before, and in time. --------------------------------------------------------
template <>
struct turbomap::map_traits<my::InertialMap> : turbomap::map_traits<my::Map> {
  static const my::InertialKeyFrame* of(keyframe k) { return static_cast<const my::InertialKeyFrame*>(k); }
  static my::InertialKeyFrame* change(keyframe k) { return static_cast<my::InertialKeyFrame*>(k); }

  static double time(const my::Map&, keyframe k) { return of(k)->time; }
  static keyframe previous(const my::Map&, keyframe k) { return of(k)->previous; }
  static keyframe next(const my::Map&, keyframe k) { return of(k)->next; }
  static void erase_keyframe(my::Map& m, keyframe k) {
    my::InertialKeyFrame *const before = of(k)->previous, *const after = of(k)->next;
    if (before != nullptr) {
      const lock held(before->mutex);  // one object at a time
      before->next = after;
    }
    if (after != nullptr) {
      const lock held(after->mutex);
      after->previous = before;
    }
    turbomap::map_traits<my::Map>::erase_keyframe(m, k);
  }
  template <class F>
  static void for_each_keyframe(const my::InertialMap& m, F f) {
    for (const auto& k : m.inertial_keyframes)
      if (!k.bad) f(const_cast<my::InertialKeyFrame*>(&k));
  }
};

// ---- What the IMU told: docs/inertial.md. ---------------------------------------------------------------------------
template <>
struct turbomap::inertial_traits<my::InertialMap> {
  using map = my::InertialMap;
  using keyframe = my::KeyFrame*;
  using traits = turbomap::map_traits<map>;
  using vector = turbomap::vec3<double>;

  static bool initialised(const map& m) { return m.imu_initialised; }
  static vector gravity(const map& m) { return read(m.gravity); }
  static turbomap::rigid_transform<double> T_bc(const map&) { return {}; }  // the IMU sits in the camera
  static vector velocity(const map&, keyframe k) { return read(traits::of(k)->velocity); }
  static turbomap::imu_bias<double> bias(const map&, keyframe k) {
    return {read(traits::of(k)->gyro_bias), read(traits::of(k)->acceleration_bias)};
  }
  static bool motion(const map&, keyframe k, turbomap::preintegration<double>& motion) {
    if (!traits::of(k)->measured) return false;
    motion = *traits::of(k)->measured;
    return true;
  }
  static void set_velocity(map&, keyframe k, const vector& v) {
    const traits::lock held(k->mutex);
    traits::change(k)->velocity = {v.x, v.y, v.z};
  }
  static void set_bias(map&, keyframe k, const turbomap::imu_bias<double>& b) {
    const traits::lock held(k->mutex);
    traits::change(k)->gyro_bias = {b.gyro.x, b.gyro.y, b.gyro.z};
    traits::change(k)->acceleration_bias = {b.acceleration.x, b.acceleration.y, b.acceleration.z};
  }
  static void set_motion(map&, keyframe k, const turbomap::preintegration<double>& p) {
    const traits::lock held(k->mutex);
    traits::change(k)->measured = p;
  }
  static void clear_motion(map&, keyframe k) {
    const traits::lock held(k->mutex);
    traits::change(k)->measured.reset();
  }

 private:
  static vector read(const std::array<double, 3>& a) { return {a[0], a[1], a[2]}; }
};

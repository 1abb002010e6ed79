// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A map of objects (objects_map.hpp) with an IMU, and its inertial_traits: what a simple_inertial_map is beside a simple_map. The
/// two make the same map, with TURBOMAP_REPRODUCIBLE to the last bit.

#include <memory>
#include <optional>
#include <utility>

#include <turbomap/inertial/imu_history.hpp>
#include <turbomap/inertial/preintegration.hpp>
#include <turbomap/map/inertial_traits.hpp>
#include <turbomap/types.hpp>

#include "object_imu.hpp"
#include "objects_map.hpp"

namespace turbomap_program {

/// Gravity and what else is known of the IMU; what belongs to a keyframe is in the keyframe.
template <class Camera>
class inertial_objects_map : public objects_map<Camera> {
 public:
  using vector = turbomap::vec3<double>;
  using bias_type = object_imu::bias_type;
  using motion_type = object_imu::motion_type;
  using objects_map<Camera>::objects_map;

  /// \param T_bc  from the frame of the poses to the body, that of the IMU
  /// \param imu   with which samples are integrated again, when a bias has changed much
  void set_imu(const turbomap::rigid_transform<double>& T_bc, const turbomap::preintegration_options& imu) {
    T_bc_ = T_bc, imu_ = imu;
  }
  turbomap::rigid_transform<double> T_bc() const { return T_bc_; }
  const turbomap::preintegration_options& imu_options() const { return imu_; }
  vector gravity() const { return gravity_; }
  void set_gravity(const vector& gravity) { gravity_ = gravity; }
  bool initialised() const { return initialised_; }
  void set_initialised(bool initialised) { initialised_ = initialised; }
  bool refined() const { return refined_; }
  void set_refined(bool refined) { refined_ = refined; }

  vector velocity(const keyframe_ptr& k) const { return k->imu.velocity(); }
  void set_velocity(const keyframe_ptr& k, const vector& velocity) { k->imu.set_velocity(velocity); }
  bias_type bias(const keyframe_ptr& k) const { return k->imu.bias(); }
  void set_bias(const keyframe_ptr& k, const bias_type& bias) { k->imu.set_bias(bias); }
  std::optional<motion_type> motion(const keyframe_ptr& k) const { return k->imu.motion(); }
  void set_motion(const keyframe_ptr& k, const motion_type& motion, turbomap::imu_history samples = {}) {
    k->imu.set_motion(motion, std::move(samples));
  }

 private:
  turbomap::rigid_transform<double> T_bc_;
  turbomap::preintegration_options imu_;
  vector gravity_{0, 0, -9.81};
  bool initialised_ = false, refined_ = true;
};

}  // namespace turbomap_program

template <class Camera>
struct turbomap::map_traits<turbomap_program::inertial_objects_map<Camera>>
    : turbomap::map_traits<turbomap_program::objects_map<Camera>> {};

template <class Camera>
struct turbomap::inertial_traits<turbomap_program::inertial_objects_map<Camera>> {
  using map = turbomap_program::inertial_objects_map<Camera>;
  using kf = const turbomap_program::keyframe_ptr&;
  using vector = turbomap::vec3<double>;

  static bool initialised(const map& m) { return m.initialised(); }
  static bool refined(const map& m) { return m.refined(); }
  static vector gravity(const map& m) { return m.gravity(); }
  static turbomap::rigid_transform<double> T_bc(const map& m) { return m.T_bc(); }
  static vector velocity(const map&, kf k) { return k->imu.velocity(); }
  static turbomap::imu_bias<double> bias(const map&, kf k) { return k->imu.bias(); }
  static bool motion(const map&, kf k, turbomap::preintegration<double>& motion) {
    const auto known = k->imu.motion();
    if (known) motion = *known;
    return known.has_value();
  }
  static void set_velocity(map&, kf k, const vector& velocity) { k->imu.set_velocity(velocity); }
  static void set_bias(map&, kf k, const turbomap::imu_bias<double>& bias) { k->imu.set_bias(bias); }
  static void set_motion(map&, kf k, const turbomap::preintegration<double>& motion) { k->imu.set_motion(motion); }
  static void clear_motion(map&, kf k) { k->imu.clear_motion(); }
  static void set_gravity(map& m, const vector& gravity) { m.set_gravity(gravity); }
  static void set_initialised(map& m, bool initialised) { m.set_initialised(initialised); }
  static void join_samples(map&, kf removed, kf after) { after->imu.join_samples(removed->imu.take_samples()); }
  static void bias_changed(map& m, kf k, const turbomap::imu_bias<double>& bias) {
    k->imu.integrate_again(bias, m.imu_options());
  }
};

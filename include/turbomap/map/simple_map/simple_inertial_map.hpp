// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A simple_map that also holds what an IMU told: velocities, biases, the motion from each keyframe to the next, gravity. Whoever
/// estimated them first, an initialisation or the user, sets them here; the inertial stages read and change them.

#include <cstddef>
#include <stdexcept>
#include <utility>
#include <vector>

#include "../../config.hpp"
#include "../../error.hpp"
#include "../../inertial/bias_update.hpp"
#include "../../inertial/imu_history.hpp"
#include "../../inertial/preintegration.hpp"
#include "../../math/rotation.hpp"
#include "../../plain_vector.hpp"
#include "../inertial_traits.hpp"
#include "simple_map.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Used as a simple_map, with its guarantees and errors.
template <class Descriptor, class Camera>
class simple_inertial_map : public simple_map<Descriptor, Camera> {
 public:
  /// \param T_bc  from the frame of the poses to the body, that of the IMU
  /// \param imu   with which samples are integrated again, when a bias has changed much
  explicit simple_inertial_map(int levels = pyramid{}.levels, const rigid_transform<double>& T_bc = {},
                               const preintegration_options& imu = {})
      : simple_map<Descriptor, Camera>(levels) {
    set_imu(T_bc, imu);
  }
  /// As the constructor sets them. Throws std::invalid_argument, with nothing changed, for a T_bc that is no pose, or options that
  /// preintegrate() refuses.
  void set_imu(const rigid_transform<double>& T_bc, const preintegration_options& imu) {
    require(is_pose(T_bc), "T_bc", T_bc.qw, "must be finite, with a quaternion of unit length (qw is given)");
    detail::check_preintegration_options(imu);
    T_bc_ = T_bc, imu_ = imu;
  }

  /// That of simple_map, with room for what the IMU tells of the keyframe: to set it then needs no memory. A keyframe that was
  /// added to the map as a simple_map has no such room.
  map_keyframe_id add_keyframe(span<const keypoint> keypoints, rigid_transform<double> T_cw, double time_s = 0,
                               map_keyframe_id previous = {}) {
    make_room(entries_, entries_.size() + 1);
    const map_keyframe_id k = simple_map<Descriptor, Camera>::add_keyframe(keypoints, T_cw, time_s, previous);
    make(k);
    return k;
  }

  /// From the frame of the poses to the body, that of the IMU.
  const rigid_transform<double>& T_bc() const { return T_bc_; }
  /// In the world, m/s^2.
  const vec3<double>& gravity() const { return gravity_; }
  /// In the world, m/s^2. Not checked.
  void set_gravity(const vec3<double>& gravity) { gravity_ = gravity; }
  /// Gravity, and the velocities and biases of the keyframes, are known.
  bool initialised() const { return initialised_; }
  /// Whether gravity, velocities and biases are known from now on.
  void set_initialised(bool initialised) { initialised_ = initialised; }
  /// They are no longer young. Who initialises this map by the library sets false before, true after the second refinement.
  bool refined() const { return refined_; }
  /// Whether they are no longer young.
  void set_refined(bool refined) { refined_ = refined; }

  /// Of the IMU in the world, m/s. 0 until it is set.
  const vec3<double>& velocity(map_keyframe_id k) const { return at(k).velocity; }
  /// Of the IMU in the world, m/s. By value, as below: it may be one of this map's, whose list may grow here.
  void set_velocity(map_keyframe_id k, vec3<double> velocity) { make(k).velocity = velocity; }
  /// Of the IMU at the keyframe, rad/s and m/s^2. 0 until it is set.
  const imu_bias<double>& bias(map_keyframe_id k) const { return at(k).bias; }
  /// Of the IMU at the keyframe, rad/s and m/s^2.
  void set_bias(map_keyframe_id k, imu_bias<double> bias) { make(k).bias = bias; }
  /// From the keyframe before in time; null where it is not known.
  const preintegration<double>* motion(map_keyframe_id k) const { return at(k).has_motion ? &at(k).motion : nullptr; }
  /// \param samples  what was integrated, so that it can be integrated again; none: motions are corrected to first order
  // Samples are moved from. NOLINTNEXTLINE(performance-unnecessary-value-param)
  void set_motion(map_keyframe_id k, preintegration<double> motion, imu_history samples = {}) {
    auto& entry = make(k);
    entry.motion = motion, entry.has_motion = true, entry.samples = std::move(samples);
  }
  /// The motion from the keyframe before is no longer known, nor its samples.
  void clear_motion(map_keyframe_id k) { make(k).has_motion = false, make(k).samples = {}; }
  /// What the motion was integrated from; empty where that is not kept.
  const imu_history& samples(map_keyframe_id k) const { return at(k).samples; }

 private:
  friend struct inertial_traits<simple_inertial_map>;
  struct entry {
    map_keyframe_id owner;
    vec3<double> velocity{0, 0, 0};
    imu_bias<double> bias;
    bool has_motion = false;
    preintegration<double> motion;
    imu_history samples;
  };

  /// The entry of a keyframe; of one that has none yet, an empty one.
  const entry& at(map_keyframe_id k) const {
    static const entry none{};
    this->T_cw(k);  // throws when it is not in the map
    const auto i = static_cast<std::size_t>(k.index);
    return i < entries_.size() && entries_[i].owner == k ? entries_[i] : none;
  }
  entry& make(map_keyframe_id k) {
    this->T_cw(k);
    const auto i = static_cast<std::size_t>(k.index);
    if (i >= entries_.size()) entries_.resize(i + 1);
    if (entries_[i].owner != k) entries_[i] = {}, entries_[i].owner = k;
    return entries_[i];
  }

  rigid_transform<double> T_bc_;
  preintegration_options imu_;
  vec3<double> gravity_{0, 0, -9.81};
  bool initialised_ = false, refined_ = true;
  std::vector<entry> entries_;  ///< by the keyframe's index
};

TURBOMAP_END_NAMESPACE

namespace turbomap {

template <class Descriptor, class Camera>
struct map_traits<simple_inertial_map<Descriptor, Camera>> : map_traits<simple_map<Descriptor, Camera>> {};

/// A simple_inertial_map as the inertial stages see it. Ids are checked: throws std::invalid_argument where the map does.
template <class Descriptor, class Camera>
struct inertial_traits<simple_inertial_map<Descriptor, Camera>> {
  /// @{
  /// As the member of this name of inertial_traits (map/inertial_traits.hpp).
  using map = simple_inertial_map<Descriptor, Camera>;
  using keyframe = map_keyframe_id;

  static bool initialised(const map& m) { return m.initialised(); }
  static bool refined(const map& m) { return m.refined(); }
  static const vec3<double>& gravity(const map& m) { return m.gravity(); }
  static const rigid_transform<double>& T_bc(const map& m) { return m.T_bc(); }
  static const vec3<double>& velocity(const map& m, keyframe k) { return m.velocity(k); }
  static const imu_bias<double>& bias(const map& m, keyframe k) { return m.bias(k); }
  static bool motion(const map& m, keyframe k, preintegration<double>& motion) {
    const auto* known = m.motion(k);
    if (known != nullptr) motion = *known;
    return known != nullptr;
  }
  static void set_velocity(map& m, keyframe k, const vec3<double>& velocity) { m.set_velocity(k, velocity); }
  static void set_bias(map& m, keyframe k, const imu_bias<double>& bias) { m.set_bias(k, bias); }
  static void set_motion(map& m, keyframe k, preintegration<double> motion) {  // by value: the list of the map may grow
    auto& entry = m.make(k);
    entry.motion = motion, entry.has_motion = true;
  }
  static void clear_motion(map& m, keyframe k) { m.clear_motion(k); }
  static void set_gravity(map& m, const vec3<double>& gravity) { m.set_gravity(gravity); }
  static void set_initialised(map& m, bool initialised) { m.set_initialised(initialised); }
  /// Without the samples of both, the motion can no longer be integrated again.
  static void join_samples(map& m, keyframe removed, keyframe after) {
    if (m.motion(after) == nullptr) return;
    imu_history& own = m.make(after).samples;  // is there: no memory is needed
    try {
      if (m.samples(removed).pieces.empty() || own.pieces.empty()) throw std::invalid_argument("no samples");
      imu_history& joined = m.make(removed).samples;
      append(joined, own);
      own = std::move(joined);
    } catch (const std::exception&) {  // no memory, or a hole between the two
      own = {};
    }
  }
  static void bias_changed(map& m, keyframe k, const imu_bias<double>& bias) {
    const auto* known = m.motion(k);
    if (known == nullptr || m.samples(k).pieces.empty() || !needs_integration(*known, bias, m.imu_)) return;
    try {
      m.make(k).motion = preintegrate(m.samples(k), bias, m.imu_);
    } catch (const std::exception&) {  // no memory: corrected to first order, as before
    }
  }
  /// @}
};

}  // namespace turbomap

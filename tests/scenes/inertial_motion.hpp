// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The IMU of a simulated world (mapping_scene.hpp): what one without errors measures on the way of the camera, and the runs of
/// local mapping that hear of it.

#include <turbomap/inertial/preintegrate.hpp>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/simple_map/simple_inertial_map.hpp>
#include <turbomap/mapping/inertial_adjustment.hpp>
#include <turbomap/math/rotation.hpp>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "mapping_scene.hpp"

namespace turbomap_test {

inline constexpr double step_s = 0.2;  // of a mapping_run

/// The map of these runs.
using mapped_inertial = turbomap::simple_inertial_map<turbomap::binary_descriptor<256>, pinhole_camera>;

inline mapping_recipe noisy_recipe() {
  mapping_recipe recipe;
  recipe.pixel_noise = 0.4;
  return recipe;
}

/// What an IMU without errors measures on the way of a scene, which it follows in steps of constant acceleration.
struct true_motion {
  const mapping_scene<pinhole_camera>& scene;
  turbomap::vec3<double> gravity{0, 9.81, 0};

  turbomap::isometry<double> body(int n) const {
    return turbomap::inverse(turbomap::to_isometry<double>(scene.pose(n)));
  }
  turbomap::vec3<double> velocity(int n) const {
    using turbomap::operator*;
    return (0.5 / step_s) * (body(n + 1).t - body(n - 1).t);
  }
  turbomap::preintegration<double> between(int i, int j) const {
    using turbomap::operator*;
    const double dt = step_s * (j - i);
    std::vector<std::int64_t> t;
    std::vector<turbomap::imu_sample> rest;
    for (int k = 0; k <= 40 * (j - i); ++k) t.push_back(k * 5'000'000LL), rest.push_back({{0, 0, 0}, {0, 0, 9.81}});
    const turbomap::imu_samples samples{t, rest};
    auto p = turbomap::preintegrate(samples, turbomap::find_interval(samples, 0, t.back()),
                                    turbomap::imu_bias<double>{}, {});
    const auto a = body(i), b = body(j);
    const auto R = turbomap::transpose(a.R);
    p.dt = dt, p.dR = R * b.R, p.dV = R * (velocity(j) - velocity(i) - dt * gravity);
    p.dP = R * (b.t - a.t - dt * velocity(i) - 0.5 * dt * dt * gravity);
    return p;
  }
};

/// For a stereo pair with an IMU. Keyframes are culled soon, so that motions are merged.
inline turbomap::local_mapper_options culled_inertial_options(const mapping_recipe& recipe) {
  auto o = turbomap::local_mapper_options::stereo_inertial(0.11, 6, recipe.scales);
  o.keyframe_culling.redundant_share = 0.02F, o.keyframe_culling.observers = 1;
  o.keyframe_culling.keep_keyframes = 8, o.keyframe_culling.max_gap = 0.45, o.keyframe_culling.max_old_gap = 1.05;
  return o;
}

/// The next keyframe, with what its IMU measured since the one before.
template <class Run>
typename Run::keyframe track(Run& run, const true_motion& motion) {
  const auto k = run.track();
  const int n = static_cast<int>(run.keyframes().size()) - 1;
  run.map.set_velocity(k, motion.velocity(n));
  if (n > 0) run.map.set_motion(k, motion.between(n - 1, n));
  return k;
}

template <class Map, class Policy, class Methods = turbomap::adjustment_methods<>>
using inertial_mapping = mapping_run<Map, Policy, turbomap::inertial_adjustment<Map, Policy, Methods>>;

/// Local mapping on maps of two types that are told the same. The IMU is initialised at keyframe 5, refined at keyframe 15.
template <class First, class Second, class Policy>
class twin_inertial_mapping {
 public:
  explicit twin_inertial_mapping(
      const turbomap::local_mapper_options& options = culled_inertial_options(noisy_recipe()))
      : first_(scene_, options), second_(scene_, options) {}

  const First& first() const { return first_.map; }
  const Second& second() const { return second_.map; }

  /// One more keyframe for each.
  void step() { step(first_), step(second_), ++keyframes_; }

  /// Of both, so far.
  std::size_t culled = 0, adjusted = 0, healed = 0, refused = 0;

 private:
  template <class Run>
  void step(Run& run) {
    run.map.set_gravity(motion_.gravity);
    const auto k = track(run, motion_);
    run.map.set_initialised(keyframes_ >= 5), run.map.set_refined(keyframes_ >= 15);
    const auto& report = run.mapper.process(k);
    culled += report.keyframes_culled.size();
    adjusted += report.adjustment.inertial && report.adjustment.solve.accepted > 0 ? 1 : 0;
    healed += report.healed, refused += report.refused.size();
    run.note();
  }
  const mapping_scene<pinhole_camera> scene_{pinhole_rig(50), noisy_recipe()};
  const true_motion motion_{scene_};
  inertial_mapping<First, Policy> first_;
  inertial_mapping<Second, Policy> second_;
  int keyframes_ = 0;
};

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A small map with an IMU and its truth, and what one inertial adjustment leaves of it.

#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/inertial/predict.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/simple_map/simple_inertial_map.hpp>
#include <turbomap/mapping/inertial_adjustment.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "inertial/preintegration_cases.hpp"

namespace turbomap_test {

using inertial_pinhole = turbomap::pinhole<float>;
using inertial_map = turbomap::simple_inertial_map<turbomap::binary_descriptor<256>, inertial_pinhole>;
using inertial_map_traits = turbomap::map_traits<inertial_map>;

struct inertial_recipe {
  int keyframes = 14, points_per_keyframe = 20;
  unsigned seed = 1;
  double pixel_noise = 0.5, outliers = 0;
  int begins_anew = 0;                 ///< the keyframe that none comes before, as after tracking was lost
  std::int64_t step_ns = 250'000'000;  ///< between keyframes
};

/// Keyframes, every 0.25 s if not told otherwise, on a lively motion; each has points before it, which the others see where they
/// can. Velocities and biases of the map are a little off, poses and points too.
struct inertial_map_scene {
  using keyframe = turbomap::map_keyframe_id;
  using point = turbomap::map_point_id;
  std::int64_t step_ns;

  std::vector<turbomap::rig_camera<inertial_pinhole>> rig{{{435, 436, 367, 252}, {}, 47.9, {}}};
  imu_motion imu;
  std::int64_t begin_ns = 0;
  std::vector<turbomap::inertial_state<double>> truth;
  std::vector<vec3<double>> true_points;
  inertial_map map;
  std::vector<keyframe> keyframes;
  std::vector<point> points;

  /// The samples from keyframe i to keyframe j.
  turbomap::imu_history samples_between(int i, int j) const {
    turbomap::imu_history h;
    const auto in = turbomap::find_interval(imu.samples(), begin_ns + i * step_ns, begin_ns + j * step_ns);
    for (int k = in.first; k <= in.last; ++k)
      h.t_ns.push_back(imu.t_ns[static_cast<std::size_t>(k)]),
          h.sample.push_back(imu.sample[static_cast<std::size_t>(k)]);
    h.pieces.push_back({in.begin_ns, in.end_ns, 0, in.last - in.first});
    return h;
  }

  explicit inertial_map_scene(const inertial_recipe& r = {})
      : step_ns(r.step_ns), imu(make_imu_motion(r.seed, 60 * r.keyframes, 0)), map(8, body_pose(r.seed)) {
    using turbomap::operator*;
    using turbomap::operator+;
    std::mt19937_64 random(r.seed + 1000);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform(-1, 1);
    const imu_bias<double> bias{random_vector(random, 0.02), random_vector(random, 0.1)};
    begin_ns = imu.t_ns[3];
    turbomap::inertial_state<double> x;
    x.T_cw = turbomap::to_rigid_transform(
        turbomap::isometry<double>{turbomap::rotation_exp(random_vector(random, 2)), random_vector(random, 1)});
    x.velocity = random_vector(random, 1), x.bias = bias;
    const auto T_bc = turbomap::to_isometry<double>(map.T_bc());
    for (int f = 0; f < r.keyframes; ++f) {
      truth.push_back(x);
      if (f + 1 < r.keyframes)
        x = turbomap::predict(x, turbomap::preintegrate(samples_between(f, f + 1), bias, {}), map.gravity(), T_bc);
    }
    for (int f = 0; f < r.keyframes; ++f)
      for (int i = 0; i < r.points_per_keyframe; ++i) {
        const double z = 5 + 2 * uniform(random), px = 300 * uniform(random), py = 200 * uniform(random);
        true_points.push_back(
            turbomap::inverse(turbomap::to_isometry<double>(truth[static_cast<std::size_t>(f)].T_cw)) *
            vec3<double>{z * px / 435, z * py / 436, z});
        points.push_back(map.add_point(true_points.back() + 0.03 * random_vector(random, 1)));
      }
    for (int f = 0; f < r.keyframes; ++f) {
      const auto& T = truth[static_cast<std::size_t>(f)];
      std::vector<turbomap::keypoint> keypoints;
      std::vector<std::size_t> seen;
      for (std::size_t l = 0; l < true_points.size(); ++l) {
        const auto p = turbomap::to_isometry<double>(T.T_cw) * true_points[l];
        const double u = 435 * p.x / p.z + 367, v = 436 * p.y / p.z + 252;
        if (p.z < 1 || std::abs(u - 367) > 360 || std::abs(v - 252) > 240) continue;
        turbomap::keypoint k;
        const bool off = std::abs(uniform(random)) < r.outliers;
        k.x = static_cast<float>(u + r.pixel_noise * normal(random) + (off ? 60 : 0));
        k.y = static_cast<float>(v + r.pixel_noise * normal(random));
        if ((l + static_cast<std::size_t>(f)) % 3 != 0)
          k.u_right = static_cast<float>(u - 47.9 / p.z + r.pixel_noise * normal(random));
        keypoints.push_back(k), seen.push_back(l);
      }
      double error[15];
      for (int i = 0; i < 15; ++i) error[i] = (i < 6 ? 0.01 : i < 9 ? 0.05 : i < 12 ? 1e-3 : 0.02) * normal(random);
      const auto start = f == 0 ? T : turbomap::move_state(error, T);
      const auto k = map.add_keyframe(keypoints, start.T_cw, 1e-9 * static_cast<double>(f * step_ns),
                                      f == 0 || f == r.begins_anew ? keyframe{} : keyframes.back());
      keyframes.push_back(k);
      map.set_velocity(k, start.velocity), map.set_bias(k, start.bias);
      if (f > 0) {
        // Integrated where the bias was believed to be: corrected to first order.
        const imu_bias<double> believed{bias.gyro + random_vector(random, 1e-3), bias.acceleration};
        const auto history = samples_between(f - 1, f);
        map.set_motion(k, turbomap::preintegrate(history, believed, {}), history);
      }
      for (std::size_t i = 0; i < seen.size(); ++i) turbomap::observe(map, points[seen[i]], k, i);
    }
    map.set_initialised(true);
  }

  /// Everything that an adjustment may change, to the last bit.
  std::string state() const {
    std::string bytes;
    const auto put = [&bytes](const auto& value) {
      char raw[sizeof value];
      std::memcpy(raw, &value, sizeof value);
      bytes.append(raw, sizeof value);
    };
    for (const auto& k : keyframes) {
      put(map.alive(k));
      if (!map.alive(k)) continue;
      put(map.T_cw(k)), put(map.velocity(k)), put(map.bias(k));
      if (map.motion(k) != nullptr) put(*map.motion(k));
      for (std::size_t i = 0; i < map.keypoints(k).size(); ++i) {
        const point p = map.point_at(k, i);
        put(p == point{} ? ~std::uint64_t{0} : inertial_map_traits::id(map, p));
      }
    }
    for (const auto& p : points) {
      put(map.alive(p));
      if (map.alive(p)) put(map.position(p));
    }
    return bytes;
  }
  /// Root mean square distance of camera centres to the truth, of keyframes [first, end).
  double position_error(int first, int end) const {
    double sum = 0;
    for (int f = first; f < end; ++f) {
      const auto i = static_cast<std::size_t>(f);
      const auto d = turbomap::camera_centre(turbomap::to_isometry<double>(map.T_cw(keyframes[i]))) -
                     turbomap::camera_centre(turbomap::to_isometry<double>(truth[i].T_cw));
      sum += turbomap::dot(d, d);
    }
    return std::sqrt(sum / (end - first));
  }
  double velocity_error(int first, int end) const {
    double sum = 0;
    for (int f = first; f < end; ++f) {
      const auto i = static_cast<std::size_t>(f);
      const auto d = map.velocity(keyframes[i]) - truth[i].velocity;
      sum += turbomap::dot(d, d);
    }
    return std::sqrt(sum / (end - first));
  }

 private:
  static turbomap::rigid_transform<double> body_pose(unsigned seed) {
    std::mt19937_64 random(seed + 2000);
    const auto turn = random_vector(random, 2);
    return turbomap::to_rigid_transform(
        turbomap::isometry<double>{turbomap::rotation_exp(turn), random_vector(random, 0.1)});
  }
};

/// A context, a store with all live keyframes of a scene, and the stage.
template <class Policy>
struct inertial_run {
  using adjustment = turbomap::inertial_adjustment<inertial_map, Policy, turbomap::every_adjustment_method>;

  inertial_map_scene& scene;
  turbomap::context<Policy> ctx;
  turbomap::store_of<inertial_map, Policy> store;
  turbomap::handle_table stored;
  turbomap::guard_times held;
  adjustment adjust{ctx};

  inertial_run(const Policy& policy, inertial_map_scene& scene) : scene(scene), ctx(policy) {
    for (const auto& k : scene.keyframes) {
      if (!scene.map.alive(k)) continue;
      const auto keypoints = scene.map.keypoints(k);
      const std::vector<std::uint8_t> descriptors(32 * keypoints.size());
      turbomap::keyframe_data<turbomap::binary_descriptor<256>, inertial_pinhole> data;
      data.keypoint_count = static_cast<int>(keypoints.size());
      data.keypoints = keypoints.data(), data.descriptors = descriptors.data();
      data.cameras = scene.rig.data(), data.camera_count = 1;
      data.bounds = {-100, -100, 900, 700};
      stored.add(inertial_map_traits::id(scene.map, k), store.insert(data));
    }
  }
  turbomap::mapping_scope<inertial_map, Policy> scope(turbomap::fault_sink faults = {}) {
    return {ctx, scene.map, store, stored, held, faults};
  }
  turbomap::local_adjustment_summary operator()(int current, const turbomap::local_adjustment_options& options = {},
                                                const turbomap::inertial_adjustment_options& inertial = {},
                                                turbomap::fault_sink faults = {}) {
    return adjust(scope(faults), scene.keyframes[static_cast<std::size_t>(current)], options, inertial);
  }
};

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Local mapping with an IMU in a system of its own classes (inertial_objects.hpp). The system brings the first states: it knows
/// down, has measured the gyroscope's bias at rest, and takes velocities from the way so far. Mapping finds the true ones, and the
/// bias of the accelerometer. Images, IMU and tracking are simulated.

#include <thrust/execution_policy.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <turbomap/inertial/imu_integrator.hpp>
#include <turbomap/inertial/predict.hpp>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/inertial_adjustment.hpp>
#include <type_traits>
#include <vector>

#include "inertial_objects.hpp"
#include "wall_scene.hpp"

namespace {

using vector = turbomap::vec3<double>;
const turbomap::imu_bias<double> true_bias{{0.01, -0.02, 0.005}, {0.05, 0.1, -0.05}};
constexpr std::int64_t frame_ns = 200'000'000, sample_ns = 5'000'000;

/// The camera slides along the wall, faster and slower, up and down.
vector position(double t) { return {1.4 * t + 0.1 * std::sin(3 * t), 0.1 * std::sin(4 * t), 0}; }
vector velocity(double t) { return {1.4 + 0.3 * std::cos(3 * t), 0.4 * std::cos(4 * t), 0}; }
turbomap::imu_sample measure(double t) {
  const vector gravity{0, 9.81, 0}, acceleration{-0.9 * std::sin(3 * t), -1.6 * std::sin(4 * t), 0};
  return {true_bias.gyro, acceleration - gravity + true_bias.acceleration};
}

}  // namespace

int main() {
  using map_type = my::InertialMap;
  using inertial = turbomap::inertial_traits<map_type>;
  using policy = std::decay_t<decltype(thrust::host)>;
  example::wall_scene scene;

  turbomap::context<policy> ctx(thrust::host);
  map_type map;
  turbomap::keyframe_store<example::orb, example::camera> store;
  // The inertial mode of the mapper: named by the type of its adjustment.
  turbomap::local_mapper<map_type, policy, turbomap::inertial_adjustment<map_type, policy>> mapper(
      ctx, map, store, turbomap::local_mapper_options::stereo_inertial(example::baseline, example::close_depth));
  mapper.options().keyframe_culling.keep_keyframes = 8;  // a short run

  turbomap::imu_integrator<double> imu;
  std::map<int, my::MapPoint*> last_seen;  // landmark -> its point in the keyframe before
  std::size_t culled = 0, edges = 0;
  std::int64_t sampled_ns = -sample_ns;
  my::InertialKeyFrame* before = nullptr;
  for (int n = 0; n < 24; ++n) {
    const std::int64_t now_ns = n * frame_ns;
    const double t = 1e-9 * static_cast<double>(now_ns);
    for (; sampled_ns <= now_ns; sampled_ns += sample_ns)
      imu.push(sampled_ns, measure(1e-9 * static_cast<double>(sampled_ns)));

    // Tracking makes a keyframe: what it sees...
    const example::wall_view view = scene.look_from(position(t).x, position(t).y);
    auto& k = map.inertial_keyframes.emplace_back();
    k.id = static_cast<std::uint64_t>(n), k.time = t;
    k.T_cw.t = {view.T_cw.tx, view.T_cw.ty, view.T_cw.tz};
    k.truth = view.landmark, k.points.resize(view.keypoints.size());
    for (std::size_t i = 0; i < view.keypoints.size(); ++i) {
      const auto& z = view.keypoints[i];
      my::Feature f{z.x, z.y, z.u_right, z.depth, z.octave, {}};
      std::copy_n(view.descriptors.begin() + static_cast<std::ptrdiff_t>(32 * i), 32, f.descriptor.begin());
      k.features.push_back(f);
      if (n == 0) {
        const auto x = example::back_project(view, i);
        turbomap::observe(map, turbomap::map_traits<map_type>::add_point(map, x, &k), &k, i);
      } else if (const auto seen = last_seen.find(view.landmark[i]); seen != last_seen.end() && (i + n) % 4 != 0) {
        auto* const point = turbomap::resolve(map, seen->second);
        if (point != nullptr) turbomap::observe(map, point, &k, i);
      }
    }
    // ...and what the IMU says: the motion since the keyframe before, and where that leads.
    if (before != nullptr) {
      k.previous = before, before->next = &k;
      k.measured = imu.advance(now_ns);
      const turbomap::inertial_state<double> from{turbomap::map_traits<map_type>::pose(map, before),
                                                  inertial::velocity(map, before), inertial::bias(map, before)};
      const auto to = turbomap::predict(from, *k.measured, inertial::gravity(map));
      inertial::set_velocity(map, &k, to.velocity), inertial::set_bias(map, &k, from.bias);
    }
    imu.restart(now_ns);
    if (n == 6) {  // enough of the way is known: the system's own initialisation
      for (auto& each : map.inertial_keyframes) {
        const auto* a = each.previous != nullptr ? each.previous : &each;
        const auto* b = each.next != nullptr ? each.next : &each;
        for (std::size_t i = 0; i < 3; ++i) each.velocity[i] = -(b->T_cw.t[i] - a->T_cw.t[i]) / (b->time - a->time);
        each.gyro_bias = {0.0102, -0.0201, 0.0049};
      }
      map.imu_initialised = true;
    }

    // Local mapping.
    mapper.insert(&k, static_cast<const my::KeyFrame&>(k));
    const turbomap::mapping_report& report = mapper.process(&k);
    k.waiting = false;
    imu.set_bias(inertial::bias(map, &k));  // tracking goes on with what mapping found
    culled += report.keyframes_culled.size(), edges += report.adjustment.inertial_edges;
    const auto off = inertial::velocity(map, &k) - velocity(t);
    std::printf("keyframe %2d: %zu inertial edges, %zu keyframes culled, velocity off by %.3f m/s, %.1f ms\n", n,
                report.adjustment.inertial_edges, report.keyframes_culled.size(), turbomap::norm(off), report.total_ms);

    last_seen.clear();
    for (std::size_t i = 0; i < k.points.size(); ++i)
      if (k.points[i] != nullptr) last_seen[view.landmark[i]] = k.points[i];
    before = &k;
  }

  const auto bias = inertial::bias(map, before);
  const double gyro = turbomap::norm(bias.gyro - true_bias.gyro);
  const double acceleration = turbomap::norm(bias.acceleration - true_bias.acceleration);
  const double speed = turbomap::norm(inertial::velocity(map, before) - velocity(before->time));
  bool whole = true;  // what was culled is in the motions of those that are left
  for (const my::InertialKeyFrame* k = before; k->previous != nullptr; k = k->previous)
    whole = whole && k->measured && std::abs(k->measured->dt - (k->time - k->previous->time)) < 1e-6;
  std::printf("%zu keyframes culled; off by: gyroscope %.4f rad/s, accelerometer %.3f m/s^2, velocity %.3f m/s\n",
              culled, gyro, acceleration, speed);
  const bool right = gyro < 0.003 && acceleration < 0.05 && speed < 0.03 && whole && edges > 0 && culled > 0;
  return turbomap::validate(map).empty() && right ? 0 : 1;
}

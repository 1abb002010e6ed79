// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A simulated recording of local mapping, with the truth: scene, motion, keypoints, tracking, drift, inertial data.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <turbomap/error.hpp>
#include <turbomap/io/recording_writer.hpp>

#include "descriptors.hpp"
#include "inertial_sensor.hpp"
#include "motion.hpp"
#include "observer.hpp"
#include "rig.hpp"
#include "scene.hpp"
#include "tracker.hpp"

namespace turbomap::simulation {

struct simulation_options {
  std::uint64_t seed = 1;
  std::size_t points = 0;  ///< scene points; 0: so many that an image shows `density` times its keypoints
  double density = 1.5;
  bool imu = false;  ///< inertial data
  /// The IMU of the recorded system was initialised from the start: the recording's world has gravity along -z, and its
  /// keyframes have velocities and biases (the true ones). False: never; as in a visual recording, the world is the first
  /// keyframe's camera frame, without stereo in a unit of its own.
  bool imu_initialised = true;
  /// Length of that unit, m: a system of one camera does not know it while its IMU is not initialised. As long as the mean depth
  /// in the room.
  double monocular_unit = 2.5;
  motion_options motion;
  scene_options scene;
  descriptor_options descriptors;
  observation_options observation;
  tracking_options tracking;
};

inline rigid_transform<float> to_float(const Eigen::Isometry3d& T) {
  const Eigen::Quaternionf q = Eigen::Quaterniond(T.linear()).normalized().cast<float>();
  const Eigen::Vector3f t = T.translation().cast<float>();
  return {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
}
inline vec3<float> to_float(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

/// The meta of a recording with this rig.
inline recording_meta make_meta(const simulated_rig& rig, const simulation_options& options) {
  recording_meta m;
  const simulated_camera& left = rig.cameras[0];
  m.sensor = options.imu ? "inertial" : rig.baseline > 0 ? "stereo" : "monocular";
  m.model = left.is_fisheye() ? "KannalaBrandt8" : "Pinhole";
  m.width = left.width, m.height = left.height;
  m.keypoint_pixels = "full_image";
  m.camera1 = left.parameters();
  m.T_bc = to_float(left.T_bc);
  if (rig.cameras.size() == 2) {
    m.camera2 = rig.cameras[1].parameters();
    m.T_lr = to_float(left.T_bc.inverse() * rig.cameras[1].T_bc);
    m.T_rl = to_float(rig.cameras[1].T_bc.inverse() * left.T_bc);
  }
  m.baseline = rig.baseline, m.bf = rig.baseline * rig.focal(), m.close_depth = rig.close_depth;
  m.noise_px = rig.noise_px;
  if (rig.rectified()) m.disparity_noise_px = rig.disparity_noise_px;
  m.levels = options.observation.levels;
  m.scale_factor = static_cast<float>(options.observation.scale_factor);
  m.log_scale_factor = std::log(m.scale_factor);
  float scale = 1;
  for (int o = 0; o < m.levels; ++o, scale *= m.scale_factor) {
    m.scale_factors.push_back(scale);
    m.level_sigma2.push_back(scale * scale), m.inv_level_sigma2.push_back(1 / (scale * scale));
  }
  m.bounds = {0, 0, static_cast<float>(m.width), static_cast<float>(m.height)};
  m.cell_width_inverse = static_cast<float>(m.grid_columns) / static_cast<float>(m.width);
  m.cell_height_inverse = static_cast<float>(m.grid_rows) / static_cast<float>(m.height);
  if (options.imu) {
    const auto& n = rig.imu;
    const double g = n.gyro * n.gyro * n.rate_hz, a = n.acceleration * n.acceleration * n.rate_hz;
    const double gw = n.gyro_walk * n.gyro_walk / n.rate_hz, aw = n.acceleration_walk * n.acceleration_walk / n.rate_hz;
    m.imu_noise_variance = {g, g, g, a, a, a}, m.imu_walk_variance = {gw, gw, gw, aw, aw, aw};
  }
  return m;
}

/// The points of the scene: as many as asked for, or as the images need, judged by a first 4000 of them.
inline std::vector<scene_point> make_points(const scene& scene, const simulated_rig& rig,
                                            const descriptor_model& descriptors,
                                            const std::vector<Eigen::Isometry3d>& T_wb,
                                            const simulation_options& options) {
  std::vector<scene_point> points;
  const auto fill = [&](std::size_t count) {
    while (points.size() < count)
      points.push_back(scene.point(points.size(), options.observation.scale_factor, options.observation.levels));
  };
  if (options.points > 0) {
    fill(options.points);
    return points;
  }
  constexpr std::size_t probe = 4000, views = 24;
  fill(probe);
  const observer see(rig, scene, points, descriptors, options.observation, options.seed);
  std::size_t seen = 0, counted = 0;
  for (std::size_t i = 0; i < T_wb.size(); i += std::max<std::size_t>(1, T_wb.size() / views), ++counted)
    seen += see.visible_count(T_wb[i]);
  const double mean = std::max(1.0, static_cast<double>(seen)) / static_cast<double>(counted);
  fill(static_cast<std::size_t>(options.density * rig.features / mean * probe));
  return points;
}

/// The recording's world: T_rw, and what a metre is in it.
struct recorded_world {
  Eigen::Isometry3d T_rw = Eigen::Isometry3d::Identity();
  double metre = 1;

  rigid_transform<float> pose(Eigen::Isometry3d T_cr) const {
    T_cr.translation() *= metre;
    return to_float(T_cr);
  }
};

inline recorded_world make_world(const simulated_rig& rig, const simulation_options& options,
                                 const Eigen::Isometry3d& first_T_wc) {
  recorded_world w;
  if (options.imu && options.imu_initialised) return w;
  w.T_rw = first_T_wc.inverse();
  if (options.imu && rig.baseline == 0) w.metre = 1 / options.monocular_unit;
  return w;
}

/// Makes a recording along `poses` (body in world). Throws std::invalid_argument when they are too few or too short in
/// time. The recording's world is the first keyframe's camera frame, or with an initialised IMU the poses' own.
/// \param step  step(count): one of `count` steps, two per keyframe, is done
inline recording simulate(const std::vector<stamped_pose>& poses, const simulated_rig& rig,
                          const simulation_options& options, const std::function<void(std::size_t)>& step = {}) {
  const motion_spline motion(poses, options.motion.knot_seconds);
  const planned_motion plan = plan_motion(motion, options.motion, rig.baseline == 0);
  std::vector<Eigen::Vector3d> path;
  for (const timed_body& f : plan.frames) path.push_back(f.body.p_wb);
  const Eigen::Vector3d end = path.back(), onward = (end - path[path.size() / 2]).normalized();
  for (double d = 0.05; d < options.scene.ahead; d += 0.05) path.push_back(end + d * onward);
  std::vector<Eigen::Isometry3d> T_wb;
  for (const std::size_t f : plan.keyframes) T_wb.push_back(pose_of(plan.frames[f].body));
  const auto drifting = drifting_poses(T_wb, options.motion, options.seed);

  const scene place(path, options.scene, options.seed);
  const descriptor_model descriptors(options.descriptors);
  const auto points = make_points(place, rig, descriptors, T_wb, options);
  const observer see(rig, place, points, descriptors, options.observation, options.seed);
  std::vector<keyframe_observation> seen;
  for (std::size_t i = 0; i < T_wb.size(); ++i) {
    seen.push_back(see.observe(i, T_wb[i]));
    if (step) step(2 * T_wb.size());
  }

  const Eigen::Isometry3d T_bc = rig.cameras[0].T_bc;
  const recorded_world world = make_world(rig, options, T_wb[0] * T_bc);
  const Eigen::Isometry3d& T_rw = world.T_rw;
  imu_record imu;
  if (options.imu) imu = simulate_imu(motion, plan.frames.front().t_ns, plan.frames.back().t_ns, rig.imu, options.seed);
  recorder record(make_meta(rig, options));
  tracker tracking(rig, points.size(), options.tracking, options.seed);
  std::vector<Eigen::Vector3d> in_camera(points.size());
  for (std::size_t i = 0; i < T_wb.size(); ++i) {
    const Eigen::Isometry3d T_cw = (T_wb[i] * T_bc).inverse(), T_rc = T_rw * drifting[i] * T_bc;
    for (std::size_t p = 0; p < points.size(); ++p) in_camera[p] = T_cw * points[p].position;
    const auto* next = i == 0 && rig.baseline == 0 && seen.size() > 1 ? &seen[1] : nullptr;
    auto found = tracking.track(static_cast<std::int32_t>(i), seen[i], T_rc, in_camera, next);
    const auto metre = static_cast<float>(world.metre);
    for (auto& a : found.associations) a.position.x *= metre, a.position.y *= metre, a.position.z *= metre;
    const timed_body& now = plan.frames[plan.keyframes[i]];
    keyframe_record k;
    k.t_ns = now.t_ns, k.frame_id = now.frame, k.previous = static_cast<std::int32_t>(i) - 1;
    k.T_cw = world.pose(T_rc.inverse());
    k.keypoints = seen[i].keypoints, k.descriptors = seen[i].descriptors, k.stereo_partner = seen[i].stereo_partner;
    k.associations = found.associations, k.recent = found.recent;
    if (options.imu) {
      const auto sample = std::upper_bound(imu.t_ns.begin(), imu.t_ns.end(), now.t_ns) - imu.t_ns.begin() - 1;
      const auto& bias = imu.bias[static_cast<std::size_t>(sample)];
      std::array<float, 6> truth;
      std::transform(bias.begin(), bias.end(), truth.begin(), [](double b) { return static_cast<float>(b); });
      record.data().sim_velocity_true.push_back(to_float(T_rw.linear() * now.body.velocity));
      record.data().sim_bias_true.push_back(truth);
      if (options.imu_initialised)
        k.velocity = record.data().sim_velocity_true.back(), k.bias = truth, k.imu_initialized = true;
    }
    record.add(k);
    record.data().sim_T_cw_true.push_back(world.pose((T_rw * T_wb[i] * T_bc).inverse()));
    record.data().sim_point_id.insert(record.data().sim_point_id.end(), seen[i].point.begin(), seen[i].point.end());
    if (step) step(2 * T_wb.size());
  }
  for (const auto& of_keyframe : tracking.point_of())
    record.data().sim_track_id.insert(record.data().sim_track_id.end(), of_keyframe.begin(), of_keyframe.end());
  for (const scene_point& p : points) {
    record.data().sim_point_xyz.push_back(to_float(world.metre * (T_rw * p.position)));
    record.data().sim_point_normal.push_back(to_float(Eigen::Vector3d(T_rw.linear() * p.normal)));
  }
  for (std::size_t s = 0; s < imu.t_ns.size(); ++s) record.add_imu(imu.t_ns[s], imu.samples[s]);
  for (const timed_body& f : plan.frames) {
    const auto& q = f.body.R_wb;
    record.add_ground_truth(f.t_ns, {f.body.p_wb.x(), f.body.p_wb.y(), f.body.p_wb.z(), q.w(), q.x(), q.y(), q.z()});
  }
  record.data().meta.frames = static_cast<int>(plan.frames.size()), record.data().meta.frames_not_ok = 0;
  record.data().meta.keyframes_inserted = static_cast<int>(T_wb.size());
  validate(record.data());
  return std::move(record.data());
}

}  // namespace turbomap::simulation

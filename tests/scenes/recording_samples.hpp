// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A recording of three keyframes that tests write, damage and read.

#include <turbomap/io/recording_writer.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace turbomap_test {

inline turbomap::recording_meta small_meta(bool fisheye) {
  turbomap::recording_meta m;
  m.width = 640, m.height = 480;
  m.camera1 = {435.204681, 435.1, 320.5, 240.25};
  if (fisheye) {
    m.model = "KannalaBrandt8";
    m.camera1 = {190.5, 190.25, 255, 256, 0.003, 0.0007, -0.002, 0.0002};
    m.camera2 = m.camera1;
    m.T_lr.tx = 0.1F, m.T_rl.tx = -0.1F;
  }
  m.sensor = "inertial";
  m.bf = 47.9, m.baseline = 0.11, m.close_depth = 6.6;
  for (int o = 0; o < m.levels; ++o) {
    m.scale_factors.push_back(std::pow(1.2F, static_cast<float>(o)));
    m.level_sigma2.push_back(m.scale_factors.back() * m.scale_factors.back());
    m.inv_level_sigma2.push_back(1 / m.level_sigma2.back());
  }
  m.bounds = {0, 0, 640, 480};
  m.cell_width_inverse = 0.1F, m.cell_height_inverse = 0.1F;
  m.imu_noise_variance = {1e-6, 1e-6, 1e-6, 1e-3, 1e-3, 1e-3},
  m.imu_walk_variance = {1e-12, 1e-12, 1e-12, 4e-8, 4e-8, 4e-8};
  m.events = {{1, "InitializeIMU", 0, 1, 1.02}};
  m.snapshots = {1};
  return m;
}

/// Three keyframes of five keypoints (three left, two right when fisheye), built as a SLAM system would.
inline turbomap::recording small_recording(bool fisheye = false) {
  turbomap::recorder record(small_meta(fisheye));
  for (std::int32_t i = 0; i < 3; ++i) {
    std::vector<turbomap::keypoint> keypoints(5);
    std::vector<turbomap::descriptor_bytes> descriptors(5);
    std::vector<std::int32_t> partner(5, -1);
    for (std::size_t k = 0; k < 5; ++k) {
      auto& p = keypoints[k];
      p.x = 10.5F * static_cast<float>(k + 1), p.y = 20 + static_cast<float>(i), p.angle = 359, p.octave = k % 3;
      p.group = k == 4 ? turbomap::keypoint::no_group : 7;
      if (k == 0 && !fisheye) p.u_right = 3.25F, p.depth = 2;
      p.camera = fisheye && k > 2;
      descriptors[k].fill(static_cast<std::uint8_t>(16 * i + static_cast<int>(k)));
    }
    if (fisheye) partner[0] = 3, partner[3] = 0;
    std::vector<turbomap::point_association> associations{{0, {i, 0}, {i, 0}, {1, 2, 3}, true}};
    if (i > 0) associations.push_back({2, {i - 1, 0}, {0, 0}, {4, 5, 6}, false});
    const std::vector<turbomap::recorded_recent_point> recent(static_cast<std::size_t>(i), {{0, 2}, 0, 4, 3});
    turbomap::keyframe_record k;
    k.t_ns = 1403715527912143104 + i * 50000000LL, k.previous = i - 1, k.T_cw.tx = static_cast<float>(i);
    k.keypoints = keypoints, k.descriptors = descriptors, k.stereo_partner = partner;
    k.associations = associations, k.recent = recent;
    k.velocity = {0.5F, 0, 0}, k.imu_initialized = i > 0;
    record.add(k);
    record.add_imu(k.t_ns, {{0.1, 0.2, 0.3}, {0, 0, 9.81}});
    record.add_ground_truth(k.t_ns, {static_cast<double>(i), 0, 0, 1, 0, 0, 0});
  }
  auto& r = record.data();
  r.meta.keyframes_inserted = 3, r.meta.ate_kf_rmse_m = 0.03125, r.meta.noise_px = 0.75;
  r.meta.keypoint_pixels = "multiplied";
  r.final_T_cw = r.T_cw, r.final_alive = {1, 0, 1};
  r.frame_t_ns = r.t_ns, r.frame_T_cw = r.T_cw, r.frame_state = {2, 2, 1};
  r.frame_T_cw[2].tx = std::numeric_limits<float>::quiet_NaN();  // not tracked: means nothing
  return r;
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Poses come from elsewhere (visual or wheel odometry), and no tracking says which keypoint shows which point of the map: the
/// mapper finds points by itself, joins them by fusion and adjusts the poses. The class is that of the ROS 2 node in ros2/.

#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>
#include <vector>

#include "ros2/src/pose_mapper.hpp"
#include "wall_scene.hpp"

int main() {
  example::wall_scene scene;
  example::pose_mapper mapper(example::left_camera, example::image);
  const example::pose_mapper_options options;
  example::keyframe_choice choice;
  double x = 0, drift = 0;
  int keyframes = 0;
  for (int n = 0; n < 80; ++n, x += 0.08) {
    const example::wall_view view = scene.look_from(x, 0);
    turbomap::rigid_transform<double> odometry = view.T_cw;
    odometry.ty += drift;  // the odometry slides off to the side, 3 mm per image
    drift += 0.003;
    if (!choice.wants(odometry, options)) continue;
    choice = {odometry, true};
    if (keyframes == 10) {  // an odometry that is lost: refused, and the next keyframe goes on from the one before
      turbomap::rigid_transform<double> lost = odometry;
      lost.tx = std::numeric_limits<double>::quiet_NaN();
      try {
        mapper.add(view.keypoints, view.descriptors, lost, 0.1 * n);
        return 1;
      } catch (const std::invalid_argument& error) {
        std::printf("%s\n", error.what());
      }
    }
    const auto& report = mapper.add(view.keypoints, view.descriptors, odometry, 0.1 * n);
    std::printf("keyframe %2d: %zu neighbours, %3zu points created, %3zu merged, %3zu observations added, %.1f ms\n",
                keyframes++, report.neighbours, report.points_created, report.fused.merged,
                report.fused.observations_added, report.total_ms);
  }
  const auto trajectory = mapper.trajectory();
  const auto points = mapper.points();
  std::size_t off = 0;
  for (const auto& p : points) off += p.z >= 3.8F && p.z <= 7.2F ? 0 : 1;
  const double before = std::abs(drift), after = std::abs(trajectory.back().ty);
  std::printf("%zu keyframes, %zu points, %zu off the wall; the last keyframe is %.0f mm aside, its odometry %.0f mm\n",
              trajectory.size(), points.size(), off, 1e3 * after, 1e3 * before);
  return turbomap::validate(mapper.map()).empty() && points.size() > 300 && after < before / 10 &&
                 off <= points.size() / 20
             ? 0
             : 1;
}

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Bundle adjustment of the user's own types with residuals of their own (drive_scene.hpp): a car with a camera, a satellite
/// receiver and wheels. Reprojections are the library's; the other two residuals are written here, without a derivative.

#include <thrust/execution_policy.h>

#include <cstdint>
#include <cstdio>
#include <turbomap/adjustment/levenberg_marquardt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/math/linear.hpp>
#include <vector>

#include "drive_scene.hpp"

/// Of one frame: the receiver measured where it was. S is double, or a dual number, which carries derivatives.
struct receiver_factor {
  static constexpr int size = 3;
  using row = my::Vector;
  template <class S>
  TURBOMAP_HD bool residual(const turbomap::rigid_transform<S>& T_cw, const row& measured, S* e) const {
    const auto centre = turbomap::camera_centre(turbomap::to_isometry<S>(T_cw));
    e[0] = (centre.x - S(measured.x)) / S(my::receiver_sigma);
    e[1] = (centre.y - S(measured.y)) / S(my::receiver_sigma);
    e[2] = (centre.z - S(measured.z)) / S(my::receiver_sigma);
    return true;
  }
};

/// Between two frames: the wheels measured the way from the first to the second.
struct wheel_factor {
  static constexpr int size = 3;
  using row = my::Vector;
  template <class S>
  TURBOMAP_HD bool residual(const turbomap::rigid_transform<S>& first, const turbomap::rigid_transform<S>& second,
                            const row& measured, S* e) const {
    const auto way = turbomap::to_isometry<S>(first) * turbomap::camera_centre(turbomap::to_isometry<S>(second));
    e[0] = (way.x - S(measured.x)) / S(my::wheel_sigma);
    e[1] = (way.y - S(measured.y)) / S(my::wheel_sigma);
    e[2] = (way.z - S(measured.z)) / S(my::wheel_sigma);
    return true;
  }
};

/// No frame is fixed: the receiver measures positions in the world.
turbomap::adjustment_summary adjust(my::Drive& drive) {
  std::vector<turbomap::rigid_transform<double>> T_cw;
  std::vector<turbomap::vec3<double>> points, pixels;
  std::vector<std::int32_t> frame, point, every, first, second;
  for (const auto& p : drive.poses) every.push_back(static_cast<int>(T_cw.size())), T_cw.push_back(my::T_cw_of(p));
  for (const auto& x : drive.points) points.push_back({x.x, x.y, x.z});
  for (const auto& k : drive.keypoints)
    frame.push_back(k.frame), point.push_back(k.point), pixels.push_back({k.u, k.v, -1});  // no right image
  for (int f = 1; f < static_cast<int>(every.size()); ++f) first.push_back(f - 1), second.push_back(f);
  const std::vector<double> information(pixels.size(), 1 / (my::keypoint_sigma * my::keypoint_sigma));

  const auto rig = turbomap::make_mono_rig(my::camera);
  auto seen = turbomap::huber_reprojections(rig.view());
  seen.frame = frame, seen.landmark = point, seen.pixel = pixels, seen.information = information;
  const turbomap::frame_factors<receiver_factor> received{{}, every, drive.receiver};
  const turbomap::frame_pair_factors<wheel_factor> driven{{}, first, second, drive.wheels};

  // Keep these two for the next call: their memory is used again.
  turbomap::context ctx{thrust::host};
  turbomap::bundle_problem<decltype(ctx)::policy_type, turbomap::pose_frame, decltype(seen),
                           turbomap::frame_factors<receiver_factor>, turbomap::frame_pair_factors<wheel_factor>>
      problem(ctx);
  problem.assign(ctx, {T_cw}, {points}, seen, received, driven);
  turbomap::adjustment_options options;
  options.max_iterations = 100, options.min_relative_decrease = 1e-5;
  const auto summary = turbomap::adjust(ctx, problem, options);

  problem.frames(ctx, T_cw), problem.landmarks(ctx, points);
  for (std::size_t f = 0; f < T_cw.size(); ++f) drive.poses[f] = my::pose_of(T_cw[f]);
  for (std::size_t l = 0; l < points.size(); ++l) drive.points[l] = {points[l].x, points[l].y, points[l].z};
  return summary;
}

int main() {
  example::drive_scene scene;
  my::Drive drive = scene.measure();
  const double before = scene.error(drive);
  const auto summary = adjust(drive);
  const double after = scene.error(drive);
  std::printf("%zu frames, %zu points, %zu keypoints\n", drive.poses.size(), drive.points.size(),
              drive.keypoints.size());
  std::printf("cost %.0f before, %.0f after %d iterations: %s\n", summary.cost_initial, summary.cost_final,
              summary.iterations, turbomap::to_string(summary.end));
  std::printf("frames were off by %.2f m, and are by %.2f m\n", before, after);
  return summary.accepted > 0 && after < 0.3 && after < before / 4 ? 0 : 1;
}

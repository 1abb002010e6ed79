// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Poses from fixed points on a device: what the host computes within rounding, and the same bits each time.

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <new>
#include <vector>

#include "adjustment_results.hpp"
#include "motion_only_cases.hpp"
#include "support/stream.cuh"
#include "uncertain_points_cases.hpp"

namespace {

using namespace turbomap_test;
using turbomap::posed_frame;
using sequential = std::decay_t<decltype(thrust::seq)>;

void check_same(const posed& device, const posed& host, const posed& again) {
  CHECK(device.outlier == host.outlier);
  CHECK(device.outlier == again.outlier);
  static_assert(sizeof(posed_frame) == 8 * sizeof(double) + 2 * sizeof(std::int32_t));  // no padding
  CHECK(same_bits(device.frames, again.frames));
  REQUIRE(device.frames.size() == host.frames.size());
  for (std::size_t f = 0; f < host.frames.size(); ++f) {
    CAPTURE(f);
    const posed_frame &a = device.frames[f], &b = host.frames[f];
    CHECK(a.adjusted == b.adjusted);
    CHECK(a.inliers == b.inliers);
    CHECK(std::abs(a.cost - b.cost) <= 1e-9 * b.cost);
    CHECK(pose_error(a.T_cw, b.T_cw) <= 1e-9);
  }
}

TEST_CASE("poses are found among outliers, and outliers told") {
  const stream on;
  check_poses_found(on.policy());
}

TEST_CASE("a last step that is taken as it is: poses whatever the order") {
  const stream on;
  check_last_step(on.policy());
}

TEST_CASE("as on the host, every kind of observation and round") {
  const stream on;
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig})
    for (const int robust_rounds : {0, 2, 4}) {
      CAPTURE(static_cast<int>(kind));
      CAPTURE(robust_rounds);
      const frames_input in(make_adjustment_scene(kind, 40, 0, 100, 4));
      motion_only_options options;
      options.robust_rounds = robust_rounds;
      check_same(adjust_poses(on.policy(), in, options), adjust_poses(sequential{}, in, options),
                 adjust_poses(on.policy(), in, options));
    }
}

TEST_CASE("frames that cannot be adjusted stay to the bit; the others do not mind") {
  const stream on;
  check_poses_refused(on.policy());
  const frames_input in = frames_to_refuse();
  check_same(adjust_poses(on.policy(), in), adjust_poses(sequential{}, in), adjust_poses(on.policy(), in));
}

TEST_CASE("bad input is refused") {
  const stream on;
  check_bad_frames(on.policy());
  check_rows_of_no_information(on.policy());
}

TEST_CASE("where memory runs out, nothing under way reads the caller's arrays any more") {
  const stream on;
  frames_input in(make_adjustment_scene(scene_kind::stereo, 4, 0, 60, 9));
  adjust_poses(on.policy(), in);  // the kernel is loaded: what follows waits for nothing
  constexpr std::size_t frames = 4096, of_frame = 1024, n = frames * of_frame;
  auto* const pinned = turbomap::default_staging_resource(turbomap::device_memory{});
  turbomap::array<vec3<double>, turbomap::host_memory> point(pinned), pixel(pinned);
  turbomap::array<double, turbomap::host_memory> information(pinned);
  point.resize_discard(n), pixel.resize_discard(n), information.resize_discard(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t k = i % in.point.size();
    point.data()[i] = in.point[k], pixel.data()[i] = in.pixel[k], information.data()[i] = in.information[k];
  }
  in.s.poses = std::vector<rigid_transform<double>>(frames, in.s.poses[0]);
  in.begin.clear();
  for (std::size_t f = 0; f <= frames; ++f) in.begin.push_back(static_cast<std::int32_t>(f * of_frame));
  auto given = in.view();
  given.point = {point.data(), n}, given.pixel = {pixel.data(), n}, given.information = {information.data(), n};
  given.camera = {};
  turbomap::context<stream_policy> ctx{on.policy(), turbomap::default_resource(turbomap::device_memory{}),
                                       std::pmr::null_memory_resource()};  // no room for results on the host
  turbomap::motion_only<scene_camera, stream_policy> adjust(ctx);
  posed p;
  CHECK_THROWS_AS(adjust(ctx, given, {}, p.frames, p.outlier), std::bad_alloc);
  CHECK(cudaStreamQuery(on.handle()) == cudaSuccess);
  CHECK(p.frames.empty());
}

TEST_CASE("points that are not exact") {
  const stream on;
  check_uncertain_poses(on.policy());
  check_unbiased_step(on.policy());
  check_exact_covariances(on.policy());
  check_bad_covariances(on.policy());
  const uncertain_frames u(scene_kind::stereo);
  check_same(u.adjust(on.policy()), u.adjust(sequential{}), u.adjust(on.policy()));
}

TEST_CASE("one object, one context: frames after frames, more and fewer") {
  const stream on;
  turbomap::context<stream_policy> ctx{on.policy()};
  turbomap::motion_only<scene_camera, stream_policy> adjust(ctx);
  // Where few points are seen, the cost cannot tell whether the last steps of a round gain.
  motion_only_options options;
  options.min_predicted_decrease = 1e-12, options.take_last_step = true;
  for (const int frames : {3, 200, 30, 0, 5}) {  // 200: more than is sent in one block
    CAPTURE(frames);
    const frames_input in(make_adjustment_scene(scene_kind::stereo, frames, 0, 60, 9));
    posed p;
    adjust(ctx, in.view(), options, p.frames, p.outlier);
    check_same(p, adjust_poses(sequential{}, in, options), adjust_poses(on.policy(), in, options));
  }
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Conjugate gradients whose sums stay on the device: as many iterations and the same steps as where the host reads every sum, wherever they end.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <memory_resource>
#include <type_traits>

#include "adjustment_cases.hpp"
#include "adjustment_results.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using sequential = std::decay_t<decltype(thrust::seq)>;

turbomap::adjustment_options by_gradients(double tolerance, int most) {
  auto options = in_float64();
  options.solver = turbomap::reduced_solver::pcg;
  options.pcg_tolerance = tolerance, options.pcg_max_iterations = most, options.max_iterations = 4;
  return options;
}

/// \param staging  new_delete_resource(): memory that the device does not write to, so the host reads every sum
adjusted on_device(const adjustment_scene& s, const turbomap::adjustment_options& options,
                   std::pmr::memory_resource* staging) {
  const stream on;
  turbomap::context<stream_policy> ctx(on.policy(), turbomap::default_resource(turbomap::device_memory{}), staging);
  turbomap::bundle_problem<stream_policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  adjusted a;
  a.summary = turbomap::adjust<float64_methods>(ctx, problem, options);
  problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
  return a;
}

/// \param apart  iterations of conjugate gradients: sums in another order may end them one sooner
void check_same_steps(const adjusted& a, const adjusted& b, int apart) {
  CHECK(a.summary.end == b.summary.end);
  REQUIRE(a.summary.each.size() == b.summary.each.size());
  for (std::size_t i = 0; i < a.summary.each.size(); ++i) {
    CHECK(std::abs(a.summary.each[i].linear_iterations - b.summary.each[i].linear_iterations) <= apart);
    if (apart == 0) CHECK(std::abs(a.summary.each[i].cost - b.summary.each[i].cost) <= 1e-9 * b.summary.each[i].cost);
  }
}

void check_same_bits(const adjusted& a, const adjusted& again) {
  CHECK(same_bits(a.summary, again.summary));
  CHECK(same_bits(a.poses, again.poses));
}

/// More frames than threads of a block.
adjustment_scene many_frames(unsigned seed) { return make_adjustment_scene(scene_kind::stereo, 150, 2, 120, seed); }

TEST_CASE("cut after so many iterations") {
  auto* const pinned = turbomap::default_staging_resource(turbomap::device_memory{});
  const auto s = many_frames(5);
  for (const int most : {1, 2, 7}) {
    CAPTURE(most);
    const auto options = by_gradients(1e-14, most);
    const auto a = on_device(s, options, pinned);
    REQUIRE(!a.summary.each.empty());
    CHECK(a.summary.each[0].linear_iterations == most);
    check_same_steps(a, on_device(s, options, std::pmr::new_delete_resource()), 0);
    check_same_steps(a, adjust_scene(sequential{}, s, options), 0);
    check_same_bits(a, on_device(s, options, pinned));
  }
}

TEST_CASE("ended by the tolerance") {
  auto* const pinned = turbomap::default_staging_resource(turbomap::device_memory{});
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    const auto s = make_adjustment_scene(kind, 9, 2, 200, 7);
    for (const double tolerance : {0.1, 1e-6}) {
      CAPTURE(tolerance);
      const auto options = by_gradients(tolerance, 500);
      const auto a = on_device(s, options, pinned);
      REQUIRE(!a.summary.each.empty());
      CHECK(a.summary.each[0].linear_iterations > 0);
      check_same_steps(a, on_device(s, options, std::pmr::new_delete_resource()), 1);
      check_same_bits(a, on_device(s, options, pinned));
    }
  }
}

TEST_CASE("a diagonal block without a factor: no step, as where the host looks") {
  auto* const pinned = turbomap::default_staging_resource(turbomap::device_memory{});
  auto s = make_adjustment_scene(scene_kind::stereo, 6, 1, 80, 3);
  s.poses.push_back(s.poses.back()), s.true_poses.push_back(s.true_poses.back()), s.fixed.push_back(0);  // seen by none
  auto options = by_gradients(1e-8, 50);
  options.damping = turbomap::damping_rule::diagonal;
  options.initial_lambda = 1e-320, options.max_retries = 2;  // times 1e-6, the least diagonal element, it is 0
  const auto a = on_device(s, options, pinned), read = on_device(s, options, std::pmr::new_delete_resource());
  for (const adjusted& x : {a, read, adjust_scene(sequential{}, s, options)}) {
    CHECK(x.summary.end == turbomap::adjustment_end::singular);
    CHECK(x.summary.accepted == 0);
    REQUIRE(x.summary.each.size() == 1);
    CHECK(x.summary.each[0].steps == 3);
    CHECK(x.summary.each[0].linear_iterations == 0);
  }
}

}  // namespace

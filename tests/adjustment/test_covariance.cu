// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Covariance of frames on a device: what the host computes within rounding, the same bits each time, and what
/// covariance_cases.hpp asks for.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include "adjustment_results.hpp"
#include "covariance_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("as on the host, and the same bits each time; nothing where nothing is fixed") {
  const stream on;
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    CAPTURE(static_cast<int>(kind));
    auto s = make_adjustment_scene(kind, 9, 2, 200, 7);
    const std::vector<std::int32_t> frames{3, 0, 8, 6};  // 8: fixed
    const auto a = covariance_of(on.policy(), s, frames);
    REQUIRE(a.size() == 24 * 24);
    CHECK(same_bits(a, covariance_of(on.policy(), s, frames)));
    CHECK(relative_difference(a, covariance_of(thrust::seq, s, frames)) <= 1e-9);
    CHECK(a[0] > 0);
    s.fixed.assign(s.poses.size(), 0);
    CHECK(covariance_of(on.policy(), s, frames).empty());
  }
}

TEST_CASE("what the problem does not tell is not made up") { check_not_made_up(stream{}.policy()); }
TEST_CASE("a scale that is free is not told by far points, and is by a weak prior") {
  check_free_scale(stream{}.policy());
}
TEST_CASE("the answer is per frame") { check_answer_per_frame(stream{}.policy()); }
TEST_CASE("unknowns that are held are known") { check_held_unknowns(stream{}.policy()); }
TEST_CASE("a landmark that is seen once takes nothing from what is known") {
  check_landmark_seen_once(stream{}.policy());
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Poses from fixed points: against the oracle, which adjusts with fixed landmarks, round by round; outliers;
// frames that cannot be adjusted.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cmath>

#include "adjustment_scene_oracle.hpp"
#include "motion_only_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap_test::sequential;

TEST_CASE_TEMPLATE("poses are found among outliers, and outliers told", Policy, TURBOMAP_TEST_POLICIES) {
  check_poses_found(Policy{});
}

TEST_CASE_TEMPLATE("a last step that is taken as it is: poses whatever the order", Policy, TURBOMAP_TEST_POLICIES) {
  check_last_step(Policy{});
}

TEST_CASE_TEMPLATE("poses and outliers are those of the oracle", Policy, TURBOMAP_TEST_POLICIES) {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    CAPTURE(static_cast<int>(kind));
    const frames_input in(make_adjustment_scene(kind, 3, 0, 60, 8));
    const auto rig = cost_rig_of(in.s);
    const posed p = adjust_poses(Policy{}, in);
    for (std::size_t f = 0; f < 3; ++f) {
      const auto first = static_cast<std::size_t>(in.begin[f]), last = static_cast<std::size_t>(in.begin[f + 1]);
      oracle_sights sights;
      for (auto i = first; i < last; ++i)
        sights.add(in.point[i], in.pixel[i], in.information[i], in.camera[i],
                   in.pixel[i].z >= 0 && rig[in.camera[i]].bf > 0);
      const adjusted_pose expected = motion_only_oracle(frame_of(in.s.poses[f]), rig, sights);
      REQUIRE(expected.adjusted);
      const auto got = turbomap::to_isometry<double>(p.frames[f].T_cw);
      CHECK((Eigen::Vector3d(got.t.x, got.t.y, got.t.z) - expected.frame.t).norm() < 1e-6);
      for (int i = 0; i < 9; ++i) CHECK(std::abs(got.R.m[i] - expected.frame.R(i / 3, i % 3)) < 1e-6);
      for (auto i = first; i < last; ++i)
        if (std::abs(expected.excess[i - first] - 1) > 1e-5)
          CHECK((p.outlier[i] != 0) == (expected.excess[i - first] > 1));
    }
  }
}

TEST_CASE("without robust rounds outliers pull; what is behind the camera is an outlier") {
  frames_input in(make_adjustment_scene(scene_kind::mono, 3, 0, 60, 8));
  motion_only_options options;
  options.rounds = options.robust_rounds = 1;
  const posed robust = adjust_poses(sequential{}, in, options);
  options.robust_rounds = 0;
  const posed plain = adjust_poses(sequential{}, in, options);
  for (std::size_t f = 0; f < 3; ++f) {
    const auto &a = robust.frames[f], &b = plain.frames[f];
    CHECK(b.cost > 1.5 * a.cost);
    CHECK(pose_error(a.T_cw, in.s.true_poses[f]) < pose_error(b.T_cw, in.s.true_poses[f]));
  }
  const posed before = adjust_poses(sequential{}, in);
  for (int i = 0; i < in.begin[1]; ++i) {  // mirrored through the camera's centre: the same pixels by the formula
    const auto k = static_cast<std::size_t>(i);
    if (i % 5 != 0 || before.outlier[k] != 0) continue;
    const auto T = turbomap::to_isometry<double>(before.frames[0].T_cw);
    const vec3<double> c = turbomap::camera_centre(T), p = in.point[k];
    in.point[k] = {2 * c.x - p.x, 2 * c.y - p.y, 2 * c.z - p.z};
  }
  const posed after = adjust_poses(sequential{}, in);
  for (int i = 0; i < in.begin[1]; i += 5) CHECK(after.outlier[static_cast<std::size_t>(i)] == 1);
}

TEST_CASE_TEMPLATE("frames that cannot be adjusted stay to the bit; the others do not mind", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_poses_refused(Policy{});
}

TEST_CASE_TEMPLATE("rows of no information are no observations", Policy, TURBOMAP_TEST_POLICIES) {
  check_rows_of_no_information(Policy{});
}

TEST_CASE_TEMPLATE("bad input is refused", Policy, TURBOMAP_TEST_POLICIES) { check_bad_frames(Policy{}); }

}  // namespace

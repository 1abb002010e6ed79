// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// What is seen from frames, landmarks taken as exact: the blocks of their poses in the oracle's normal equations.

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <vector>

#include <turbomap/adjustment/pose_information.hpp>

#include "adjustment_scene_oracle.hpp"

namespace {

using namespace turbomap_test;

/// Of the first `frames` frames.
turbomap::plain_vector<turbomap::pose_information> information_of(const adjustment_scene& s, std::size_t frames,
                                                                  const std::vector<std::size_t>& left_out) {
  turbomap::plain_vector<turbomap::pose_information> sums(frames);
  for (auto& sum : sums) sum = {};
  turbomap::reprojections<scene_camera, turbomap::huber> rows;
  const auto g = s.group();
  rows.rig = g.rig, rows.frame = g.frame, rows.landmark = g.landmark, rows.pixel = g.pixel;
  rows.information = g.information, rows.camera = g.camera;
  rows.mono_kernel.delta2 = 5.991, rows.stereo_kernel.delta2 = 7.815;
  turbomap::sum_pose_information(rows, {left_out.data(), left_out.size()}, {s.poses.data(), s.poses.size()},
                                 {s.points.data(), s.points.size()}, sums);
  return sums;
}

TEST_CASE("the oracle's blocks; rows that are left out, and frames that are not asked for, do not count") {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig})
    for (const bool some : {false, true}) {
      CAPTURE(static_cast<int>(kind));
      CAPTURE(some);
      const auto s = make_adjustment_scene(kind, 4, 0, 40, 9);
      auto reduced = s;
      std::vector<std::size_t> left_out;
      for (std::size_t i = s.frame.size(); some && i-- > 0;)
        if (i % 7 == 0) {
          left_out.push_back(i);
          const auto at = static_cast<std::ptrdiff_t>(i);
          reduced.frame.erase(reduced.frame.begin() + at), reduced.landmark.erase(reduced.landmark.begin() + at);
          reduced.pixel.erase(reduced.pixel.begin() + at), reduced.camera.erase(reduced.camera.begin() + at);
          reduced.information.erase(reduced.information.begin() + at);
        }
      std::reverse(left_out.begin(), left_out.end());
      const auto sums = information_of(s, 3, left_out);
      auto o = oracle_of(reduced);
      o.landmark_fixed.assign(s.points.size(), true);
      Eigen::MatrixXd H;
      Eigen::VectorXd b;
      o.normal_equations(H, b);
      REQUIRE(H.rows() == 24);
      std::size_t bent = 0;
      for (std::size_t f = 0; f < 3; ++f) {
        const auto first = static_cast<Eigen::Index>(6 * f);
        for (int i = 0, at = 0; i < 6; ++i) {
          const double scale = H.diagonal().maxCoeff();
          CHECK(std::abs(sums[f].b[i] - b[first + i]) < 1e-6 * b.cwiseAbs().maxCoeff());
          for (int j = 0; j <= i; ++j, ++at) CHECK(std::abs(sums[f].H[at] - H(first + i, first + j)) < 1e-6 * scale);
        }
      }
      for (const auto& block : o.blocks) {
        double rho, weight;
        block.kernel(o.residual(block).squaredNorm(), rho, weight);
        bent += weight < 1 ? 1 : 0;
      }
      CHECK(bent > 0);  // the kernel has a part in it
    }
}

TEST_CASE("a list of which rows are stereo is refused by name") {
  const auto s = make_adjustment_scene(scene_kind::mono, 2, 0, 4, 9);
  const std::vector<std::uint8_t> stereo(s.frame.size(), 0);
  turbomap::reprojections<scene_camera, turbomap::huber> rows;
  rows.stereo = {stereo.data(), stereo.size()};
  turbomap::plain_vector<turbomap::pose_information> sums(2);
  CHECK_THROWS_WITH_AS(turbomap::sum_pose_information(rows, {}, {s.poses.data(), 2}, {s.points.data(), 4}, sums),
                       doctest::Contains("rows.stereo"), std::invalid_argument);
}

}  // namespace

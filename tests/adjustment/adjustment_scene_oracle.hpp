// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The scene of adjustment_cases.hpp as a problem of the oracle, with formulas of its own.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "adjustment_cases.hpp"
#include "reference/adjustment_oracle.hpp"
#include "reference/eigen.hpp"
#include "reference/reprojection_oracle.hpp"

namespace turbomap_test {

/// The cameras for the oracle.
inline std::vector<cost_camera> cost_rig_of(const adjustment_scene& s) {
  std::vector<cost_camera> rig;
  for (const auto& c : s.rig) {
    cost_camera camera;
    if (const auto* curved = c.camera.get_if<turbomap::kannala_brandt<double>>())
      camera = {curved->fx, curved->fy, curved->cx, curved->cy, {curved->k1, curved->k2, curved->k3, curved->k4}, true};
    else if (const auto* straight = c.camera.get_if<turbomap::pinhole<double>>())
      camera = {straight->fx, straight->fy, straight->cx, straight->cy};
    camera.bf = c.bf;
    rotation_matrix(c.T_camera_body, camera.R);
    camera.t[0] = c.T_camera_body.tx, camera.t[1] = c.T_camera_body.ty, camera.t[2] = c.T_camera_body.tz;
    rig.push_back(camera);
  }
  return rig;
}

/// The same problem for the oracle, with formulas of its own.
inline oracle_problem oracle_of(const adjustment_scene& s) {
  const auto rig = cost_rig_of(s);
  oracle_problem o;
  for (const auto& T : s.poses) o.frames.push_back(frame_of(T));
  for (const auto f : s.fixed) o.frame_fixed.push_back(f != 0);
  for (const auto& p : s.points) o.landmarks.emplace_back(p.x, p.y, p.z);
  o.landmark_fixed.assign(s.points.size(), false);
  for (std::size_t i = 0; i < s.frame.size(); ++i) {
    const bool stereo = s.pixel[i].z >= 0 && rig[s.camera[i]].bf > 0;
    o.blocks.push_back(
        reprojection_block(s.frame[i], s.landmark[i], rig[s.camera[i]], {s.pixel[i], s.information[i], stereo}));
  }
  return o;
}

inline double distance(const adjusted& a, const oracle_problem& o) {
  double d = 0;
  for (std::size_t f = 0; f < a.poses.size(); ++f) {
    const oracle_frame x = frame_of(a.poses[f]);
    d = std::max({d, (x.R - o.frames[f].R).cwiseAbs().maxCoeff(), (x.t - o.frames[f].t).cwiseAbs().maxCoeff()});
  }
  for (std::size_t l = 0; l < a.points.size(); ++l)
    d = std::max(d,
                 (Eigen::Vector3d(a.points[l].x, a.points[l].y, a.points[l].z) - o.landmarks[l]).cwiseAbs().maxCoeff());
  return d;
}

inline void check_against_oracle(const adjusted& a, const std::vector<double>& costs, const oracle_problem& o,
                                 double cost_tolerance, double state_tolerance) {
  REQUIRE(a.summary.each.size() == costs.size());
  for (std::size_t i = 0; i < costs.size(); ++i)
    CHECK(std::abs(a.summary.each[i].cost - costs[i]) <= cost_tolerance * costs[i]);
  CHECK(a.summary.cost_final == a.summary.each.back().cost);
  CHECK(distance(a, o) < state_tolerance);
}

}  // namespace turbomap_test

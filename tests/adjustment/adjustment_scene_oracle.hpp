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

namespace turbomap_test {

inline oracle_frame frame_of(const rigid_transform<double>& T) {
  const Eigen::Quaterniond q(T.qw, T.qx, T.qy, T.qz);
  return {q.normalized().toRotationMatrix(), {T.tx, T.ty, T.tz}, Eigen::VectorXd(0)};
}

inline void huber_of(double delta2, double chi2, double& rho, double& weight) {
  const double e = std::sqrt(chi2), delta = std::sqrt(delta2);
  rho = e <= delta ? chi2 : 2 * delta * e - delta2;
  weight = e <= delta ? 1 : delta / e;
}

/// The same problem for the oracle, with formulas of its own.
inline oracle_problem oracle_of(const adjustment_scene& s) {
  oracle_problem o;
  for (const auto& T : s.poses) o.frames.push_back(frame_of(T));
  for (const auto f : s.fixed) o.frame_fixed.push_back(f != 0);
  for (const auto& p : s.points) o.landmarks.emplace_back(p.x, p.y, p.z);
  o.landmark_fixed.assign(s.points.size(), false);
  for (std::size_t i = 0; i < s.frame.size(); ++i) {
    const auto& c = s.rig[s.camera[i]];
    const oracle_frame mount = frame_of(c.T_camera_body);
    const vec3<double> z = s.pixel[i];
    const double sigma = std::sqrt(s.information[i]), bf = c.bf;
    const bool stereo = z.z >= 0 && bf > 0;
    const auto* curved = c.camera.get_if<turbomap::kannala_brandt<double>>();
    const auto* straight = c.camera.get_if<turbomap::pinhole<double>>();
    const double K[8] = {curved ? curved->fx : straight->fx,
                         curved ? curved->fy : straight->fy,
                         curved ? curved->cx : straight->cx,
                         curved ? curved->cy : straight->cy,
                         curved ? curved->k1 : 0,
                         curved ? curved->k2 : 0,
                         curved ? curved->k3 : 0,
                         curved ? curved->k4 : 0};
    const std::vector<double> k(K, K + 8);
    const bool is_curved = curved != nullptr;
    oracle_block b;
    b.frame = s.frame[i], b.landmark = s.landmark[i];
    b.e = [=](const oracle_frame& f, const oracle_frame&, const Eigen::Vector3d& X) {
      const Eigen::Vector3d p = mount.R * (f.R * X + f.t) + mount.t;
      double x = p.x() / p.z(), y = p.y() / p.z();
      if (is_curved) {
        const double r = std::hypot(p.x(), p.y()), a = std::atan2(r, p.z()), q = a * a;
        const double d = a * (1 + q * (k[4] + q * (k[5] + q * (k[6] + q * k[7]))));
        x = d * p.x() / r, y = d * p.y() / r;
      }
      Eigen::VectorXd e(stereo ? 3 : 2);
      e[0] = k[0] * x + k[2] - z.x, e[1] = k[1] * y + k[3] - z.y;
      if (stereo) e[2] = k[0] * x + k[2] - bf / p.z() - z.z;
      return Eigen::VectorXd(sigma * e);
    };
    b.kernel = [=](double chi2, double& rho, double& weight) { huber_of(stereo ? 7.815 : 5.991, chi2, rho, weight); };
    o.blocks.push_back(b);
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

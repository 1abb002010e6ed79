// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the adjustment of a window of a local_scene must come to, with formulas of its own.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <vector>

#include "local_adjustment_cases.hpp"
#include "reference/adjustment_oracle.hpp"
#include "reference/local_adjustment_oracle.hpp"
#include "scenes/pointer_map.hpp"

namespace turbomap_test {

template <class Map>
oracle_sightings sightings_of(const local_scene<Map>& s) {
  using traits = turbomap::map_traits<Map>;
  oracle_sightings seen;
  for (const auto& k : s.keyframes) {
    if (!traits::alive(s.map, k)) continue;
    auto& points = seen[traits::id(s.map, k)];
    for (std::size_t i = 0; i < traits::keypoint_count(s.map, k); ++i) {
      const auto p = traits::point_at(s.map, k, i);
      if (!(p == typename traits::point{})) points[traits::id(s.map, p)].push_back(i);
    }
  }
  return seen;
}

/// The origin of a simple_map is its first keyframe; a pointer_map has none.
template <class Map>
std::optional<std::uint64_t> origin_of(const local_scene<Map>&) {
  if (std::is_same_v<Map, pointer_map>) return std::nullopt;
  return 0;
}

inline oracle_frame frame_of(const turbomap::rigid_transform<double>& T) {
  return {Eigen::Quaterniond(T.qw, T.qx, T.qy, T.qz).normalized().toRotationMatrix(), {T.tx, T.ty, T.tz}, {}};
}
inline bool same_pose(const turbomap::rigid_transform<double>& a, const turbomap::rigid_transform<double>& b) {
  return a.qx == b.qx && a.qy == b.qy && a.qz == b.qz && a.qw == b.qw && a.tx == b.tx && a.ty == b.ty && a.tz == b.tz;
}
inline bool same_place(const turbomap::vec3<double>& a, const turbomap::vec3<double>& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z;
}

/// What the adjustment of a window must come to, with formulas of its own. Ids are places in the scene.
struct expected_result {
  oracle_problem problem;
  std::vector<oracle_observation> observations;
};
template <class Map>
expected_result expect_adjusted(const local_scene<Map>& s, const oracle_sightings& seen, const oracle_window& w,
                                int iterations) {
  using traits = turbomap::map_traits<Map>;
  expected_result r;
  auto& o = r.problem;
  for (std::size_t f = 0; f < s.keyframes.size(); ++f) {
    o.frames.push_back(frame_of(traits::pose(s.map, s.keyframes[f])));
    o.frame_fixed.push_back(w.free.count(f) == 0);
  }
  for (std::size_t l = 0; l < s.points.size(); ++l) {
    const auto x = traits::position(s.map, s.points[l]);
    o.landmarks.emplace_back(x.x, x.y, x.z);
    o.landmark_fixed.push_back(w.points.count(l) == 0);
  }
  for (const auto& [f, points] : seen)
    for (const auto& [l, keypoints] : points)
      for (const std::size_t i : keypoints) {
        if (w.points.count(l) == 0) continue;
        const auto z = traits::keypoint(s.map, s.keyframes[f], i);
        const auto camera = s.rig[z.camera];
        const oracle_frame mount = frame_of(camera.T_camera_body);
        const bool stereo = z.u_right >= 0 && camera.bf > 0;
        oracle_block b;
        b.frame = static_cast<int>(f), b.landmark = static_cast<int>(l);
        b.e = [=](const oracle_frame& at, const oracle_frame&, const Eigen::Vector3d& X) {
          const Eigen::Vector3d p = mount.R * (at.R * X + at.t) + mount.t;
          const double u = static_cast<double>(camera.camera.fx) * p.x() / p.z() + 320;
          Eigen::VectorXd e(stereo ? 3 : 2);
          e[0] = u - static_cast<double>(z.x);
          e[1] = static_cast<double>(camera.camera.fy) * p.y() / p.z() + 240 - static_cast<double>(z.y);
          if (stereo) e[2] = u - camera.bf / p.z() - static_cast<double>(z.u_right);
          return Eigen::VectorXd(e / std::pow(1.2, z.octave));
        };
        b.kernel = [=](double chi2, double& rho, double& weight) {
          const double delta = std::sqrt(stereo ? 7.815 : 5.991), e = std::sqrt(chi2);
          rho = e <= delta ? chi2 : 2 * delta * e - delta * delta, weight = e <= delta ? 1 : delta / e;
        };
        o.blocks.push_back(b);
        r.observations.push_back({f, l, i, z.u_right >= 0 ? 2 : 1, false});
      }
  oracle_adjust(o, iterations);
  for (std::size_t i = 0; i < o.blocks.size(); ++i) {
    const auto& b = o.blocks[i];
    const auto e = o.residual(b);
    const double chi2 = e.squaredNorm(), gate = e.size() == 3 ? 7.815 : 5.991;
    REQUIRE(std::abs(chi2 - gate) > 1e-4);  // else rounding decides
    r.observations[i].outlier = chi2 > gate;
  }
  return r;
}

template <class Map>
double distance(const local_scene<Map>& s, const oracle_problem& o) {
  using traits = turbomap::map_traits<Map>;
  double d = 0;
  for (std::size_t f = 0; f < s.keyframes.size(); ++f) {
    const oracle_frame x = frame_of(traits::pose(s.map, s.keyframes[f]));
    d = std::max({d, (x.R - o.frames[f].R).cwiseAbs().maxCoeff(), (x.t - o.frames[f].t).cwiseAbs().maxCoeff()});
  }
  for (std::size_t l = 0; l < s.points.size(); ++l) {
    if (!traits::alive(s.map, s.points[l])) continue;
    const auto p = traits::position(s.map, s.points[l]);
    d = std::max(d, (Eigen::Vector3d(p.x, p.y, p.z) - o.landmarks[l]).cwiseAbs().maxCoeff());
  }
  return d;
}

}  // namespace turbomap_test

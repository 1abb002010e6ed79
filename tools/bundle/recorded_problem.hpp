// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reprojections with their rig: as they are recorded, as the library takes them, and what they cost, by one function.

#include <cmath>
#include <cstdint>
#include <type_traits>
#include <vector>

#include <turbomap/adjustment/factors.hpp>
#include <turbomap/adjustment/frames.hpp>
#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/camera/rig.hpp>
#include <turbomap/math/linear.hpp>
#include "readers/recording_snapshot_adjustment.hpp"

namespace turbomap_bundle {

template <class Camera>
struct rig_problem {
  std::vector<turbomap::rig_camera<Camera>> rig;
  turbomap::reprojection_data data;
  turbomap::rig_view<Camera> view() const { return {rig.data(), static_cast<int>(rig.size())}; }
};
template <class>
struct is_rig_problem : std::false_type {};
template <class Camera>
struct is_rig_problem<rig_problem<Camera>> : std::true_type {};

inline void set_camera(const std::vector<double>& p, turbomap::pinhole<double>& c) { c = {p[0], p[1], p[2], p[3]}; }
inline void set_camera(const std::vector<double>& p, turbomap::kannala_brandt<double>& c) {
  c = {p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]};
}

/// The recorded visual problem, in double.
template <class Camera>
rig_problem<Camera> recorded_problem(const turbomap::recording_meta& meta, const turbomap::adjustment_snapshot& s) {
  rig_problem<Camera> p;
  p.rig.resize(meta.camera2.empty() ? 1 : 2);
  set_camera(meta.camera1, p.rig[0].camera);
  if (p.rig.size() == 2) {
    set_camera(meta.camera2, p.rig[1].camera);
    p.rig[1].T_camera_body = turbomap::cast<double>(meta.T_rl);
  } else {
    p.rig[0].bf = meta.bf;
  }
  p.data = turbomap::problem_of(s);
  return p;
}

/// The observations as a factor group, views of `p`.
template <class Camera>
turbomap::reprojections<Camera> reprojections_of(const rig_problem<Camera>& p, turbomap::huber mono,
                                                 turbomap::huber stereo) {
  turbomap::reprojections<Camera> group;
  const auto& d = p.data;
  group.rig = p.view();
  group.frame = {d.frame.data(), d.frame.size()}, group.landmark = {d.landmark.data(), d.landmark.size()};
  group.pixel = {d.pixel.data(), d.pixel.size()}, group.information = {d.information.data(), d.information.size()};
  group.camera = {d.camera.data(), d.camera.size()};
  group.stereo = {d.stereo.data(), d.stereo.size()};
  group.mono_kernel = mono, group.stereo_kernel = stereo;
  return group;
}

/// Projects points behind a pinhole by its formula, as solvers do.
template <class Camera>
bool project_both_sides(const Camera& camera, const turbomap::vec3<double>& x, turbomap::vec2<double>& pixel) {
  if constexpr (turbomap::detail::has_as_pinhole<Camera>::value) {
    turbomap::pinhole<double> k;
    if (camera.as_pinhole(k)) {
      pixel = {k.fx * (x.x / x.z) + k.cx, k.fy * (x.y / x.z) + k.cy};
      return x.z != 0;
    }
  }
  return camera.project(x, pixel);
}

/// What an observation contributes to a cost: chi2, Huber's rho of it, depth in its camera (m).
struct observation_cost {
  double chi2, robust, depth;
};

/// Costs of every observation at any estimate, in float64, one after the other: the one judge of our results and of
/// others'. Deltas are [ORB-SLAM3]'s. An observation that its camera cannot project has a chi2 of infinity.
template <class Camera>
std::vector<observation_cost> observation_costs(const rig_problem<Camera>& p,
                                                const std::vector<turbomap::isometry<double>>& T_cw,
                                                const std::vector<turbomap::vec3<double>>& points) {
  const auto& d = p.data;
  std::vector<turbomap::isometry<double>> T_cb;
  for (const auto& c : p.rig) T_cb.push_back(turbomap::to_isometry<double>(c.T_camera_body));
  std::vector<observation_cost> costs(d.observation_count());
  for (std::size_t i = 0; i < costs.size(); ++i) {
    const std::size_t c = d.camera.empty() ? 0 : d.camera[i];
    const auto& seen = d.pixel[i];
    const auto x =
        T_cb[c] * (T_cw[static_cast<std::size_t>(d.frame[i])] * points[static_cast<std::size_t>(d.landmark[i])]);
    turbomap::vec2<double> pixel;
    const bool stereo = d.stereo[i] != 0;
    const double delta2 = stereo ? 7.815 : 5.991;
    double chi2 = HUGE_VAL;
    if (project_both_sides(p.rig[c].camera, x, pixel)) {
      const double u = pixel.x - seen.x, v = pixel.y - seen.y, w = stereo ? pixel.x - p.rig[c].bf / x.z - seen.z : 0;
      chi2 = d.information[i] * (u * u + v * v + w * w);
    }
    costs[i] = {chi2, chi2 <= delta2 ? chi2 : 2 * std::sqrt(delta2 * chi2) - delta2, x.z};
  }
  return costs;
}
inline double robust_sum(const std::vector<observation_cost>& costs) {
  double sum = 0;
  for (const auto& c : costs) sum += c.robust;
  return sum;
}

}  // namespace turbomap_bundle

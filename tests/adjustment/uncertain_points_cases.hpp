// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Frames to adjust to points that are known badly along the ray they were first seen on, with the covariances that say so.

#include <doctest/doctest.h>

#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "motion_only_cases.hpp"

namespace turbomap_test {

/// Points are off by up to metres along their rays and by centimetres across.
struct uncertain_frames {
  explicit uncertain_frames(scene_kind kind, int frames = 16, unsigned seed = 4)
      : exact(make_adjustment_scene(kind, frames, 0, 120, seed)), in(exact) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, 1);
    std::vector<turbomap::point_covariance> of_landmark;
    std::vector<vec3<double>> moved;
    for (const vec3<double>& p : exact.s.true_points) {
      const double along = 0.05 + 0.25 * std::abs(normal(random)), across = 0.01, a2 = along * along;
      const vec3<double> ray = (1 / turbomap::norm(p)) * p;
      const double x = across * normal(random), y = across * normal(random), z = across * normal(random);
      moved.push_back(p + (along * normal(random)) * ray + vec3<double>{x, y, z});
      const auto f = [](double v) { return static_cast<float>(v); };
      of_landmark.push_back({f(a2 * ray.x * ray.x + 1e-4), f(a2 * ray.y * ray.x), f(a2 * ray.y * ray.y + 1e-4),
                             f(a2 * ray.z * ray.x), f(a2 * ray.z * ray.y), f(a2 * ray.z * ray.z + 1e-4)});
    }
    std::size_t n = 0;
    for (std::size_t k = 0; k < exact.s.poses.size(); ++k)
      for (std::size_t i = 0; i < exact.s.frame.size(); ++i)
        if (exact.s.frame[i] == static_cast<int>(k)) {
          const auto l = static_cast<std::size_t>(exact.s.landmark[i]);
          in.point[n++] = moved[l], covariance.push_back(of_landmark[l]);
        }
  }
  template <class Policy>
  posed adjust(const Policy& policy, const motion_only_options& options = {}, bool with_covariance = true) const {
    turbomap::context<Policy> ctx{policy};
    turbomap::motion_only<scene_camera, Policy> one(ctx);
    auto view = in.view();
    if (with_covariance) view.covariance = covariance;
    posed p;
    one(ctx, view, options, p.frames, p.outlier);
    return p;
  }
  frames_input exact, in;
  std::vector<turbomap::point_covariance> covariance;  ///< [observation]
};

inline long count_outliers(const posed& p) { return std::count(p.outlier.begin(), p.outlier.end(), 1); }

/// With covariances poses are better than without, and few true observations are taken for outliers.
template <class Policy>
void check_uncertain_poses(const Policy& policy) {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    CAPTURE(static_cast<int>(kind));
    const uncertain_frames u(kind);
    const posed with = u.adjust(policy), without = u.adjust(policy, {}, false);
    const auto of_exact = static_cast<double>(count_outliers(adjust_poses(policy, u.exact)));
    CHECK(count_outliers(with) < 1.3 * of_exact);
    CHECK(count_outliers(without) > 1.5 * of_exact);
    double error = 0, error_without = 0;
    for (std::size_t f = 0; f < with.frames.size(); ++f) {
      CHECK(with.frames[f].adjusted == 1);
      error += pose_error(with.frames[f].T_cw, u.in.s.true_poses[f]);
      error_without += pose_error(without.frames[f].T_cw, u.in.s.true_poses[f]);
    }
    CHECK(error < error_without);
  }
}

/// Covariances of zero say what none says.
template <class Policy>
void check_exact_covariances(const Policy& policy) {
  uncertain_frames u(scene_kind::stereo);
  u.in = u.exact;
  u.covariance.assign(u.covariance.size(), {});
  const posed a = u.adjust(policy), b = u.adjust(policy, {}, false);
  CHECK(a.outlier == b.outlier);
  for (std::size_t f = 0; f < a.frames.size(); ++f) {
    CHECK(pose_error(a.frames[f].T_cw, b.frames[f].T_cw) < 1e-9);
    CHECK(a.frames[f].cost == doctest::Approx(b.frames[f].cost).epsilon(1e-9));
  }
}

/// Covariances that cannot be are refused.
template <class Policy>
void check_bad_covariances(const Policy& policy) {
  const uncertain_frames good(scene_kind::stereo);
  auto bad = good;
  bad.covariance.pop_back();
  CHECK_THROWS_AS(bad.adjust(policy), std::invalid_argument);
  bad = good, bad.covariance[3].zy = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_AS(bad.adjust(policy), std::invalid_argument);
  bad = good, bad.covariance[3].yy = -1;
  CHECK_THROWS_AS(bad.adjust(policy), std::invalid_argument);
}

}  // namespace turbomap_test

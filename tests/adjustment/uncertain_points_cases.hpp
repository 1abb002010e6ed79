// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Frames to adjust to points that are known badly along the ray they were first seen on, with the covariances that say so.

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include <turbomap/camera/point_uncertainty.hpp>

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

/// A camera that moves on from two near views, 0.1 m and 0.05 m apart: it sees points at 3 to 9 m, whose depths these views tell
/// to a seventh and to a third. One frame per trial.
struct steps_from_near_views {
  using camera = turbomap::pinhole<double>;

  explicit steps_from_near_views(double baseline, int trials = 200, int points = 40, unsigned seed = 7) {
    using turbomap::to_isometry;
    const double to_second[6] = {0, 0, 0, -baseline, 0, 0};
    const double to_third[6] = {0.01, 0.1, 0, -baseline - 0.2, 0.01, 0.02};
    views[1] = turbomap::left_exp(to_second, views[0]), views[2] = turbomap::left_exp(to_third, views[0]);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int t = 0; t < trials; ++t) {
      while (static_cast<int>(pixel.size()) < (t + 1) * points) {
        const double z = 6 + 3 * uniform(random);
        const vec3<double> X{0.7 * z * uniform(random), 0.5 * z * uniform(random), z};
        vec2<double> q[3];
        for (int k = 0; k < 3; ++k) {
          rig.camera.project(to_isometry<double>(views[k]) * X, q[k]);
          q[k].x += normal(random), q[k].y += normal(random);
        }
        add_point(X, q);
      }
      begin.push_back(static_cast<std::int32_t>(pixel.size()));
      guess.push_back(views[1]);
    }
  }
  /// Mean of the found steps along the true one, in true ones.
  template <class Policy>
  double mean_step(const Policy& policy, const motion_only_options& options = {}) const {
    turbomap::motion_only_input<camera> in;
    in.rig = {&rig, 1}, in.T_cw = guess, in.begin = begin;
    in.point = point, in.pixel = pixel, in.covariance = covariance;
    const std::vector<double> information(point.size(), 1);
    in.information = information;
    turbomap::context<Policy> ctx{policy};
    turbomap::motion_only<camera, Policy> adjust(ctx);
    posed p;
    adjust(ctx, in, options, p.frames, p.outlier);
    const auto step = [&](const rigid_transform<double>& T_cw) {
      return turbomap::camera_centre(turbomap::to_isometry<double>(T_cw)) -
             turbomap::camera_centre(turbomap::to_isometry<double>(views[1]));
    };
    double sum = 0;
    for (const auto& f : p.frames) sum += dot(step(f.T_cw), step(views[2])) / squared_norm(step(views[2]));
    return sum / static_cast<double>(p.frames.size());
  }

 private:
  /// From its pixels in the first two views, by Gauss and Newton from the truth; none where they tell no depth.
  void add_point(vec3<double> X, const vec2<double> (&q)[3]) {
    turbomap::symmetric3<double> information;
    for (int iteration = 0; iteration < 20; ++iteration) {
      information = {};
      vec3<double> b{};
      for (int k = 0; k < 2; ++k) {
        turbomap::projected_point<double> p;
        if (!project_point(rig.camera, turbomap::to_isometry<double>(views[k]), 0.0, X, p)) return;
        add_information(information, p, false, 1.0, 0.0);
        b = b + (q[k].x - p.pixel.x) * p.by_X[0] + (q[k].y - p.pixel.y) * p.by_X[1];
      }
      auto damped = information;
      add_to_diagonal(damped, 1e-3);
      X = X + inverse(damped, 1e-9) * b;
    }
    if (!(X.z > 0.5 && X.z < 100)) return;
    const auto C = covariance_from(information, X.z);
    const auto f = [](double v) { return static_cast<float>(v); };
    point.push_back(X), pixel.push_back({q[2].x, q[2].y, -1});
    covariance.push_back({f(C.xx), f(C.yx), f(C.yy), f(C.zx), f(C.zy), f(C.zz)});
  }

  turbomap::rig_camera<camera> rig{{435, 436, 367, 252}, {}, 0, {}};
  rigid_transform<double> views[3];
  std::vector<rigid_transform<double>> guess;
  std::vector<std::int32_t> begin{0};
  std::vector<vec3<double>> point, pixel;
  std::vector<turbomap::point_covariance> covariance;
};

/// Points that err do not make a camera's step shorter, as they would if they were weighed by covariance only.
template <class Policy>
void check_unbiased_step(const Policy& policy) {
  motion_only_options stay;
  stay.point_steps = 0;
  const steps_from_near_views seventh(0.1), third(0.05);
  CHECK(std::abs(seventh.mean_step(policy) - 1) < 0.02);
  CHECK(std::abs(third.mean_step(policy) - 1) < 0.06);
  CHECK(seventh.mean_step(policy, stay) < 0.85);
  CHECK(third.mean_step(policy, stay) < 0.6);
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

/// Observations of information 0 say nothing, with a covariance too: where their pixels are does not matter.
template <class Policy>
void check_no_information(const Policy& policy) {
  uncertain_frames here(scene_kind::stereo);
  for (std::size_t i = 0; i < here.in.information.size(); i += 5) here.in.information[i] = 0;
  auto there = here;
  for (std::size_t i = 0; i < there.in.pixel.size(); i += 5) there.in.pixel[i].x += 3, there.in.pixel[i].y -= 2;
  const posed a = here.adjust(policy), b = there.adjust(policy);
  for (std::size_t f = 0; f < a.frames.size(); ++f) {
    CHECK(a.frames[f].adjusted == 1);
    CHECK(b.frames[f].adjusted == 1);
    CHECK(pose_error(a.frames[f].T_cw, b.frames[f].T_cw) < 1e-12);
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
  motion_only_options options;
  options.point_steps = -1;
  CHECK_THROWS_AS(good.adjust(policy, options), std::invalid_argument);
  options = {}, options.point_sigmas = 0;
  CHECK_THROWS_AS(good.adjust(policy, options), std::invalid_argument);
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A point with a covariance as three more unknowns of a pose. A pose fitted to points as they are follows their errors: its
/// step comes out too short, as every regression on regressors that err (Fuller, Measurement Error Models, 1987, 1.1). So the
/// point moves to where its covariance and its new pixel agree best, for every pose that is tried, and the pose is fitted there.

#include "../camera/point_uncertainty.hpp"
#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/symmetric3.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The unknowns are a step in metres at the mean. Across the ray from a centre the point takes it as it is; along the ray it is
/// a step of the inverse distance, in which the error of a point seen by near views is normal (Civera et al., Inverse Depth
/// Parametrization for Monocular SLAM, 2008): with s = 1 - u.step / distance, u the ray's direction,
/// point = centre + (ray + step - u (u.step)) / s.
class uncertain_point {
 public:
  /// A point moves no farther away than so many times its distance: beyond lies infinity.
  static constexpr double farthest = 10;

  /// \param mean  the point as it is known, world, m   \param centre  where rays begin, near what saw the point
  TURBOMAP_HD uncertain_point(const vec3<double>& mean, const vec3<double>& centre)
      : centre_(centre), ray_(mean - centre), at_(mean) {
    constexpr double least = 1e-12;  // m^2: a point at the centre has no ray, and none is needed
    const double square = squared_norm(ray_);
    square_ = square > least ? square : least;
  }
  /// Where it is, world, m.
  TURBOMAP_HD const vec3<double>& at() const { return at_; }
  /// How it came there from the mean.
  TURBOMAP_HD const vec3<double>& step() const { return step_; }

  /// The derivative by the step, from that by the point, both here.
  TURBOMAP_HD vec3<double> by_step(const vec3<double>& by_point) const {
    const double turned = (dot(at_ - centre_, by_point) - dot(ray_, by_point)) / square_;
    return (1 / shrink_) * (by_point + turned * ray_);
  }
  /// Goes where this step from the mean leads.
  TURBOMAP_HD void go(const vec3<double>& step) {
    constexpr double most = 1 - 1 / farthest;
    double along = dot(step, ray_) / square_;
    const double fraction = along > most ? most / along : 1;
    step_ = fraction * step, along = fraction * along;
    shrink_ = 1 - along;
    at_ = centre_ + (1 / shrink_) * (ray_ + step_ - along * ray_);
  }

 private:
  vec3<double> centre_, ray_, at_, step_{};
  double square_, shrink_ = 1;
};

TURBOMAP_END_NAMESPACE

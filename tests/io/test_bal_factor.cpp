// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The factor of BAL cameras: its residual against the oracle, its derivatives against finite differences, conversions.

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <random>
#include <turbomap/io/bal_factor.hpp>
#include <turbomap/math/dual.hpp>

#include "reference/reprojection_cost.hpp"

namespace {

using turbomap::bal_camera;
using turbomap::bal_reprojection;
using state = turbomap::self_calibrated_state<double>;
using vec = turbomap::vec3<double>;

/// Cameras that look along -z at points 3 to 6 m ahead.
struct sample {
  std::mt19937 random{7};
  double uniform(double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); }
  bal_camera camera() {
    return {{uniform(-0.5, 0.5), uniform(-0.5, 0.5), uniform(-3, 3)},
            {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)},
            uniform(300, 900),
            uniform(-0.2, 0.2),
            uniform(-0.05, 0.05)};
  }
  vec point(const bal_camera& c) {
    const auto T = turbomap::to_isometry<double>(turbomap::bal_pose(c));
    return turbomap::inverse(T) * vec{uniform(-2, 2), uniform(-2, 2), uniform(-6, -3)};
  }
};

}  // namespace

TEST_CASE("the residual is that of the oracle") {
  sample s;
  for (int i = 0; i < 100; ++i) {
    turbomap::bal_problem p;
    p.cameras = {s.camera()}, p.points = {s.point(p.cameras[0])};
    p.camera = {0}, p.point = {0}, p.pixel = {{s.uniform(-100, 100), s.uniform(-100, 100)}};
    double e[2] = {0, 0};
    REQUIRE(bal_reprojection{}.residual(turbomap::bal_state(p.cameras[0]), p.points[0], p.pixel[0], e));
    const double cost = (e[0] * e[0] + e[1] * e[1]) / 2;
    CHECK(cost == doctest::Approx(turbomap_test::bal_cost(p)).epsilon(1e-12));
  }
}

TEST_CASE("derivatives are those of finite differences and of dual numbers") {
  sample s;
  for (int n = 0; n < 50; ++n) {
    const bal_camera camera = s.camera();
    state x = turbomap::bal_state(camera);
    const double by = 1 + 4e-4 * (n % 3 - 1);  // not quite of unit length, which problems take
    x.T_cw.qx *= by, x.T_cw.qy *= by, x.T_cw.qz *= by, x.T_cw.qw *= by;
    const vec X = s.point(camera);
    const bal_reprojection::row seen{s.uniform(-100, 100), s.uniform(-100, 100)};
    double e[2] = {}, d_frame[18] = {}, d_landmark[6] = {}, up[2] = {}, down[2] = {};
    REQUIRE(bal_reprojection{}.linearise(x, X, seen, e, d_frame, d_landmark));
    REQUIRE(bal_reprojection{}.residual(x, X, seen, up));
    CHECK(e[0] == doctest::Approx(up[0]).epsilon(1e-12));
    CHECK(e[1] == doctest::Approx(up[1]).epsilon(1e-12));
    for (int i = 0; i < 9; ++i) {
      const double h = 1e-6;
      double plus[9] = {}, minus[9] = {};
      plus[i] = h, minus[i] = -h;
      REQUIRE(bal_reprojection{}.residual(turbomap::self_calibrated_frame::retract<double>(x, plus), X, seen, up));
      REQUIRE(bal_reprojection{}.residual(turbomap::self_calibrated_frame::retract<double>(x, minus), X, seen, down));
      for (int k = 0; k < 2; ++k)
        CHECK(std::abs(d_frame[9 * k + i] - (up[k] - down[k]) / (2 * h)) < 1e-5 * (1 + std::abs(d_frame[9 * k + i])));
    }
    using dual = turbomap::dual<12>;
    dual step[9], r[2];
    for (int i = 0; i < 9; ++i) step[i] = dual::variable(0, i);
    const turbomap::vec3<dual> point{dual::variable(X.x, 9), dual::variable(X.y, 10), dual::variable(X.z, 11)};
    REQUIRE(bal_reprojection{}.residual(turbomap::self_calibrated_frame::retract<dual>(x, step), point, seen, r));
    for (int k = 0; k < 2; ++k) {
      for (int i = 0; i < 9; ++i) CHECK(d_frame[9 * k + i] == doctest::Approx(r[k].d[i]).epsilon(1e-9));
      for (int i = 0; i < 3; ++i) CHECK(d_landmark[3 * k + i] == doctest::Approx(r[k].d[9 + i]).epsilon(1e-9));
    }
  }
}

TEST_CASE("a landmark in the focal plane has no residual") {
  const state x = turbomap::bal_state({{0, 0, 0}, {0, 0, 0}, 500, 0, 0});
  double e[2] = {7, 7}, d_frame[18], d_landmark[6];
  CHECK_FALSE(bal_reprojection{}.residual(x, vec{1, 1, 0}, {0, 0}, e));
  CHECK_FALSE(bal_reprojection{}.linearise(x, vec{1, 1, 0}, {0, 0}, e, d_frame, d_landmark));
}

TEST_CASE("cameras survive the way to a state and back") {
  sample s;
  for (int i = 0; i < 100; ++i) {
    const bal_camera a = s.camera(), b = turbomap::bal_camera_of(turbomap::bal_state(a));
    const double w = std::sqrt(turbomap::squared_norm(a.rotation));
    if (w > 3.1) continue;
    CHECK(turbomap::norm(a.rotation - b.rotation) < 1e-12);
    CHECK(turbomap::norm(a.translation - b.translation) == 0);
    CHECK(a.f == b.f);
    CHECK(a.k1 == b.k1);
    CHECK(a.k2 == b.k2);
  }
  auto x = turbomap::bal_state({{0.1, 0.2, 0.3}, {0, 0, 0}, 1, 0, 0});
  x.T_cw = {-x.T_cw.qx, -x.T_cw.qy, -x.T_cw.qz, -x.T_cw.qw, 0, 0, 0};  // the same rotation
  CHECK(turbomap::norm(turbomap::bal_camera_of(x).rotation - vec{0.1, 0.2, 0.3}) < 1e-15);
  CHECK(turbomap::bal_camera_of(turbomap::bal_state({{0, 0, 0}, {0, 0, 0}, 1, 0, 0})).rotation.x == 0);
}

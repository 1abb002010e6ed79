// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Errors of u and u_right that are not independent: chi2 by the inverse of the covariance, derivatives by differences,
// and better poses where the noise is such.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <turbomap/adjustment/reprojection.hpp>

#include "mapping/local_adjustment_cases.hpp"
#include "stereo_correlation_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using namespace turbomap;

TEST_CASE("the third row: its square, its derivatives; without correlation as if there were none, to the bit") {
  const rig_camera<pinhole<double>> mounted{
      {458.6, 457.3, 320.2, 238.4}, {0.1, 0, 0, std::sqrt(0.99), 0.1, 0, 0}, 47.9, {}};
  using row = lane_reprojection<double, double, 1>;
  const auto at = [&](const vec3<double>& X, double r) {
    row out;
    out.compute<true, true>(adjustment_camera<pinhole<double>>(mounted, r),
                            vec3<pack<double, 1>>{pack<double, 1>(X.x), pack<double, 1>(X.y), pack<double, 1>(X.z)},
                            vec3<pack<double, 1>>{pack<double, 1>(301), pack<double, 1>(210), pack<double, 1>(283)});
    return out;
  };
  const auto e = [](const row& r, int k) { return r.e[k].v[0]; };
  const vec3<double> X{0.3, -0.2, 2.7};
  const row plain = at(X, 0);
  const vec3<double> p = to_isometry<double>(mounted.T_camera_body) * X;
  CHECK(e(plain, 2) == doctest::Approx(458.6 * p.x / p.z + 320.2 - 47.9 / p.z - 283).epsilon(1e-12));
  for (const double r : {0.5, 0.875, 0.99}) {
    const row now = at(X, r);
    for (int k = 0; k < 2; ++k) CHECK(e(now, k) == e(plain, k));
    const double u = e(plain, 0), w = e(plain, 2);
    CHECK(u * u + e(now, 2) * e(now, 2) ==
          doctest::Approx((u * u - 2 * r * u * w + w * w) / (1 - r * r)).epsilon(1e-12));
    for (int i = 0; i < 3; ++i) {
      vec3<double> up = X, down = X;
      const double h = 1e-6;
      (i == 0 ? up.x : i == 1 ? up.y : up.z) += h, (i == 0 ? down.x : i == 1 ? down.y : down.z) -= h;
      for (int k = 0; k < 3; ++k)
        CHECK(std::abs(now.d[k][i].v[0] - (e(at(up, r), k) - e(at(down, r), k)) / (2 * h)) < 1e-4);
    }
  }
}

TEST_CASE_TEMPLATE("chi2 and cost of an adjustment are those of the covariance", Policy, TURBOMAP_TEST_POLICIES) {
  check_correlated_adjustment(Policy{});
}

TEST_CASE_TEMPLATE("a weak link is estimated better", Policy, TURBOMAP_TEST_POLICIES) { check_weak_link(Policy{}); }

TEST_CASE_TEMPLATE("poses alone: outliers by the covariance", Policy, TURBOMAP_TEST_POLICIES) {
  check_correlated_poses(Policy{});
}

TEST_CASE("an adjustment of a map passes it on, and refuses what is none") {
  local_scene<flat_map> plain, correlated, bad;
  local_adjustment_options options;
  const double independent = adjust_around(thrust::seq, plain, 5, options).solve.cost_final;
  options.stereo_correlation = 0.98;  // these errors are independent: they look ten times as large now
  CHECK(adjust_around(thrust::seq, correlated, 5, options).solve.cost_final > 1.5 * independent);
  CHECK(plain.state() != correlated.state());
  const std::string before = bad.state();
  options.stereo_correlation = 1;
  CHECK_THROWS_WITH_AS(adjust_around(thrust::seq, bad, 5, options), doctest::Contains("options.stereo_correlation"),
                       std::invalid_argument);
  CHECK(bad.state() == before);
}

TEST_CASE_TEMPLATE("a correlation that is none is refused", Policy, TURBOMAP_TEST_POLICIES) {
  check_bad_correlations(Policy{});
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Rows that keep their cost and pull at nothing: where the derivative of a camera is not finite.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "adjustment_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_options;
using turbomap::span;
using turbomap_test::sequential;

/// Pixels by the angle from the axis, where the derivative is 0 / 0.
struct axis_camera {
  using scalar = double;
  template <class S>
  TURBOMAP_HD bool project(const vec3<S>& p, vec2<S>& pixel) const {
    using std::atan2;
    using std::sqrt;
    const S r = sqrt(p.x * p.x + p.y * p.y), scale = r > S(0) ? atan2(r, p.z) / r : S(1) / p.z + S(0) * r;
    pixel.x = S(400) + S(300) * scale * p.x, pixel.y = S(300) * scale * p.y;
    return p.z > S(0);
  }
  template <class S>
  TURBOMAP_HD bool unproject(const vec2<S>&, vec3<S>&) const {
    return false;
  }
  void validate() const {}
};

TEST_CASE("a camera whose derivative is not finite somewhere: one cost, with and without derivatives") {
  for (const double bf : {0.0, 40.0}) {
    CAPTURE(bf);
    auto s = make_adjustment_scene(scene_kind::mono, 4, 1, 30, 3);
    s.poses[0] = {};
    s.points[3] = {0, 0, 6};  // on the axis of the first frame, which does not move
    turbomap::rig_camera<axis_camera> camera{};
    camera.bf = bf;
    for (std::size_t i = 0; i < s.frame.size(); ++i) {
      const auto p = turbomap::to_isometry<double>(s.true_poses[static_cast<std::size_t>(s.frame[i])]) *
                     s.true_points[static_cast<std::size_t>(s.landmark[i])];
      vec2<double> q{};
      REQUIRE(axis_camera{}.project(p, q));
      s.pixel[i] = {q.x, q.y, bf > 0 ? q.x - bf / p.z : -1};
    }
    auto g = turbomap::huber_reprojections(turbomap::rig_view<axis_camera>{&camera, 1});
    g.frame = span<const std::int32_t>(s.frame), g.landmark = span<const std::int32_t>(s.landmark);
    g.pixel = span<const vec3<double>>(s.pixel), g.information = span<const double>(s.information);
    turbomap::context<sequential> ctx{sequential{}};
    turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<axis_camera>> problem(ctx);
    problem.assign(ctx, s.frame_input(), s.landmark_input(), g);
    std::vector<double> chi2, depth;
    problem.chi2<0>(ctx, chi2, depth);
    double cost = 0;
    const turbomap::huber kernel = bf > 0 ? g.stereo_kernel : g.mono_kernel;
    for (const double x : chi2) {
      double rho = 0, weight = 0;
      kernel(x, rho, weight), cost += rho;
    }
    for (const int iterations : {0, 1, 6}) {
      CAPTURE(iterations);
      adjustment_options options = in_float64();
      options.max_iterations = iterations;
      problem.assign(ctx, s.frame_input(), s.landmark_input(), g);
      const auto summary = turbomap::adjust<float64_methods>(ctx, problem, options);
      CHECK(summary.cost_initial == doctest::Approx(cost).epsilon(1e-12));
      CHECK(summary.undefined == 0);
      CHECK(summary.accepted == iterations);
    }
  }
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Adjustment around a keyframe on a device: the map that the host leaves, within rounding, and the same bits each time.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <turbomap/map/validate.hpp>

#include <atomic>
#include <type_traits>

#include "local_adjustment_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_end;
using sequential = std::decay_t<decltype(thrust::seq)>;

TEST_CASE("windows one after the other: as on the host") {
  const stream on;
  local_recipe recipe;
  recipe.outliers = 0.05;
  local_scene<flat_map> host(recipe), a(recipe), b(recipe);
  turbomap::local_adjustment_options options;
  options.min_shared_points = 40, options.solve.numbers = turbomap::precision::float64;
  for (const std::size_t current : {9, 4, 6, 2}) {
    const auto expected = adjust_around(sequential{}, host, current, options);
    const auto summary = adjust_around(on.policy(), a, current, options);
    adjust_around(on.policy(), b, current, options);
    CHECK(summary.free_keyframes == expected.free_keyframes);
    CHECK(summary.observations == expected.observations);
    CHECK(summary.outliers == expected.outliers);
    CHECK(summary.points_erased == expected.points_erased);
    CHECK(summary.solve.cost_final == doctest::Approx(expected.solve.cost_final).epsilon(1e-9));
    CHECK(a.state() == b.state());
    CHECK(turbomap::validate(a.map).empty());
    for (std::size_t f = 0; f < a.keyframes.size(); ++f) {
      const auto &x = a.map.T_cw(a.keyframes[f]), &y = host.map.T_cw(host.keyframes[f]);
      CHECK(std::abs(x.tx - y.tx) + std::abs(x.ty - y.ty) + std::abs(x.tz - y.tz) < 1e-7);
      CHECK(std::abs(x.qx - y.qx) + std::abs(x.qy - y.qy) + std::abs(x.qz - y.qz) < 1e-7);
    }
    for (std::size_t l = 0; l < a.points.size(); ++l) {
      REQUIRE(a.map.alive(a.points[l]) == host.map.alive(host.points[l]));
      if (!a.map.alive(a.points[l])) continue;
      const auto &x = a.map.position(a.points[l]), &y = host.map.position(host.points[l]);
      CHECK(std::abs(x.x - y.x) + std::abs(x.y - y.y) + std::abs(x.z - y.z) < 1e-6);
    }
  }
}

TEST_CASE("stopped before it began: the map stays") {
  const stream on;
  local_scene<flat_map> s;
  const auto before = s.state();
  const std::atomic<bool> stop{true};
  turbomap::local_adjustment_options options;
  options.solve.stop = &stop;
  CHECK(adjust_around(on.policy(), s, 5, options).solve.end == adjustment_end::stopped);
  CHECK(s.state() == before);
}

}  // namespace

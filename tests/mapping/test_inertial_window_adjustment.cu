// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Inertial adjustment of a map on a device: the map that the host leaves, within rounding, and the same bits each time.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <turbomap/map/validate.hpp>

#include <type_traits>

#include "inertial_adjustment_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using sequential = std::decay_t<decltype(thrust::seq)>;

TEST_CASE("windows one after the other: as on the host") {
  const stream on;
  inertial_recipe recipe;
  recipe.outliers = 0.05;
  inertial_map_scene host(recipe), a(recipe), b(recipe);
  turbomap::local_adjustment_options options;
  options.solve.numbers = turbomap::precision::float64;
  for (const int current : {7, 10, 13}) {
    const auto expected = inertial_run<sequential>(sequential{}, host)(current, options);
    const auto summary = inertial_run<std::decay_t<decltype(on.policy())>>(on.policy(), a)(current, options);
    inertial_run<std::decay_t<decltype(on.policy())>>(on.policy(), b)(current, options);
    CHECK(summary.inertial_edges == expected.inertial_edges);
    CHECK(summary.observations == expected.observations);
    CHECK(summary.outliers == expected.outliers);
    CHECK(summary.solve.cost_final == doctest::Approx(expected.solve.cost_final).epsilon(1e-9));
    CHECK(a.state() == b.state());
    CHECK(turbomap::validate(a.map).empty());
    for (std::size_t f = 0; f < a.keyframes.size(); ++f) {
      const auto &x = a.map.T_cw(a.keyframes[f]), &y = host.map.T_cw(host.keyframes[f]);
      CHECK(std::abs(x.tx - y.tx) + std::abs(x.ty - y.ty) + std::abs(x.tz - y.tz) < 1e-6);
      CHECK(turbomap::norm(a.map.velocity(a.keyframes[f]) - host.map.velocity(host.keyframes[f])) < 1e-6);
    }
  }
}

}  // namespace

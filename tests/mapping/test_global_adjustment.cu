// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Adjustment of a whole map on a device: the map that the host leaves, within rounding, and the same bits each time.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <turbomap/map/validate.hpp>

#include <cmath>
#include <type_traits>

#include "local_adjustment_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("with every solver: as on the host") {
  const stream on;
  local_recipe recipe;
  recipe.outliers = 0.05;
  for (const auto solver :
       {turbomap::reduced_solver::dense, turbomap::reduced_solver::sparse, turbomap::reduced_solver::pcg}) {
    CAPTURE(turbomap::to_string(solver));
    turbomap::global_adjustment_options options;
    options.solve.numbers = turbomap::precision::float64, options.solve.solver = solver;
    options.solve.min_relative_decrease = 1e-9, options.solve.pcg_tolerance = 1e-10;
    local_scene<flat_map> host(recipe), a(recipe), b(recipe);
    const auto expected = adjust_globally(std::decay_t<decltype(thrust::seq)>{}, host, 4, options);
    const auto summary = adjust_globally(on.policy(), a, 4, options);
    adjust_globally(on.policy(), b, 4, options);
    CHECK(summary.free_keyframes == expected.free_keyframes);
    CHECK(summary.observations == expected.observations);
    CHECK(summary.outliers == expected.outliers);
    CHECK(summary.outliers > 0);
    CHECK(summary.solve.cost_final == doctest::Approx(expected.solve.cost_final).epsilon(1e-7));
    CHECK(a.state() == b.state());
    CHECK(turbomap::validate(a.map).empty());
    for (std::size_t f = 0; f < a.keyframes.size(); ++f) {
      const auto &x = a.map.T_cw(a.keyframes[f]), &y = host.map.T_cw(host.keyframes[f]);
      CHECK(std::abs(x.tx - y.tx) + std::abs(x.ty - y.ty) + std::abs(x.tz - y.tz) < 1e-6);
    }
  }
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Recorded local bundle adjustments on a device: as good as the peer's, what the host computes within rounding, and
/// the same bits each time; all solvers and kinds of numbers.

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <cmath>

#include "adjustment/adjustment_results.hpp"
#include "recorded_adjustment_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::precision;
using turbomap::reduced_solver;

void check_repeated(const recorded_result& a, const recorded_result& again) {
  CHECK(same_bits(a.summary, again.summary));
  CHECK(same_bits(a.poses, again.poses));
  CHECK(same_bits(a.points, again.points));
  CHECK(same_bits(a.chi2, again.chi2));
  CHECK(same_bits(a.depth, again.depth));
}

void check_as_host(const recorded_result& a, const recorded_result& host) {
  CHECK(std::abs(a.summary.cost_final - host.summary.cost_final) <= 1e-9 * host.summary.cost_final);
  CHECK(distance(a.poses, host.poses) <= 1e-9);
  CHECK(distance(a.points, host.points) <= 1e-9);
  CHECK(a.summary.iterations == host.summary.iterations);
  CHECK(a.summary.accepted == host.summary.accepted);
  CHECK(a.summary.undefined == host.summary.undefined);
  CHECK(a.outlier == host.outlier);
}
/// Normal equations in float32. Points are not compared: the depth of a far one hardly matters to the cost, and is
/// rounded by centimetres.
void check_near_host(const recorded_result& a, const recorded_result& host) {
  CHECK(std::abs(a.summary.cost_final - host.summary.cost_final) <= 1e-5 * host.summary.cost_final);
  CHECK(distance(a.poses, host.poses) <= 1e-3);
}

TEST_CASE("recorded problems are adjusted as well as by the peer") {
  const stream on;
  for_each_recording([&](auto camera, const turbomap::recording& r, const std::filesystem::path& directory) {
    using model = decltype(camera);
    check_as_good_as_peer<model>(r, directory, on.policy(), precision::float64);
    check_as_good_as_peer<model>(r, directory, on.policy(), precision::mixed);
  });
}

TEST_CASE("every solver and kind of numbers: as on the host, and the same bits each time") {
  const stream on;
  for_each_recording([&](auto camera, const turbomap::recording& r, const std::filesystem::path& directory) {
    using model = decltype(camera);
    const auto compare = [&](const auto& problem, turbomap::adjustment_options options) {
      options.pcg_tolerance = 1e-13;
      for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg})
        for (const auto numbers : {precision::float64, precision::mixed, precision::float32}) {
          CAPTURE(static_cast<int>(solver));
          CAPTURE(static_cast<int>(numbers));
          options.solver = solver, options.numbers = numbers;
          const auto a = adjust_recorded(on.policy(), problem, options);
          check_repeated(a, adjust_recorded(on.policy(), problem, options));
          const auto host = adjust_recorded(thrust::seq, problem, options);
          CHECK(host.summary.cost_final < host.summary.cost_initial);
          if (numbers == precision::float64)
            check_as_host(a, host);
          else
            check_near_host(a, host);
        }
    };
    CHECK(for_each_recorded_problem<model>(r, directory, compare) > 0);
  });
}

}  // namespace

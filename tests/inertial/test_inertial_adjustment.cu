// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Visual-inertial problems on a device: what the host computes within rounding, and the same bits each time.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "inertial_scene.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::precision;
using turbomap::reduced_solver;
using methods = turbomap::adjustment_methods<turbomap::solver_list<reduced_solver::dense, reduced_solver::pcg>,
                                             turbomap::precision_list<precision::float64, precision::mixed>>;

struct adjusted {
  turbomap::adjustment_summary summary;
  std::vector<inertial_state<double>> states;
};

template <class Policy>
adjusted adjust_scene(const Policy& policy, const inertial_scene& s, const turbomap::adjustment_options& options) {
  turbomap::context<Policy> ctx{policy};
  inertial_problem<Policy> problem(ctx);
  s.assign(ctx, problem, inertial_factor{});
  adjusted a;
  a.summary = turbomap::adjust<methods>(ctx, problem, options);
  problem.frames(ctx, a.states);
  if constexpr (!turbomap::is_host_accessible_v<turbomap::memory_of_t<Policy>>)
    CHECK(problem.structure().groups_elsewhere);  // the device made the lists
  return a;
}

TEST_CASE("as on the host, and the same bits each time; held unknowns stay") {
  const stream on;
  auto s = make_inertial_scene(8, 40, 5);
  s.held.assign(8, 0);
  s.held[3] = inertial_frame::hold_velocity;
  for (const auto numbers : {precision::float64, precision::mixed})
    for (const auto solver : {reduced_solver::dense, reduced_solver::pcg}) {
      CAPTURE(static_cast<int>(numbers));
      CAPTURE(static_cast<int>(solver));
      turbomap::adjustment_options options;
      options.numbers = numbers, options.solver = solver, options.pcg_tolerance = 1e-12, options.max_iterations = 4;
      const auto a = adjust_scene(on.policy(), s, options), b = adjust_scene(on.policy(), s, options);
      const auto host = adjust_scene(thrust::seq, s, options);
      CHECK(std::memcmp(a.states.data(), b.states.data(), a.states.size() * sizeof(a.states[0])) == 0);
      CHECK(std::memcmp(&a.states[3].velocity, &s.states[3].velocity, sizeof(s.states[3].velocity)) == 0);
      const double relative = numbers == precision::float64 ? 1e-9 : 1e-4;
      CHECK(std::abs(a.summary.cost_final - host.summary.cost_final) <= relative * host.summary.cost_final);
      CHECK(a.summary.undetermined == host.summary.undetermined);
      for (std::size_t f = 0; f < a.states.size() && numbers == precision::float64; ++f)
        CHECK(std::abs(a.states[f].velocity.x - host.states[f].velocity.x) < 1e-7);
    }
}

}  // namespace

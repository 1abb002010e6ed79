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

#include "adjustment/adjustment_results.hpp"
#include "inertial_scene.hpp"
#include "support/stream.cuh"
#include "undetermined_cases.hpp"

namespace {

using namespace turbomap_test;
using turbomap::precision;
using turbomap::reduced_solver;

struct adjusted {
  turbomap::adjustment_summary summary;
  std::vector<inertial_state<double>> states;
  std::vector<vec3<double>> points;
};

template <class Policy>
adjusted adjust_scene(const Policy& policy, const inertial_scene& s, const turbomap::adjustment_options& options) {
  turbomap::context<Policy> ctx{policy};
  inertial_problem<Policy> problem(ctx);
  s.assign(ctx, problem, inertial_factor{});
  adjusted a;
  a.summary = turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, options);
  if constexpr (!turbomap::is_host_accessible_v<turbomap::memory_of_t<Policy>>)
    CHECK(problem.structure().groups_elsewhere);  // the device made the lists
  problem.frames(ctx, a.states), problem.landmarks(ctx, a.points);
  return a;
}

TEST_CASE("every solver in every precision: as on the host, and the same bits each time; held unknowns stay") {
  const stream on;
  auto s = make_inertial_scene(8, 40, 5);
  SUBCASE("all unknowns") {}
  SUBCASE("some are held") {
    s.held.assign(8, 0);
    s.held[3] = inertial_frame::hold_velocity, s.held[5] = 1U << 4 | 1U << 12;
  }
  for (const auto numbers : {precision::float64, precision::mixed, precision::float32})
    for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg}) {
      CAPTURE(static_cast<int>(numbers));
      CAPTURE(static_cast<int>(solver));
      turbomap::adjustment_options options;
      options.numbers = numbers, options.solver = solver, options.pcg_tolerance = 1e-12, options.max_iterations = 4;
      const auto a = adjust_scene(on.policy(), s, options), b = adjust_scene(on.policy(), s, options);
      const auto host = adjust_scene(thrust::seq, s, options);
      CHECK(same_bits(a.summary, b.summary));
      CHECK(same_bits(a.states, b.states));
      CHECK(same_bits(a.points, b.points));
      // mixed: float32 rounds derivatives otherwise than on the host, and four iterations do not end at the optimum, where
      // that would not matter: 2.4e-6 was measured. float32: residuals of pixels too.
      const double relative = numbers == precision::float64 ? 1e-9 : numbers == precision::mixed ? 1e-5 : 1e-4;
      CHECK(a.summary.accepted == 4);
      CHECK(std::abs(a.summary.cost_initial - host.summary.cost_initial) <= 0.1 * relative * host.summary.cost_initial);
      CHECK(std::abs(a.summary.cost_final - host.summary.cost_final) <= relative * host.summary.cost_final);
      CHECK((a.summary.each[0].linear_iterations > 0) == (solver == reduced_solver::pcg));
      CHECK(a.summary.undetermined == 0);
      for (std::size_t f = 0; f < a.states.size() && numbers == precision::float64; ++f) {
        CHECK(std::abs(a.states[f].velocity.x - host.states[f].velocity.x) < 1e-7);
        CHECK(std::abs(a.states[f].T_cw.tx - host.states[f].T_cw.tx) < 1e-7);
      }
      if (s.held.empty()) continue;
      CHECK(std::memcmp(&a.states[3].velocity, &s.states[3].velocity, sizeof(s.states[3].velocity)) == 0);
      CHECK(a.states[5].bias.acceleration.x == s.states[5].bias.acceleration.x);
      CHECK(a.states[5].bias.acceleration.y != s.states[5].bias.acceleration.y);
    }
}

TEST_CASE("a velocity that nothing touches is counted, and stays") { check_untouched_velocity(stream{}.policy()); }
TEST_CASE("a heading that is free has all frames in common: none of its unknowns is counted") {
  check_free_heading(stream{}.policy());
}
TEST_CASE("two frames that are joined to each other only: none of their unknowns is counted") {
  check_untied_edge(stream{}.policy());
}
TEST_CASE("a frame with one landmark: none of its unknowns is counted; with none, all are") {
  check_one_landmark(stream{}.policy());
}

}  // namespace

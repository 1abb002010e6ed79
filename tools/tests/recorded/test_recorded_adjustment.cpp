// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Recorded local bundle adjustments: their costs and outliers, recomputed by the oracle, are those of the peer; and ours end
// where the peer's did.

#include <turbomap/io/recording.hpp>
#include "readers/recording_snapshot_adjustment.hpp"

#include <thrust/execution_policy.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "reference/recorded_cost_rig.hpp"
#include "reference/reprojection_cost.hpp"
#include "support/policies.hpp"
#include "support/support.hpp"
#include "tests/recorded_adjustment_cases.hpp"

namespace {

using namespace turbomap_test;

double huber_sum(const std::vector<observation_cost>& costs) {
  double sum = 0;
  for (const auto& o : costs) sum += o.robust;
  return sum;
}

TEST_CASE("recorded costs and outliers are those of the recorded poses and points") {
  for (const char* name : {"euroc_v102_stereo", "euroc_v102_inertial", "tum_room1_stereo", "tum_room1_inertial"}) {
    const auto directory = data(std::string("recordings/") + name);
    if (!directory) return;
    const auto r = turbomap::read_recording(*directory);
    const auto rig = recorded_cost_rig(r.meta);
    int visual = 0;
    for (const auto iteration : r.meta.snapshots) {
      CAPTURE(std::string(name));
      CAPTURE(iteration);
      const auto s = turbomap::read_adjustment_snapshot(r, *directory, iteration);
      REQUIRE(s.has_value());
      if (s->inertial) continue;
      ++visual;
      auto d = turbomap::problem_of(*s);
      const double before = huber_sum(observation_costs(d, rig, 5.991, 7.815));
      CHECK(std::abs(before - s->robust_cost_before) < 1e-6 * s->robust_cost_before);

      for (std::size_t i = 0; i < d.T_cw.size(); ++i) d.T_cw[i] = turbomap::cast<double>(s->T_cw_after[i]);
      d.points = s->position_after_exact;
      const auto after = observation_costs(d, rig, 5.991, 7.815);
      CHECK(std::abs(huber_sum(after) - s->robust_cost_after) < 1e-6 * s->robust_cost_after);
      std::size_t differ = 0;
      for (std::size_t i = 0; i < after.size(); ++i) {
        const bool stereo = s->kind[i] == turbomap::recorded_residual::stereo;
        const bool outlier = s->chi2_after[i] > (stereo ? 7.815 : 5.991) || s->depth_positive[i] == 0;
        CHECK(outlier == (s->outlier[i] != 0));
        differ += (after[i].chi2 > (stereo ? 7.815 : 5.991) || !(after[i].depth > 0)) != (s->outlier[i] != 0) ? 1 : 0;
      }
      CHECK(differ == 0);
    }
    CHECK(visual > 0);
  }
}

TEST_CASE("recorded problems are adjusted as well as by the peer") {
  using turbomap::precision;
  for_each_recording([](auto camera, const turbomap::recording& r, const std::filesystem::path& directory) {
    using model = decltype(camera);
    check_as_good_as_peer<model>(r, directory, thrust::seq, precision::float64);
    check_as_good_as_peer<model>(r, directory, thrust::seq, precision::mixed);
    turbomap_test::for_each_parallel_policy(
        [&](auto policy) { check_as_good_as_peer<model>(r, directory, policy, precision::float64); });
  });
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Recorded preintegrations made again from the raw samples, and that the check sees each part that is changed.

#include <thrust/execution_policy.h>

#include <functional>
#include <string>
#include <type_traits>
#include <vector>

#include "recorded_checks.hpp"
#include "replay/check_preintegration.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::recorded_preintegration;

TEST_CASE_TEMPLATE("recorded preintegrations are reproduced from the raw samples", Policy, TURBOMAP_TEST_POLICIES) {
  for (const char* name : {"euroc_v102_inertial", "tum_room1_inertial"}) {
    const auto directory = data(std::string("recordings/") + name);
    if (!directory) continue;
    const auto r = turbomap::read_recording(*directory);
    turbomap_replay::preintegration_check<Policy> check(r, *directory, Policy{});
    for (const auto iteration : r.meta.snapshots) check.check(iteration);
    nlohmann::json json;
    check.add_json(json);
    MESSAGE(std::string(name) << ": " << json.dump());
    CHECK(check.good());
    CHECK(number(json["preintegration"], "edges") > 70);
  }
}

TEST_CASE("the check of preintegration sees each part that is changed") {
  const auto directory = data("recordings/tum_room1_inertial");
  if (!directory) return;
  const auto r = turbomap::read_recording(*directory);
  const auto recorded = turbomap::read_preintegration_snapshot(r, *directory, r.meta.snapshots.back());
  const auto good = [&](const std::function<void(recorded_preintegration&)>& change) {
    turbomap_replay::preintegration_check<sequential> check(r, *directory, sequential{});
    auto changed = recorded;
    change(changed[3]);
    check.check(changed);
    return check.good();
  };
  const float factor = 1.00003F;
  CHECK(good([](recorded_preintegration&) {}));
  CHECK_FALSE(good([&](auto& p) { p.dT *= factor; }));
  CHECK_FALSE(good([&](auto& p) { p.dV.z *= factor; }));
  CHECK_FALSE(good([&](auto& p) { p.dP.z += 1e-4F; }));
  CHECK_FALSE(good([&](auto& p) { p.dR(0, 1) += 1e-4F; }));
  CHECK_FALSE(good([&](auto& p) { p.J_Pg(1, 1) += 1e-3F; }));
  CHECK_FALSE(good([&](auto& p) { p.C[0] *= 1.01F; }));
  CHECK_FALSE(good([&](auto& p) { p.C[16 * 14] *= factor; }));
  CHECK_FALSE(good([&](auto& p) { p.bias[4] += 1e-3F; }));
  CHECK_FALSE(good([](auto& p) { --p.from; }));
}

}  // namespace

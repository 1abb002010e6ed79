// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Recorded visual-inertial adjustments end where the peer's did, and cost at the start what the peer says.

#include <thrust/execution_policy.h>

#include <string>

#include "recorded_checks.hpp"
#include "replay/check_inertial_adjustment.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;

template <class Camera>
void check_all(const turbomap::recording& r, const std::filesystem::path& directory) {
  for (const auto numbers : {turbomap::precision::float64, turbomap::precision::mixed}) {
    turbomap_replay::inertial_adjustment_check<Camera, sequential> check(r, directory, sequential{}, numbers, 1);
    for (const auto iteration : r.meta.snapshots) check.check(iteration);
    nlohmann::json json;
    check.add_json(json);
    MESSAGE(json.dump());
    CHECK(check.good());
    CHECK(number(json["inertial_adjustment"], "problems") >= 3);
    CHECK(number(json["inertial_adjustment"], "cost_before_error") < 1e-5);
  }
}

TEST_CASE("recorded visual-inertial adjustments are reproduced") {
  for (const char* name : {"euroc_v102_inertial", "tum_room1_inertial"}) {
    const auto directory = data(std::string("recordings/") + name);
    if (!directory) continue;
    const auto r = turbomap::read_recording(*directory);
    if (r.meta.is_fisheye())
      check_all<turbomap::kannala_brandt<float>>(r, *directory);
    else
      check_all<turbomap::pinhole<float>>(r, *directory);
  }
}

}  // namespace

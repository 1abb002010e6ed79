// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Names of the stages, statistics of times, times of a guard.

#include <doctest/doctest.h>

#include <turbomap/mapping/duration_statistics.hpp>
#include <turbomap/mapping/mapping_report.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace {

using turbomap::mapping_stage;

TEST_CASE("the stages have the names of the command-line contract, in their order") {
  const char* const names[] = {"process", "point_culling", "search",          "creation",
                               "fusion",  "adjustment",    "keyframe_culling"};
  REQUIRE(turbomap::mapping_stages == 7);
  for (std::size_t s = 0; s < turbomap::mapping_stages; ++s)
    CHECK(std::string(turbomap::to_string(static_cast<mapping_stage>(s))) == names[s]);
}

TEST_CASE("what became of a stage has a name") {
  const char* const names[] = {"off", "done", "skipped", "cut", "refused"};
  for (std::size_t o = 0; o < 5; ++o)
    CHECK(std::string(turbomap::to_string(static_cast<turbomap::stage_outcome>(o))) == names[o]);
}

TEST_CASE("one value per stage") {
  turbomap::per_stage<int> values;
  for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) CHECK(values[static_cast<mapping_stage>(s)] == 0);
  values[mapping_stage::fusion] = 3;
  const auto& constant = values;
  CHECK(constant[mapping_stage::fusion] == 3);
  CHECK(constant[mapping_stage::creation] == 0);
  CHECK(constant[mapping_stage::adjustment] == 0);
}

TEST_CASE("a fresh report says that nothing was done") {
  const turbomap::mapping_report report;
  for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) {
    CHECK(report.outcome[static_cast<mapping_stage>(s)] == turbomap::stage_outcome::off);
    CHECK(report.ms[static_cast<mapping_stage>(s)] == 0);
    CHECK(report.held[static_cast<mapping_stage>(s)].count == 0);
  }
  CHECK_FALSE(report.cut);
  CHECK(report.fused.entries == 0);
}

TEST_CASE("mean and quantiles") {
  turbomap::duration_statistics times;
  CHECK(times.count() == 0);
  CHECK(times.mean() == 0);
  CHECK(times.quantile(0.5) == 0);
  times.add(4);
  CHECK(times.mean() == 4);
  for (const double q : {0.0, 0.5, 0.95, 1.0}) CHECK(times.quantile(q) == 4);
  for (const double ms : {1, 10, 3, 2}) times.add(ms);
  CHECK(times.count() == 5);
  CHECK(times.mean() == doctest::Approx(4));
  CHECK(times.quantile(0) == 1);
  CHECK(times.quantile(0.5) == 3);
  CHECK(times.quantile(0.74) == 3);
  CHECK(times.quantile(0.75) == 4);
  CHECK(times.quantile(0.95) == 4);
  CHECK(times.quantile(1) == 10);
  CHECK(times.samples().front() == 4);  // in the order in which they came
  CHECK(times.samples().back() == 2);
}

TEST_CASE("how long a guard was held") {
  turbomap::guard_times held;
  held.add(2), held.add(5, true), held.add(1);
  CHECK(held.count == 3);
  CHECK(held.total_ms == 8);
  CHECK(held.longest_ms == 5);
  CHECK(held.over_1_ms == 2);
  CHECK(held.commit_ms == 5);
}

TEST_CASE("quantiles of guard times: never below the element, above it by an eighth at most, the longest exactly") {
  turbomap::guard_times all, none;
  CHECK(none.quantile(0.99) == 0);
  std::vector<double> sorted;
  for (int part = 0; part < 3; ++part) {
    turbomap::guard_times one;
    for (int i = part; i < 900; i += 3) {
      const double ms = std::exp2(-8 + i * (15.0 / 900)) * (i % 7 == 0 ? 1.01 : 1);  // to 2^7 ms, beyond the last bin
      one.add(ms), sorted.push_back(ms);
    }
    all += one;
  }
  std::sort(sorted.begin(), sorted.end());
  CHECK(all.count == 900);
  CHECK(all.longest_ms == sorted.back());
  for (int n = 0; n <= 1000; ++n) {
    const double q = n / 1000.0, element = sorted[static_cast<std::size_t>(q * 899)], found = all.quantile(q);
    CAPTURE(q);
    CHECK(found >= element);
    if (element < 32) CHECK(found <= std::max(element, 1.0 / 128) * 1.125);
    if (element >= 32) CHECK(found == all.longest_ms);
  }
  turbomap::guard_times edge;
  for (const double ms : {0.0, 1.0 / 128, 1.0, 32.0, 1e300}) edge.add(ms);
  CHECK(edge.quantile(0) == 1.0 / 128);
  CHECK(edge.quantile(0.5) == 1.125);
  CHECK(edge.quantile(1) == 1e300);
}

}  // namespace

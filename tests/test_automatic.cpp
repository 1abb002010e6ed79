// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The choice between host and device per call, with a clock that the test moves.

#include <turbomap/automatic.hpp>

#include <chrono>
#include <limits>
#include <memory>
#include <stdexcept>
#include <type_traits>

#include <doctest/doctest.h>

#include "support/policies.hpp"

namespace {

using turbomap::crossover;
using turbomap::work_kind;
using turbomap::work_side;
using turbomap_test::sequential;

/// Stands still unless the work moves it.
struct work_clock {
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<work_clock>;
  static inline time_point time{};
  static time_point now() { return time; }
};

/// Plays the device: a policy of another type than the host's.
struct far_policy : sequential {};
using both_sides = turbomap::automatic<sequential, far_policy, work_clock>;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// The host takes 1 us per unit, the device 100 us, whatever the amount. Says where it ran.
struct modelled_work {
  double amount;
  template <class Policy>
  work_side operator()(turbomap::context<Policy>&) const {
    const bool far = std::is_same_v<Policy, far_policy>;
    work_clock::time += std::chrono::nanoseconds(static_cast<long long>(1e3 * (far ? 100 : amount)));
    return far ? work_side::device : work_side::host;
  }
};
work_side run(both_sides& both, work_kind kind, double amount) { return both.run(kind, amount, modelled_work{amount}); }

TEST_CASE("calls measure where they are faster, and then run there") {
  both_sides both({}, {});
  for (const double amount : {1.0, 10.0, 40.0, 300.0, 5000.0})
    for (int i = 0; i < 20; ++i) run(both, work_kind::adjustment, amount);
  for (const double amount : {1.0, 10.0, 40.0}) CHECK(run(both, work_kind::adjustment, amount) == work_side::host);
  for (const double amount : {300.0, 5000.0}) CHECK(run(both, work_kind::adjustment, amount) == work_side::device);
  const crossover found = both.measured();
  CHECK(found.least[1] == 256);  // the class of 300
  CHECK(found.least[0] == infinity);
  CHECK(found.least[2] == infinity);
  CHECK(found.side(work_kind::adjustment, 255) == work_side::host);
  CHECK(found.side(work_kind::adjustment, 256) == work_side::device);
}

TEST_CASE("a device that wins small and loses large is not used for large ones") {
  turbomap::crossover_measurement times;
  for (int i = 0; i < turbomap::crossover_measurement::samples; ++i)
    for (const double amount : {8.0, 64.0, 512.0}) {
      times.record(work_kind::search, amount, work_side::host, amount == 64 ? 3 : 1);
      times.record(work_kind::search, amount, work_side::device, 2);
    }
  CHECK(times.result().least[0] == infinity);
}

TEST_CASE("a size is measured on both sides equally often, and one slow call is forgotten") {
  turbomap::crossover_measurement times;
  constexpr int samples = turbomap::crossover_measurement::samples;
  int host = 0, device = 0;
  for (int i = 0; i < 2 * samples; ++i) {
    const work_side side = times.next(work_kind::motion_only, 100);
    ++(side == work_side::host ? host : device);
    const bool first = side == work_side::device && device == 1;
    times.record(work_kind::motion_only, 100, side, side == work_side::host ? 1.0 : first ? 50 : 0.5);
  }
  CHECK(host == samples);
  CHECK(device == samples);
  CHECK(times.next(work_kind::motion_only, 100) == work_side::device);
}

TEST_CASE("amounts that are no amounts have a class too") {
  turbomap::crossover_measurement times;
  for (const double amount : {0.0, -3.0, 0.5, infinity, std::numeric_limits<double>::quiet_NaN()}) {
    times.record(work_kind::search, amount, work_side::host, 1);
    CHECK(times.next(work_kind::search, amount) == work_side::device);
    times.record(work_kind::search, amount, work_side::device, 2);
  }
}

TEST_CASE("given crossovers and pinned sides are kept to, and nothing is measured") {
  both_sides both({}, {});
  crossover given;
  given.least[0] = 0, given.least[1] = 1000;
  both.use(given);
  const auto before = work_clock::now();
  CHECK(run(both, work_kind::search, 0) == work_side::device);
  CHECK(run(both, work_kind::adjustment, 999) == work_side::host);
  CHECK(run(both, work_kind::adjustment, 1000) == work_side::device);
  CHECK(run(both, work_kind::motion_only, 1e12) == work_side::host);
  both.pin(work_side::host);
  CHECK(run(both, work_kind::search, 1e9) == work_side::host);
  both.pin(work_side::device);
  CHECK(run(both, work_kind::search, 1) == work_side::device);
  CHECK(work_clock::now() > before);
  for (const double least : both.measured().least) CHECK(least == infinity);
  both.measure();
  CHECK(run(both, work_kind::search, 1) == work_side::host);
  CHECK(run(both, work_kind::search, 1) == work_side::device);
}

/// Throws on one side.
struct broken_work {
  work_side side;
  template <class Policy>
  work_side operator()(turbomap::context<Policy>&) const {
    const work_side here = std::is_same_v<Policy, far_policy> ? work_side::device : work_side::host;
    if (here == side) throw std::runtime_error("no");
    return here;
  }
};

TEST_CASE("a side that throws is not faster: its errors reach the caller, then the other side is taken") {
  for (const work_side broken : {work_side::host, work_side::device}) {
    both_sides both({}, {});
    int errors = 0;
    for (int i = 0; i < 2 * turbomap::crossover_measurement::samples; ++i) {
      try {
        const work_side ran = both.run(work_kind::search, 1, broken_work{broken});
        CHECK(ran != broken);
      } catch (const std::runtime_error&) {
        ++errors;
      }
    }
    CHECK(errors == turbomap::crossover_measurement::samples);
    CHECK(both.side(work_kind::search, 1) != broken);
    CHECK(both.measured().side(work_kind::search, 1) != broken);
  }
}

TEST_CASE("errors of the caller say nothing about a side: both are measured after any number of them") {
  both_sides both({}, {});
  const auto refused = [](auto&) { throw std::invalid_argument("argument"); };
  for (int i = 0; i < 2 * turbomap::crossover_measurement::samples; ++i)
    CHECK_THROWS_AS(both.run(work_kind::search, 300, refused), std::invalid_argument);
  int host = 0, device = 0;
  for (int i = 0; i < 2 * turbomap::crossover_measurement::samples; ++i)
    ++(run(both, work_kind::search, 300) == work_side::host ? host : device);
  CHECK(host == turbomap::crossover_measurement::samples);
  CHECK(device == turbomap::crossover_measurement::samples);
  CHECK(both.side(work_kind::search, 300) == work_side::device);
}

TEST_CASE("a failure among calls that succeed does not close a side") {
  turbomap::crossover_measurement times;
  for (int i = 0; i < turbomap::crossover_measurement::samples; ++i) {
    times.record(work_kind::search, 1, work_side::host, 2);
    times.record(work_kind::search, 1, work_side::device, i == 0 ? 1 : infinity);
  }
  CHECK(times.next(work_kind::search, 1) == work_side::device);
}

TEST_CASE("one error counts as a slow call, and as none where nothing is measured") {
  both_sides both({}, {});
  both.pin(work_side::host);
  CHECK_THROWS_AS(both.run(work_kind::search, 1, broken_work{work_side::host}), std::runtime_error);
  both.measure();
  CHECK(both.side(work_kind::search, 1) == work_side::host);
  CHECK_THROWS_AS(both.run(work_kind::search, 1, broken_work{work_side::host}), std::runtime_error);
  CHECK(both.side(work_kind::search, 1) == work_side::device);
  for (int i = 0; i < 20; ++i) run(both, work_kind::search, 1);
  CHECK(both.side(work_kind::search, 1) == work_side::host);
}

TEST_CASE("work may return nothing or what only moves") {
  both_sides both({}, {});
  int calls = 0;
  both.run(work_kind::search, 1, [&calls](auto&) { ++calls; });
  CHECK(calls == 1);
  CHECK(*both.run(work_kind::search, 1, [](auto&) { return std::make_unique<int>(7); }) == 7);
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Deadlines and expectations. The times are so long (days) that the clock of the test does not matter.

#include <doctest/doctest.h>

#include <turbomap/mapping/time_budget.hpp>

#include <cstddef>
#include <limits>

namespace {

constexpr double days = 1e9;  // ms

TEST_CASE("without a deadline everything fits") {
  turbomap::time_budget<2> budget;
  for (const double none : {0.0, -1.0}) {
    budget.start(none);
    CHECK(budget.fits(0));
    budget.record(0, 1e300);
    CHECK(budget.fits(0));
    CHECK(budget.fits(0, 1e6));
    CHECK(budget.fitting(0, 12) == 12);
    CHECK(budget.left_ms() == std::numeric_limits<double>::infinity());
    CHECK(budget.elapsed_ms() >= 0);
  }
}

TEST_CASE("a piece that was never seen is tried while any time is left") {
  turbomap::time_budget<2> budget;
  budget.start(days);
  CHECK(budget.left_ms() <= days);
  CHECK(budget.left_ms() > days / 2);
  CHECK(budget.fits(1));
  CHECK(budget.fits(1, 1e9));
  CHECK(budget.fitting(1, 7) == 7);
  budget.start(1e-9);
  while (budget.elapsed_ms() < 1e-6) {
  }
  CHECK_FALSE(budget.fits(1));
  CHECK(budget.fitting(1, 7) == 0);
  CHECK(budget.fitting(1, 0) == 0);
}

TEST_CASE("what a piece took decides how many fit, piece by piece") {
  turbomap::time_budget<2> budget;
  budget.start(days);
  budget.record(0, 0.15 * days);
  CHECK(budget.fitting(0, 100) == 6);
  CHECK(budget.fitting(0, 3) == 3);
  CHECK(budget.fits(0, 6));
  CHECK_FALSE(budget.fits(0, 7));
  CHECK(budget.fitting(1, 100) == 100);  // the other piece is not concerned
  budget.record(1, 0.8 * days, 4);       // 0.2 each
  CHECK(budget.fitting(1, 100) == 4);
  budget.record(1, 5 * days, 0);  // nothing was done: nothing is learnt
  CHECK(budget.fitting(1, 100) == 4);
}

TEST_CASE("expectations grow at once and shrink slowly") {
  turbomap::time_budget<1> budget;
  budget.start(days);
  budget.record(0, 0.01 * days);
  CHECK(budget.fits(0, 99));
  budget.record(0, 0.5 * days);
  CHECK(budget.fits(0, 1.9));
  CHECK_FALSE(budget.fits(0, 2.1));
  budget.record(0, 0.0);
  CHECK(budget.fits(0, 2.2));  // 0.45 each
  CHECK_FALSE(budget.fits(0, 2.3));
}

TEST_CASE("one slow piece does not switch it off for ever") {
  turbomap::time_budget<2> budget;
  budget.start(days);
  budget.record(0, 2 * days);
  budget.record(1, 2 * days);
  int refused = 0;
  for (; !budget.fits(0) && refused < 100; ++refused) budget.left_out(0);
  CHECK(refused == 7);  // 2 * 0.9^7 < 1
  CHECK_FALSE(budget.fits(1));
}

TEST_CASE("a start forgets the clock, not what was learnt") {
  turbomap::time_budget<1> budget;
  budget.start(days);
  budget.record(0, days / 2.5);
  budget.start(10 * days);
  CHECK(budget.fitting(0, 100) == 24);
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Whether a keyframe goes on: what is skipped, what stops, what is reported as cut, and what is timed. No deadline is near.

#include <doctest/doctest.h>

#include <turbomap/mapping/mapping_progress.hpp>

#include <functional>

namespace {

using turbomap::mapping_stage;
using turbomap::stage_outcome;

struct some_hooks {
  std::function<bool()> keyframes_wait, stop;
  std::function<void(mapping_stage, const turbomap::mapping_report&)> stage_done;
};

TEST_CASE("keyframes that wait skip the stages from fusion on, for as long as they wait") {
  bool wait = true;
  const some_hooks hooks{[&] { return wait; }, {}, {}};
  turbomap::mapping_progress progress;
  progress.start(0);
  CHECK(!progress.must_skip(mapping_stage::creation, hooks));
  CHECK(progress.must_skip(mapping_stage::fusion, hooks));
  CHECK(progress.must_skip(mapping_stage::keyframe_culling, hooks));
  wait = false;
  CHECK(!progress.must_skip(mapping_stage::adjustment, hooks));
}

TEST_CASE("a stop holds for all that is left of the keyframe, by whomever") {
  bool stop = true;
  const some_hooks hooks{{}, [&] { return stop; }, {}};
  turbomap::mapping_progress progress;
  for (const bool own : {false, true}) {
    stop = !own;
    progress.start(0);
    if (own) progress.stop();
    CHECK(progress.must_skip(mapping_stage::process, hooks));
    stop = false;
    CHECK(progress.must_skip(mapping_stage::search, hooks));
  }
  progress.start(0);
  CHECK(!progress.must_skip(mapping_stage::process, hooks));
}

TEST_CASE("a stage that is cut says so, and no other does") {
  int told = 0;
  const some_hooks hooks{{}, {}, [&](mapping_stage, const turbomap::mapping_report&) { ++told; }};
  turbomap::mapping_progress progress;
  turbomap::mapping_report report;
  progress.start(0);
  progress.run(mapping_stage::search, report, hooks, [] {});
  CHECK(!report.cut);
  progress.run(mapping_stage::fusion, report, hooks, [&] { progress.cut(turbomap::mapping_piece::fuse_back); });
  progress.run(mapping_stage::keyframe_culling, report, hooks, [] {});
  CHECK(report.outcome[mapping_stage::search] == stage_outcome::done);
  CHECK(report.outcome[mapping_stage::fusion] == stage_outcome::cut);
  CHECK(report.outcome[mapping_stage::keyframe_culling] == stage_outcome::done);
  CHECK(report.outcome[mapping_stage::creation] == stage_outcome::off);
  CHECK(report.cut);
  CHECK(told == 3);
}

/// Spends `ms` of the clock.
void spend(const turbomap::mapping_progress& progress, double ms) {
  for (const double begin = progress.elapsed_ms(); progress.elapsed_ms() - begin < ms;) {
  }
}

TEST_CASE("a stage that runs twice reports the time of both") {
  const some_hooks hooks{};
  turbomap::mapping_progress progress;
  turbomap::mapping_report report;
  progress.start(0);
  spend(progress, 5);  // is of no stage
  const double begin = progress.elapsed_ms();
  for (const double least : {1.0, 2.0}) {
    progress.run(mapping_stage::fusion, report, hooks, [&] { spend(progress, 1); });
    CHECK(report.ms[mapping_stage::fusion] >= least);
    CHECK(report.ms[mapping_stage::fusion] <= progress.elapsed_ms() - begin);
  }
  CHECK(report.ms[mapping_stage::adjustment] == 0);
}

TEST_CASE("what a piece of work took is expected of the next one, and held against the deadline") {
  using turbomap::mapping_piece;
  constexpr double days = 1e9;  // ms: so long that the clock of the test does not matter
  turbomap::mapping_progress progress;
  progress.start(days);
  CHECK(progress.left_ms() <= days);
  CHECK(progress.fits(mapping_piece::fuse_target, 1e300));  // never seen
  spend(progress, 5);                                       // is of no piece
  const double begin = progress.elapsed_ms();
  progress.timed(mapping_piece::fuse_target, 2, [&] { spend(progress, 2); });
  const double each = (progress.elapsed_ms() - begin) / 2;  // at most; at least 1 ms
  CHECK(progress.fits(mapping_piece::fuse_target, 0.9 * days / each));
  CHECK_FALSE(progress.fits(mapping_piece::fuse_target, days));
  CHECK(progress.fitting(mapping_piece::fuse_target, 2'000'000'000) < 1'000'000'001);
  CHECK(progress.fits(mapping_piece::cull_keyframe, 1e300));  // another piece
}

}  // namespace

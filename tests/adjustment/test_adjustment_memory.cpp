// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// What adjustments allocate: nothing from the second time on, and no pairs for conjugate gradients; and what is left of a problem
// where there is no memory.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <turbomap/adjustment/covariance.hpp>

#include <algorithm>
#include <cfenv>
#include <limits>
#include <new>

#include "adjustment_cases.hpp"
#include "adjustment_factors.hpp"
#include "pair_lists_cases.hpp"
#include "support/counted_new.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_end;
using turbomap::adjustment_options;
using turbomap::precision;
using turbomap::reduced_solver;
using turbomap::span;
using turbomap_test::sequential;
using problem_type =
    turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera>,
                             turbomap::frame_factors<prior_factor>, turbomap::frame_pair_factors<odometry_factor>>;

/// A scene with a prior of each free frame, and odometry between neighbours.
struct whole_problem {
  adjustment_scene scene;
  std::vector<std::int32_t> frame, first, second;
  std::vector<prior_factor::row> priors;
  std::vector<odometry_factor::row> odometry;

  whole_problem(int frames, int points, unsigned seed)
      : scene(make_adjustment_scene(scene_kind::stereo, frames, 1, points, seed)) {
    for (int f = 0; f < frames; ++f) {
      frame.push_back(f), priors.push_back({scene.true_poses[static_cast<std::size_t>(f)]});
      if (f > 0) first.push_back(f - 1), second.push_back(f), odometry.push_back({{0.1, 0, 0}});
    }
  }
  void assign(turbomap::context<sequential>& ctx, problem_type& problem) const {
    problem.assign(ctx, scene.frame_input(), scene.landmark_input(), scene.group(),
                   {{1.0}, span<const std::int32_t>(frame), span<const prior_factor::row>(priors), {}, 1e6},
                   {{0.1},
                    span<const std::int32_t>(first),
                    span<const std::int32_t>(second),
                    span<const odometry_factor::row>(odometry),
                    {},
                    1e6});
  }
};

adjusted adjust_all(turbomap::context<sequential>& ctx, problem_type& problem,
                    const adjustment_options& options = in_float64()) {
  adjusted a;
  a.summary = turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, options);
  problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
  return a;
}

adjusted adjust_fresh(const whole_problem& w, const adjustment_options& options = in_float64()) {
  turbomap::context<sequential> ctx{sequential{}};
  problem_type problem(ctx);
  w.assign(ctx, problem);
  return adjust_all(ctx, problem, options);
}

TEST_CASE("an equally large problem, the second time: nothing is allocated but the list of iterations") {
  const whole_problem a(9, 80, 3), b(9, 80, 3);
  for (const auto numbers : {precision::float64, precision::mixed, precision::float32})
    for (const auto solver : {reduced_solver::dense, reduced_solver::pcg, reduced_solver::sparse}) {
      CAPTURE(static_cast<int>(solver));
      CAPTURE(static_cast<int>(numbers));
      adjustment_options options = in_float64();
      options.numbers = numbers, options.solver = solver;
      turbomap::context<sequential> ctx{sequential{}};
      problem_type problem(ctx);
      std::vector<double> chi2, depth;
      adjusted result;
      for (int i = 0; i < 2; ++i) {
        a.assign(ctx, problem);
        result = adjust_all(ctx, problem, options);
        problem.chi2<0>(ctx, chi2, depth);
      }
      const long before = allocations;
      b.assign(ctx, problem);
      const long assigned = allocations;
      const int accepted = turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, options).accepted;
      const long solved = allocations;
      problem.frames(ctx, result.poses), problem.landmarks(ctx, result.points), problem.chi2<0>(ctx, chi2, depth);
      const long read = allocations;
      CHECK(assigned - before == 0);
      CHECK(solved - assigned == 1);  // summary.each, which goes to the caller
      CHECK(read - solved == 0);
      CHECK(accepted > 1);
    }
}

TEST_CASE_TEMPLATE("conjugate gradients list no pairs: memory grows with the observations", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_pcg_lists_no_pairs(Policy{}, std::pmr::new_delete_resource(), [] { return allocated_bytes.load(); });
}

TEST_CASE("no memory, at whichever allocation: assign() throws, the problem is empty, and works afterwards") {
  const whole_problem small(4, 12, 2), large(9, 80, 3);
  const auto expected = adjust_fresh(large);
  int thrown = 0;
  for (long n = 0;; ++n) {
    CAPTURE(n);
    turbomap::context<sequential> ctx{sequential{}};
    problem_type problem(ctx);
    if (n % 2 == 0) small.assign(ctx, problem), adjust_all(ctx, problem);  // one that was used, and a new one
    bool threw = false;
    try {
      const no_memory_after limit(n);
      large.assign(ctx, problem);
    } catch (const std::bad_alloc&) {
      threw = true;
    }
    if (threw) {
      ++thrown;
      REQUIRE(problem.frame_count() == 0);
      REQUIRE(problem.landmark_count() == 0);
      REQUIRE(problem.observation_count() == 0);
      const auto nothing = adjust_all(ctx, problem);
      REQUIRE(nothing.summary.end == adjustment_end::no_observations);
      REQUIRE(nothing.poses.empty());
      REQUIRE(nothing.points.empty());
      std::vector<double> chi2(1), depth(1);
      problem.chi2<0>(ctx, chi2, depth);
      REQUIRE(chi2.size() + depth.size() == 0);
      REQUIRE(turbomap::undetermined_directions(ctx, problem) == 0);
      turbomap::frame_covariance(ctx, problem, {}, chi2);
      REQUIRE(chi2.empty());
      large.assign(ctx, problem);
    }
    const auto a = adjust_all(ctx, problem);
    REQUIRE(a.summary.cost_final == expected.summary.cost_final);
    REQUIRE(distance(a, expected) == 0);
    if (!threw && n % 2 == 1) break;
  }
  CHECK(thrown > 50);
}

TEST_CASE("no memory in adjust(), at whichever allocation: it throws, and goes on the next time") {
  const whole_problem w(6, 30, 5);
  for (const auto solver : {reduced_solver::dense, reduced_solver::pcg, reduced_solver::sparse}) {
    adjustment_options options = in_float64();
    options.solver = solver;
    const auto expected = adjust_fresh(w, options);
    int thrown = 0;
    for (long n = 0;; ++n) {
      CAPTURE(n);
      turbomap::context<sequential> ctx{sequential{}};
      problem_type problem(ctx);
      w.assign(ctx, problem);
      bool threw = false;
      try {
        const no_memory_after limit(n);
        turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, options);
      } catch (const std::bad_alloc&) {
        threw = true;
      }
      if (!threw) break;
      ++thrown;
      const auto on = adjust_all(ctx, problem, options);  // as it is: what was accepted before stays
      REQUIRE(std::abs(on.summary.cost_final - expected.summary.cost_final) < 0.05 * expected.summary.cost_final);
      w.assign(ctx, problem);
      const auto a = adjust_all(ctx, problem, options);
      REQUIRE(a.summary.cost_final == expected.summary.cost_final);
      REQUIRE(distance(a, expected) == 0);
    }
    CHECK(thrown >= 3);
  }
}

/// Device-like memory: a resource of one's own, told to the context.
class limited_resource : public std::pmr::memory_resource {
 public:
  long left = no_limit, held = 0;

 private:
  void* do_allocate(std::size_t bytes, std::size_t alignment) override {
    if (left != no_limit && left-- <= 0) throw std::bad_alloc();
    ++held;
    return std::pmr::new_delete_resource()->allocate(bytes, alignment);
  }
  void do_deallocate(void* p, std::size_t bytes, std::size_t alignment) override {
    --held;
    std::pmr::new_delete_resource()->deallocate(p, bytes, alignment);
  }
  bool do_is_equal(const std::pmr::memory_resource& other) const noexcept override { return this == &other; }
};

TEST_CASE("a resource of one's own that runs out: the same, and everything goes back to it") {
  const whole_problem small(4, 12, 2), large(9, 80, 3);
  const auto expected = adjust_fresh(large);
  limited_resource resource;
  int thrown = 0;
  for (long n = 0;; ++n) {
    CAPTURE(n);
    bool threw = false;
    {
      turbomap::context<sequential> ctx{sequential{}, &resource};
      problem_type problem(ctx);
      small.assign(ctx, problem), adjust_all(ctx, problem);
      resource.left = n;
      try {
        large.assign(ctx, problem);
        turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, in_float64());
      } catch (const std::bad_alloc&) {
        threw = true;
      }
      resource.left = no_limit;
      large.assign(ctx, problem);
      REQUIRE(distance(adjust_all(ctx, problem), expected) == 0);
    }
    REQUIRE(resource.held == 0);
    if (!threw) break;
    ++thrown;
  }
  CHECK(thrown > 5);
}

/// Memory full of signalling NaN: whoever computes with what nobody wrote raises FE_INVALID.
class poisoned_resource : public std::pmr::memory_resource {
  void* do_allocate(std::size_t bytes, std::size_t alignment) override {
    void* const p = std::pmr::new_delete_resource()->allocate(bytes, alignment);
    std::fill_n(static_cast<double*>(p), bytes / sizeof(double), std::numeric_limits<double>::signaling_NaN());
    return p;
  }
  void do_deallocate(void* p, std::size_t bytes, std::size_t alignment) override {
    std::pmr::new_delete_resource()->deallocate(p, bytes, alignment);
  }
  bool do_is_equal(const std::pmr::memory_resource& other) const noexcept override { return this == &other; }
};

TEST_CASE("nothing is computed with memory that nobody wrote") {
  const whole_problem w(9, 80, 3);  // all frames share landmarks: the matrix of the frames is not zeroed first
  for (const auto numbers : {precision::float64, precision::mixed})
    for (const auto solver : {reduced_solver::dense, reduced_solver::pcg, reduced_solver::sparse}) {
      CAPTURE(static_cast<int>(solver));
      adjustment_options options = in_float64();
      options.numbers = numbers, options.solver = solver;
      const auto expected = adjust_fresh(w, options);
      poisoned_resource resource;
      turbomap::context<sequential> ctx{sequential{}, &resource};
      problem_type problem(ctx);
      w.assign(ctx, problem);
      std::feclearexcept(FE_ALL_EXCEPT);
      const auto a = adjust_all(ctx, problem, options);
      CHECK(std::fetestexcept(FE_INVALID) == 0);
      CHECK(distance(a, expected) == 0);
    }
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// What a device does of the loop of adjust() itself: the lists of the blocks, the sums that a step is judged by, and steps that
/// are refused after what follows was computed ahead.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory_resource>
#include <random>
#include <vector>

#include <turbomap/adjustment/block_finder.hpp>
#include <turbomap/adjustment/host_sums.hpp>
#include <turbomap/adjustment/list_blocks.hpp>
#include <turbomap/adjustment/resident_structure.hpp>
#include <turbomap/adjustment/step_sums.hpp>
#include <turbomap/adjustment/structure_builder.hpp>

#include "adjustment_cases.hpp"
#include "adjustment_results.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_structure;
using sequential = std::decay_t<decltype(thrust::seq)>;

/// Frames of which some are fixed or see nothing, landmarks that no frame sees, or one frame twice; factors between frames.
adjustment_structure random_structure(int frames, int landmarks, int rows, int factors = 0) {
  std::mt19937 random(static_cast<unsigned>(frames + rows));
  std::vector<std::int32_t> frame, landmark;
  std::vector<std::uint8_t> fixed;
  for (int f = 0; f < frames; ++f) fixed.push_back(f % 5 == 3 ? 1 : 0);
  for (int r = 0; r < rows; ++r) {
    frame.push_back(static_cast<std::int32_t>(random() % static_cast<unsigned>(frames)));
    if (frame.back() % 7 == 6) --frame.back();
    landmark.push_back(static_cast<std::int32_t>(random() % static_cast<unsigned>(landmarks)));
  }
  const std::vector<turbomap::landmark_group_input> groups{
      {{frame.data(), frame.size()}, {landmark.data(), landmark.size()}, nullptr, 1}};
  std::vector<std::int32_t> first, second;
  for (int i = 0; i < factors; ++i) {
    first.push_back(static_cast<std::int32_t>(random() % static_cast<unsigned>(frames)));
    second.push_back((first.back() + 1 + static_cast<std::int32_t>(random() % 2U)) % frames);
    if (random() % 2U == 0) std::swap(first.back(), second.back());
  }
  const std::vector<turbomap::frame_group_input> between{{{first.data(), first.size()}, {second.data(), second.size()}},
                                                         {{first.data(), first.size() / 2}, {}}};
  adjustment_structure s;
  turbomap::structure_builder().build({frames,
                                       landmarks,
                                       {fixed.data(), fixed.size()},
                                       {groups.data(), groups.size()},
                                       {between.data(), between.size()},
                                       8},
                                      s);
  return s;
}

template <class Context, class T>
std::vector<T> fetched(Context& ctx, const T* from, std::size_t n) {
  std::vector<T> to(n);
  turbomap::copy_out(ctx.policy(), to.data(), from, n * sizeof(T));
  ctx.synchronize();
  return to;
}

TEST_CASE("lists of blocks: those of the host, and empty ones between") {
  const stream on;
  turbomap::context<stream_policy> ctx{on.policy()};
  for (const auto& size :
       {std::array<int, 3>{1, 3, 2}, {2, 1, 2}, {9, 40, 60}, {30, 700, 4000}, {70, 90, 3000}, {150, 50, 1000}}) {
    CAPTURE(size[0]);
    adjustment_structure s = random_structure(size[0], size[1], size[2], size[0] < 3 ? 0 : 2 * size[0]);
    ctx.begin_call();
    turbomap::resident_structure<turbomap::device_memory> lists(ctx.resource());
    lists.send_sums(ctx.policy(), s);
    turbomap::schur_view<double> view;
    lists.point(view);
    REQUIRE(turbomap::launch_list_blocks(ctx.policy(), ctx.scratch(), s, view));
    turbomap::block_finder().find(s);
    const int blocks = s.free_frames * (s.free_frames - 1) / 2;
    REQUIRE(view.blocks == blocks);
    const auto n = static_cast<std::size_t>(blocks);
    const auto row = fetched(ctx, view.block_row, n), column = fetched(ctx, view.block_column, n);
    const auto begin = fetched(ctx, view.block_pair, n + 1), factor = fetched(ctx, view.block_factor, n + 1);
    const auto pairs = fetched(ctx, view.pairs, s.pairs.size());
    const auto codes = fetched(ctx, view.factor_list, s.factor_list.size());
    REQUIRE(static_cast<std::size_t>(factor.back()) == s.factor_list.size());
    CHECK((size[0] < 3 || codes.size() > 0));
    CHECK(std::equal(codes.begin(), codes.end(), s.factor_list.begin()));
    REQUIRE(static_cast<std::size_t>(begin.back()) == s.pairs.size());
    std::size_t k = 0;
    for (std::size_t b = 0; b < n; ++b) {
      if (begin[b] == begin[b + 1] && factor[b] == factor[b + 1]) continue;
      REQUIRE(k < s.block_row.size());
      CHECK((row[b] == s.block_row[k] && column[b] == s.block_column[k]));
      CHECK((begin[b] == s.block_pair[k] && begin[b + 1] == s.block_pair[k + 1]));
      CHECK((factor[b] == s.block_factor[k] && factor[b + 1] == s.block_factor[k + 1]));
      ++k;
    }
    CHECK(k == s.block_row.size());
    bool same = true;
    for (std::size_t i = 0; i < pairs.size(); ++i)
      same = same && pairs[i].first == s.pairs[i].first && pairs[i].second == s.pairs[i].second;
    CHECK(same);
  }
}

TEST_CASE("lists of blocks that are the host's: many frames, host policies") {
  const stream on;
  turbomap::context<stream_policy> ctx{on.policy()};
  turbomap::schur_view<double> view;
  adjustment_structure s = random_structure(200, 50, 300);
  CHECK_FALSE(turbomap::launch_list_blocks(ctx.policy(), ctx.scratch(), s, view));
  s = random_structure(9, 20, 60);
  CHECK_FALSE(turbomap::launch_list_blocks(thrust::seq, ctx.scratch(), s, view));
}

TEST_CASE("what a step is judged by: the sums of the host") {
  constexpr int D = 6;
  const stream on;
  turbomap::context<stream_policy> ctx{on.policy()};
  turbomap::array<turbomap::awaited<turbomap::step_report>, turbomap::host_memory> to(ctx.staging_resource());
  to.resize_discard(1);
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto numbers = [&](std::size_t n) {
    std::vector<double> x(n);
    for (double& v : x) v = 3 + normal(random);
    return x;
  };
  for (const std::size_t count : {0, 1, 31, 1024, 5000})
    for (const std::size_t frames : {0, 1, 40})
      for (const bool scaled : {false, true}) {
        CAPTURE(count);
        CAPTURE(frames);
        CAPTURE(scaled);
        const auto costs = numbers(2 * count), gains = numbers(count / 3), x = numbers(frames * D),
                   b = numbers(frames * D);
        const auto H = numbers(frames * turbomap::frame_block<D>::triangle), solved = numbers(1);
        ctx.begin_call();
        const auto send = [&](const std::vector<double>& v) {
          double* there = ctx.scratch<double>(v.size());
          turbomap::copy_in(ctx.policy(), there, v.data(), v.size() * sizeof(double));
          return there;
        };
        const turbomap::damping damping{0.5, scaled};
        turbomap::step_parts parts{send(costs), count,   send(gains), gains.size(), send(x),
                                   send(b),     send(H), x.size(),    send(solved), damping};
        turbomap::launch_sum_step<D>(ctx.policy(), parts, to.data());
        const auto report = turbomap::wait_for(ctx.policy(), *to.data());
        double predicted = turbomap::detail::sum_in_order(gains.data(), gains.size());
        predicted = turbomap::detail::dot_in_order(x.data(), b.data(), x.size(), predicted);
        predicted = turbomap::detail::damped_square<D>(damping, H.data(), x.data(), x.size(), predicted);
        CHECK(report.cost == doctest::Approx(turbomap::detail::sum_in_order(costs.data(), count)).epsilon(1e-13));
        CHECK(report.undefined ==
              doctest::Approx(turbomap::detail::sum_in_order(costs.data() + count, count)).epsilon(1e-13));
        CHECK(report.predicted == doctest::Approx(predicted).epsilon(1e-13));
        CHECK(report.solved == solved[0]);
        parts.gains = nullptr, parts.solved = nullptr;  // an estimate that no step led to
        turbomap::launch_sum_step<D>(ctx.policy(), parts, to.data());
        const auto alone = turbomap::wait_for(ctx.policy(), *to.data());
        CHECK(alone.cost == report.cost);
        CHECK(alone.predicted == 0);
        CHECK(alone.solved == 1);
      }
}

/// Of memory that the device does not write to.
TEST_CASE("staging memory that is not pinned: the host sums, and finds the same") {
  const stream on;
  const auto s = make_adjustment_scene(scene_kind::stereo, 8, 2, 150, 4);
  const auto run = [&](std::pmr::memory_resource* staging) {
    turbomap::context<stream_policy> ctx(on.policy(), turbomap::default_resource(turbomap::device_memory{}), staging);
    turbomap::bundle_problem<stream_policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
    problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
    adjusted a;
    auto options = in_float64();
    options.max_iterations = 4;
    a.summary = turbomap::adjust<float64_methods>(ctx, problem, options);
    problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
    return a;
  };
  const auto handed_over = [](std::pmr::memory_resource* staging) {
    turbomap::array<turbomap::awaited<turbomap::step_report>, turbomap::host_memory> to(staging);
    to.resize_discard(1);
    return turbomap::can_hand_over(to.data());
  };
  auto* const pinned_memory = turbomap::default_staging_resource(turbomap::device_memory{});
  REQUIRE(handed_over(pinned_memory));  // or both runs below were the host's
  CHECK_FALSE(handed_over(std::pmr::new_delete_resource()));
  const auto pinned = run(pinned_memory);
  const auto pageable = run(std::pmr::new_delete_resource());
  REQUIRE(pageable.summary.each.size() == pinned.summary.each.size());
  CHECK(pageable.summary.cost_final == doctest::Approx(pinned.summary.cost_final).epsilon(1e-12));
  CHECK(distance(pageable.poses, pinned.poses) <= 1e-9);
}

TEST_CASE("the damping of the next step is that of the host, to the bit") {
  const stream on;
  turbomap::context<stream_policy> ctx{on.policy()};
  turbomap::array<turbomap::awaited<turbomap::step_report>, turbomap::host_memory> to(ctx.staging_resource());
  to.resize_discard(1);
  std::mt19937 random(8);
  std::uniform_real_distribution<double> uniform(0, 2);
  int followed = 0, refused = 0;
  for (int i = 0; i < 200; ++i) {
    ctx.begin_call();
    double numbers[4] = {uniform(random), 0, uniform(random), i % 9 == 0 ? 0.0 : 1.0};  // cost, undefined, gain, solved
    if (i % 11 == 0) numbers[0] = std::numeric_limits<double>::quiet_NaN();
    double* there = ctx.scratch<double>(5);
    turbomap::copy_in(ctx.policy(), there, numbers, sizeof numbers);
    turbomap::step_parts parts;
    parts.costs = there, parts.cost_count = 1, parts.gains = there + 2, parts.gain_count = 1, parts.solved = there + 3;
    parts.next_lambda = there + 4, parts.control = {uniform(random) * 1e-3, 2}, parts.cost_before = uniform(random);
    parts.least_predicted = i % 7 == 0 ? 1.0 : 1e-9, parts.least_decrease = i % 5 == 0 ? 0.5 : 0;
    turbomap::launch_sum_step<6>(ctx.policy(), parts, to.data());
    const auto report = turbomap::wait_for(ctx.policy(), *to.data());
    turbomap::damping_control control = parts.control;
    const bool goes_on = numbers[3] != 0 && numbers[2] > parts.least_predicted &&
                         control.accepts(parts.cost_before, numbers[0], numbers[2]) &&
                         !(parts.cost_before - numbers[0] < parts.least_decrease);
    CHECK(std::isnan(report.lambda) == !goes_on);
    if (goes_on) CHECK(report.lambda == control.lambda);
    const double found = fetched(ctx, there + 4, 1)[0];
    CHECK((std::isnan(found) ? std::isnan(report.lambda) : found == report.lambda));
    ++(goes_on ? followed : refused);
  }
  CHECK(followed > 20);
  CHECK(refused > 20);
}

TEST_CASE("steps that are solved for ahead are those that are solved for when they are asked for") {
  const stream on;
  int iterations = 0, taken = 0;
  for (const auto kind : {scene_kind::mono, scene_kind::stereo})
    for (const auto rule : {turbomap::damping_rule::identity, turbomap::damping_rule::diagonal})
      for (const double decrease : {0.0, 1e-3})
        for (const bool far : {false, true}) {
          CAPTURE(static_cast<int>(kind));
          CAPTURE(static_cast<int>(rule));
          CAPTURE(decrease);
          CAPTURE(far);
          auto s = make_adjustment_scene(kind, 9, 2, 150, 7);
          for (std::size_t l = 0; far && l < s.points.size(); l += 5) s.points[l].x += 5;
          auto options = in_float64();
          options.damping = rule, options.min_relative_decrease = decrease, options.max_iterations = 12;
          const auto run = [&](std::pmr::memory_resource* staging, int& steps) {
            turbomap::context<stream_policy> ctx(on.policy(), turbomap::default_resource(turbomap::device_memory{}),
                                                 staging);
            turbomap::bundle_problem<stream_policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
            adjusted a;
            for (int again = 0; again < 2; ++again) {  // what was solved for ahead belongs to one call
              problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
              a.summary = turbomap::adjust<float64_methods>(ctx, problem, options);
            }
            problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
            steps += problem.data().workspace.ahead;
            return a;
          };
          int not_ahead = 0;
          const auto ahead = run(turbomap::default_staging_resource(turbomap::device_memory{}), taken);
          const auto asked = run(std::pmr::new_delete_resource(), not_ahead);  // not pinned: the host sums
          CHECK(not_ahead == 0);
          REQUIRE(ahead.summary.each.size() == asked.summary.each.size());
          CHECK(ahead.summary.end == asked.summary.end);
          for (std::size_t i = 0; i < asked.summary.each.size(); ++i)
            CHECK(ahead.summary.each[i].steps == asked.summary.each[i].steps);
          CHECK(ahead.summary.cost_final == doctest::Approx(asked.summary.cost_final).epsilon(1e-9));
          CHECK(distance(ahead.poses, asked.poses) <= 1e-7);
          iterations += ahead.summary.iterations;
        }
  CHECK(iterations > 50);
  CHECK(taken > 0);
}

TEST_CASE("steps that are refused: as on the host") {
  const stream on;
  int refused = 0;
  for (const int kind : {0, 1, 2}) {
    CAPTURE(kind);
    auto s = make_adjustment_scene(scene_kind::mono, 8, 2, 80, 1);
    for (std::size_t l = 0; l < s.points.size();
         l += 3) {  // far from where they belong: a hardly damped step overshoots
      auto& p = s.points[l];
      if (kind == 0)
        p = {4 * p.x, p.y - 4, 0.3 * p.z};
      else if (kind == 1)
        p.x += 20;
      else
        p = {-3 * p.x, -3 * p.y, p.z};
    }
    auto options = in_float64();
    options.max_iterations = 8, options.initial_lambda = 1e-9;
    const auto host = adjust_scene(sequential{}, s, options), a = adjust_scene(on.policy(), s, options);
    REQUIRE(a.summary.each.size() == host.summary.each.size());
    for (std::size_t i = 0; i < host.summary.each.size(); ++i) {
      CHECK(a.summary.each[i].steps == host.summary.each[i].steps);
      refused += host.summary.each[i].steps - 1;
    }
    CHECK(a.summary.cost_final == doctest::Approx(host.summary.cost_final).epsilon(1e-6));
    CHECK(same_bits(a.summary, adjust_scene(on.policy(), s, options).summary));
  }
  CHECK(refused > 0);
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The lists of observations that a device makes, against those of structure_builder: the same integers.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory_resource>
#include <random>
#include <type_traits>
#include <vector>

#include <turbomap/adjustment/structure_builder.hpp>

#include "adjustment_cases.hpp"
#include "adjustment_results.hpp"
#include "reference/larger_or_nan.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_structure;
using sequential = std::decay_t<decltype(thrust::seq)>;
using device_problem = turbomap::bundle_problem<stream_policy, pose_frame, turbomap::reprojections<scene_camera>>;

enum class row_order { any, by_frame, by_landmark };

/// Frames of which some are fixed or see nothing, landmarks that no frame sees, or one frame twice; mono and stereo rows of two
/// cameras.
adjustment_scene random_rows(int frames, int landmarks, int rows, row_order order) {
  adjustment_scene s = make_adjustment_scene(scene_kind::fisheye_rig, 1, 0, 1, 1);
  std::mt19937 random(static_cast<unsigned>(frames + 3 * rows));
  std::uniform_real_distribution<double> uniform(-1, 1);
  s.rig[0].bf = s.rig[1].bf = 40;
  s.poses.assign(static_cast<std::size_t>(frames), rigid_transform<double>{});
  s.fixed.clear(), s.points.clear();
  for (int f = 0; f < frames; ++f) s.fixed.push_back(f % 5 == 3 ? 1 : 0);
  for (int l = 0; l < landmarks; ++l) s.points.push_back({uniform(random), uniform(random), 5 + uniform(random)});
  s.frame.clear(), s.landmark.clear(), s.camera.clear(), s.pixel.clear(), s.information.clear();
  for (int r = 0; r < rows; ++r) {
    int f = static_cast<int>(random() % static_cast<unsigned>(frames));
    if (f % 7 == 6) --f;
    int l = static_cast<int>(random() % static_cast<unsigned>(landmarks));
    if (order == row_order::by_frame) f = static_cast<int>(static_cast<long long>(r) * frames / rows);
    if (order == row_order::by_landmark) l = static_cast<int>(static_cast<long long>(r) * landmarks / rows);
    s.frame.push_back(f), s.landmark.push_back(l), s.camera.push_back(static_cast<std::uint8_t>(random() % 2));
    s.pixel.push_back({300 + 100 * uniform(random), 250 + 100 * uniform(random), random() % 2 == 0 ? 280.0 : -1.0});
    s.information.push_back(1);
  }
  return s;
}

/// Of the host, with the chunks of a device.
adjustment_structure structure_of(const adjustment_scene& s, turbomap::span<const std::int32_t> place = {}) {
  std::vector<std::uint8_t> kind;
  for (std::size_t i = 0; i < s.frame.size(); ++i)
    kind.push_back(
        static_cast<std::uint8_t>(2 * s.camera[i] + (s.pixel[i].z >= 0 && s.rig[s.camera[i]].bf > 0 ? 1 : 0)));
  const std::vector<turbomap::landmark_group_input> groups{{{s.frame.data(), s.frame.size()},
                                                            {s.landmark.data(), s.landmark.size()},
                                                            kind.data(),
                                                            2 * static_cast<int>(s.rig.size())}};
  adjustment_structure made;
  turbomap::structure_builder().build({static_cast<int>(s.poses.size()),
                                       static_cast<int>(s.points.size()),
                                       {s.fixed.data(), s.fixed.size()},
                                       {groups.data(), groups.size()},
                                       {},
                                       turbomap::observation_shape<turbomap::device_memory>::chunk,
                                       place},
                                      made);
  return made;
}

void check_same(const adjustment_structure& a, const adjustment_structure& b) {
  CHECK(a.free_frames == b.free_frames);
  CHECK(a.partials == b.partials);
  CHECK(a.rows() == b.rows());
  CHECK(a.couplings() == b.couplings());
  CHECK(a.slots() == b.slots());
  CHECK(a.frame_of_free == b.frame_of_free);
  CHECK(a.free_of_frame == b.free_of_frame);
  CHECK(a.landmark_row == b.landmark_row);
  CHECK(a.landmark_slot == b.landmark_slot);
  CHECK(a.slot_coupling == b.slot_coupling);
  CHECK(a.slot_frame == b.slot_frame);
  CHECK(a.slot_landmark == b.slot_landmark);
  CHECK(a.frame_partial == b.frame_partial);
  CHECK(a.partial_list == b.partial_list);
  CHECK(a.frame_slot == b.frame_slot);
  CHECK(a.slot_list == b.slot_list);
  CHECK(a.frame_factor == b.frame_factor);
  CHECK(a.frame_pair == b.frame_pair);
  REQUIRE(a.groups.size() == 1);
  REQUIRE(b.groups.size() == 1);
  CHECK(a.groups[0].source == b.groups[0].source);
  CHECK(a.groups[0].landmark == b.groups[0].landmark);
  CHECK(a.groups[0].row == b.groups[0].row);
  CHECK(a.groups[0].coupling == b.groups[0].coupling);
  REQUIRE(a.groups[0].chunks.size() == b.groups[0].chunks.size());
  bool same = true;
  for (std::size_t i = 0; i < a.groups[0].chunks.size(); ++i) {
    const auto &x = a.groups[0].chunks[i], &y = b.groups[0].chunks[i];
    same =
        same && x.frame == y.frame && x.free == y.free && x.kind == y.kind && x.begin == y.begin && x.count == y.count;
  }
  CHECK(same);
}

TEST_CASE("the lists of a device are those of the host") {
  const stream on;
  turbomap::context<stream_policy> ctx{on.policy()};
  device_problem problem(ctx);  // used again
  for (const auto& size : {std::array<int, 3>{1, 1, 1},
                           {2, 3, 2},
                           {4, 1, 3},
                           {4, 1, 200},
                           {9, 40, 60},
                           {30, 700, 4000},
                           {70, 90, 3000},
                           {3, 5000, 9000},
                           {150, 50, 1000},
                           {50, 6000, 35000}})
    for (const auto order : {row_order::any, row_order::by_frame, row_order::by_landmark}) {
      CAPTURE(size[0]);
      CAPTURE(size[2]);
      CAPTURE(static_cast<int>(order));
      adjustment_scene s = random_rows(size[0], size[1], size[2], order);
      for (const int fixed : {-1, 0, 1}) {
        if (fixed >= 0) s.fixed.assign(s.poses.size(), static_cast<std::uint8_t>(fixed));
        problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
        auto& data = problem.data();
        REQUIRE(data.structure.elsewhere);
        CHECK(data.finite);
        auto expected = structure_of(s);
        CHECK(turbomap::block_finder::count_pairs(data.structure) == turbomap::block_finder::count_pairs(expected));
        data.need_lists(ctx.policy());
        CHECK_FALSE(data.structure.elsewhere);
        CHECK(data.structure.groups_elsewhere);
        data.need_rows(ctx.policy());
        CHECK_FALSE(data.structure.groups_elsewhere);
        check_same(data.structure, expected);
      }
    }
}

TEST_CASE("what the device leaves to the host: no rows, a landmark with too many") {
  const stream on;
  turbomap::context<stream_policy> ctx{on.policy()};
  device_problem problem(ctx);
  adjustment_scene s = random_rows(3, 4, 5000, row_order::any);
  for (auto& l : s.landmark) l = 2;
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  CHECK_FALSE(problem.data().structure.elsewhere);
  check_same(problem.data().structure,
             structure_of(s, turbomap::span<const std::int32_t>(problem.data().order.place())));
  s = random_rows(3, 4, 0, row_order::any);
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  CHECK_FALSE(problem.data().structure.elsewhere);
  CHECK(turbomap::adjust<float64_methods>(ctx, problem, in_float64()).end == turbomap::adjustment_end::no_observations);
}

TEST_CASE("numbers that are not finite, and bad input after a good one") {
  const stream on;
  turbomap::context<stream_policy> ctx{on.policy()};
  device_problem problem(ctx);
  const adjustment_scene good = make_adjustment_scene(scene_kind::stereo, 8, 2, 150, 4);
  const auto finite = [&](const adjustment_scene& s, const std::vector<std::uint8_t>& stereo = {}) {
    auto group = s.group();
    group.stereo = turbomap::span<const std::uint8_t>(stereo);
    problem.assign(ctx, s.frame_input(), s.landmark_input(), group);
    CHECK(problem.data().structure.elsewhere);
    return problem.data().finite;
  };
  constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
  CHECK(finite(good));
  for (int kind = 0; kind < 5; ++kind) {
    CAPTURE(kind);
    adjustment_scene s = good;
    const std::size_t i = s.frame.size() - 1 - static_cast<std::size_t>(kind);
    if (kind == 0) s.pixel[i].x = nan;
    if (kind == 1) s.pixel[i].y = -infinite;
    if (kind == 2) s.information[i] = infinite;
    if (kind == 3) s.points.back().y = nan;
    if (kind == 4) s.poses[0].ty = infinite;
    CHECK_FALSE(finite(s));
    CHECK(turbomap::adjust<float64_methods>(ctx, problem, in_float64()).end == turbomap::adjustment_end::not_finite);
  }
  adjustment_scene s = good;
  s.pixel[5].z = nan;
  CHECK(finite(s));  // no right pixel there
  std::vector<std::uint8_t> stereo(s.frame.size(), 0);
  CHECK(finite(s, stereo));
  stereo[5] = 1;
  CHECK_FALSE(finite(s, stereo));

  CHECK(finite(good));
  s = good, s.landmark[7] = 150;
  CHECK_THROWS_WITH_AS(finite(s), doctest::Contains("landmark"), std::invalid_argument);
  s = good, s.information[7] = -1;
  CHECK_THROWS_WITH_AS(finite(s), doctest::Contains("information"), std::invalid_argument);
  const auto before = adjust_scene(on.policy(), good, in_float64());
  adjusted after;
  after.summary = turbomap::adjust<float64_methods>(ctx, problem, in_float64());
  problem.frames(ctx, after.poses), problem.landmarks(ctx, after.points);
  CHECK(same_bits(after.summary, before.summary));
  CHECK(same_bits(after.points, before.points));
}

TEST_CASE("what lies in page-locked memory is copied from there, with the same result, and nothing of it is kept") {
  const stream on;
  turbomap::context<stream_policy> ctx{on.policy()};
  const adjustment_scene s = random_rows(30, 4000, 30000, row_order::any);
  auto* const locked = turbomap::default_staging_resource(turbomap::device_memory{});
  const auto in = [&](const auto& from) {
    using element = typename std::decay_t<decltype(from)>::value_type;
    std::pmr::vector<element> to(from.begin(), from.end(), locked);
    return to;
  };
  auto frame = in(s.frame), landmark = in(s.landmark);
  auto pixel = in(s.pixel), points = in(s.points);
  auto information = in(s.information);
  using turbomap::is_page_locked;
  CHECK(is_page_locked(ctx.policy(), pixel.data(), pixel.size() * sizeof(pixel[0])));
  CHECK_FALSE(is_page_locked(ctx.policy(), s.pixel.data(), s.pixel.size() * sizeof(s.pixel[0])));
  CHECK_FALSE(is_page_locked(ctx.policy(), pixel.data(), 0));
  const auto estimate = [&](device_problem& problem) {
    adjusted a;
    auto options = in_float64();
    options.max_iterations = 2;
    a.summary = turbomap::adjust<float64_methods>(ctx, problem, options);
    problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
    return a;
  };
  device_problem problem(ctx);
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  const adjusted expected = estimate(problem);
  auto group = s.group();
  const auto views = [&] {
    group.frame = turbomap::span<const std::int32_t>(frame),
    group.landmark = turbomap::span<const std::int32_t>(landmark);
    group.pixel = turbomap::span<const turbomap::vec3<double>>(pixel);
    group.information = turbomap::span<const double>(information);
    auto landmarks = s.landmark_input();
    landmarks.positions = turbomap::span<const turbomap::vec3<double>>(points);
    return landmarks;
  };
  problem.assign(ctx, s.frame_input(), views(), group);
  REQUIRE(problem.data().structure.elsewhere);
  for (auto& z : pixel) z = {0, 0, 0};
  for (auto& x : points) x = {0, 0, 0};
  for (auto& l : landmark) l = 0;
  const adjusted found = estimate(problem);
  CHECK(same_bits(found.summary, expected.summary));
  CHECK(same_bits(found.points, expected.points));
  CHECK(distance(found.poses, expected.poses) == 0);

  // Half of it: some arrays are staged, the others are not, in either order.
  pixel = in(s.pixel), points = in(s.points), landmark = in(s.landmark);
  auto landmarks = views();
  group.pixel = turbomap::span<const turbomap::vec3<double>>(s.pixel);
  group.frame = turbomap::span<const std::int32_t>(s.frame);
  problem.assign(ctx, s.frame_input(), landmarks, group);
  CHECK(same_bits(estimate(problem).points, expected.points));
  landmarks = views();
  group.information = turbomap::span<const double>(s.information);
  group.landmark = turbomap::span<const std::int32_t>(s.landmark);
  landmarks.positions = turbomap::span<const turbomap::vec3<double>>(s.points);
  problem.assign(ctx, s.frame_input(), landmarks, group);
  CHECK(same_bits(estimate(problem).points, expected.points));
}

TEST_CASE("chi2 and depth are those of the host, row by row; the solvers that need the lists on the host find them") {
  const stream on;
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    CAPTURE(static_cast<int>(kind));
    const adjustment_scene s = make_adjustment_scene(kind, 9, 2, 120, 6);
    const auto run = [&](auto policy, turbomap::reduced_solver solver, std::vector<double>& chi2,
                         std::vector<double>& depth) {
      using policy_type = decltype(policy);
      turbomap::context<policy_type> ctx{policy};
      turbomap::bundle_problem<policy_type, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
      problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
      auto options = in_float64();
      options.solver = solver, options.max_iterations = 4;
      adjusted a;
      a.summary = turbomap::adjust<float64_methods>(ctx, problem, options);
      problem.template chi2<0>(ctx, chi2, depth);
      problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
      return a;
    };
    for (const auto solver :
         {turbomap::reduced_solver::dense, turbomap::reduced_solver::sparse, turbomap::reduced_solver::pcg}) {
      CAPTURE(static_cast<int>(solver));
      std::vector<double> chi2, depth, host_chi2, host_depth;
      const auto host = run(sequential{}, solver, host_chi2, host_depth);
      const auto a = run(on.policy(), solver, chi2, depth);
      CHECK(distance(a.poses, host.poses) <= 1e-9);
      REQUIRE(chi2.size() == s.frame.size());
      REQUIRE(host_chi2.size() == s.frame.size());
      double worst = 0;
      for (std::size_t i = 0; i < chi2.size(); ++i) {
        worst = larger_or_nan(worst, std::abs(chi2[i] - host_chi2[i]) / std::max(1.0, host_chi2[i]));
        worst = larger_or_nan(worst, std::abs(depth[i] - host_depth[i]));
      }
      CHECK(worst <= 1e-7);
    }
  }
}

TEST_CASE("measurements that are on the device already are read there; results come together") {
  const stream on;
  turbomap::context<stream_policy> ctx{on.policy()};
  const adjustment_scene s = make_adjustment_scene(scene_kind::stereo, 9, 2, 120, 6);
  turbomap::array<turbomap::vec3<double>, turbomap::device_memory> pixel(ctx.resource());
  turbomap::array<double, turbomap::device_memory> information(ctx.resource());
  pixel.resize_discard(s.pixel.size()), information.resize_discard(s.information.size());
  turbomap::copy_in(ctx.policy(), pixel.data(), s.pixel.data(), s.pixel.size() * sizeof(s.pixel[0]));
  turbomap::copy_in(ctx.policy(), information.data(), s.information.data(), s.information.size() * sizeof(double));
  ctx.synchronize();
  struct outcome {
    adjusted a;
    std::vector<double> chi2, depth;
  };
  const auto run = [&](const auto& group, bool together) {
    outcome o;
    turbomap::bundle_problem<stream_policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
    problem.assign(ctx, s.frame_input(), s.landmark_input(), group);
    o.a.summary = turbomap::adjust<float64_methods>(ctx, problem, in_float64());
    if (together) {
      problem.template results<0>(ctx, o.a.poses, o.a.points, o.chi2, o.depth);
    } else {
      problem.frames(ctx, o.a.poses), problem.landmarks(ctx, o.a.points);
      problem.template chi2<0>(ctx, o.chi2, o.depth);
    }
    return o;
  };
  const outcome expected = run(s.group(), false);
  adjustment_scene elsewhere = s;  // stereo rows are told from these; else they are not looked at
  for (auto& z : elsewhere.pixel) z.x += 7, z.y -= 3;
  auto group = elsewhere.group();
  group.resident_pixel = pixel.data(), group.resident_information = information.data();
  const outcome found = run(group, true);
  REQUIRE(expected.a.summary.accepted > 0);
  CHECK(same_bits(found.a.summary, expected.a.summary));
  CHECK(same_bits(found.a.points, expected.a.points));
  CHECK(distance(found.a.poses, expected.a.poses) == 0);
  CHECK(found.chi2 == expected.chi2);
  CHECK(found.depth == expected.depth);
}

}  // namespace

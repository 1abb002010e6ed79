// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Couplings that are made of rows are those that linearisation writes, and its costs are those of the pass for costs alone.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "adjustment_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap_test::sequential;

/// What linearisation and elimination write of a scene, in numbers of A.
template <class A>
struct eliminated_scene {
  using problem_type =
      turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera, turbomap::huber>>;
  static constexpr int V = 6, width = turbomap::column_lanes<V>;

  turbomap::context<sequential> ctx;
  problem_type problem{ctx};
  turbomap::schur_view<A> s{};
  std::vector<A> row, coupling, z, axes;
  std::vector<double> partial, H, b, centres, cost;
  std::vector<turbomap::eliminated_landmark> landmark;
  std::vector<std::uint32_t> held;

  explicit eliminated_scene(const adjustment_scene& scene) {
    problem.assign(ctx, scene.frame_input(), scene.landmark_input(), scene.group());
    auto& data = problem.data();
    const auto& structure = data.structure;
    const auto free = static_cast<std::size_t>(structure.free_frames);
    data.lists.point(s);
    s.free_frames = structure.free_frames, s.landmarks = structure.landmarks;
    row.resize(structure.rows() * 9 + turbomap::column_slack);
    coupling.resize(structure.couplings() * 3 * V + turbomap::column_slack);
    z.resize(structure.slots() * 3 * V + turbomap::column_slack);
    partial.resize(static_cast<std::size_t>(structure.partials) * turbomap::landmark_block<V>::partial);
    H.resize(free * turbomap::frame_block<V>::triangle), b.resize(free * V);
    axes.resize(free * 6 * width), centres.resize(free * turbomap::landmark_stride);
    cost.resize(2 * structure.costs());
    landmark.resize(static_cast<std::size_t>(structure.landmarks));
    s.sums = {partial.data(), row.data(), nullptr, nullptr, nullptr};
    s.eliminated = z.data(), s.landmark = landmark.data(), s.H = H.data(), s.b = b.data();
    s.axes = axes.data(), s.centres = centres.data(), s.positions = data.estimate.current().landmarks;
    for (std::size_t f = 0; f < free; ++f) held.push_back(f % 3 == 1 ? 0x15U : f % 3 == 2 ? 0x38U : 0U);
  }

  turbomap::cost_sums costs() { return {cost.data(), cost.data() + problem.structure().costs()}; }

  /// The columns that are left of all couplings.
  std::vector<A> columns(bool of_rows, bool hold) {
    auto& data = problem.data();
    const auto x = data.estimate.current();
    const auto& policy = ctx.policy();
    const std::uint32_t* masks = hold ? held.data() : nullptr;
    s.sums.coupling = of_rows ? nullptr : coupling.data();
    std::get<0>(data.groups).template linearise<double>(policy, x, s.sums, costs());
    if (of_rows)
      turbomap::launch_prepare_axes<V>(policy, problem.frame_count(), s.free_of_frame, x.poses, masks, axes.data(),
                                       centres.data());
    if (hold) turbomap::launch_hold_unknowns<V, V>(policy, s, masks, static_cast<int>(problem.structure().slots()));
    std::fill(z.begin(), z.end(), A(0));
    turbomap::launch_eliminate_landmarks<V>(policy, s, turbomap::damping{1e-3});
    return {z.begin(), z.end() - turbomap::column_slack};
  }
};

template <class A>
double largest_difference(const std::vector<A>& a, const std::vector<A>& b) {
  double most = 0, scale = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    most = std::max(most, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
    scale = std::max(scale, std::abs(static_cast<double>(a[i])));
  }
  REQUIRE(scale > 0);
  return most / scale;
}

TEST_CASE_TEMPLATE("couplings of rows are those of linearisation", A, double, float) {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig})
    for (const bool hold : {false, true}) {
      CAPTURE(static_cast<int>(kind));
      CAPTURE(hold);
      eliminated_scene<A> scene(make_adjustment_scene(kind, 7, 2, 60, 5));
      const auto stored = scene.columns(false, hold), made = scene.columns(true, hold);
      REQUIRE(stored.size() == made.size());
      CHECK(largest_difference(stored, made) < (sizeof(A) == 8 ? 1e-12 : 3e-5));
    }
}

TEST_CASE("linearisation gives the cost that is asked for alone") {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    auto given = make_adjustment_scene(kind, 7, 2, 60, 5);
    given.points[3] = given.points[4] = {0, 0, -1e-9};  // some rows have no projection
    given.poses[0] = {}, given.poses[1] = {};
    eliminated_scene<double> scene(given);
    scene.columns(true, false);
    const auto both = scene.cost;
    std::fill(scene.cost.begin(), scene.cost.end(), -1);
    auto& data = scene.problem.data();
    std::get<0>(data.groups).template cost<double>(scene.ctx.policy(), data.estimate.current(), scene.costs());
    for (std::size_t i = 0; i < both.size(); ++i) CHECK(both[i] == doctest::Approx(scene.cost[i]).epsilon(1e-12));
    CHECK(*std::max_element(both.begin() + static_cast<std::ptrdiff_t>(both.size() / 2), both.end()) > 0);
  }
}

}  // namespace

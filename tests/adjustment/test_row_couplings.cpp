// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Couplings that are made of rows are those that linearisation writes, and its costs are those of the pass for costs alone.
// Columns in compact form give the same reduced system and the same steps of landmarks.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <tuple>
#include <vector>

#include "adjustment_cases.hpp"
#include "reference/larger_or_nan.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap_test::sequential;

/// A reduced system and what follows from a step of the frames.
struct reduced_scene {
  std::vector<double> S;      ///< blocks of 6 x 6: those of the free frames, then those of pairs of frames
  std::vector<double> right;  ///< its right hand side
  std::vector<double> moved;  ///< steps of the landmarks
  std::vector<double> gains;  ///< what they promise
  bool operator==(const reduced_scene& o) const {
    return S == o.S && right == o.right && moved == o.moved && gains == o.gains;
  }
};

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
  std::vector<double> partial, H, b, centres, cost, turned;
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
    turned.resize(free * turbomap::turned_stride);
    partial.resize(static_cast<std::size_t>(structure.partials) * turbomap::landmark_block<V>::partial);
    H.resize(free * turbomap::frame_block<V>::triangle), b.resize(free * V);
    axes.resize(free * 6 * width), centres.resize(free * turbomap::landmark_stride);
    cost.resize(2 * structure.costs());
    landmark.resize(static_cast<std::size_t>(structure.landmarks));
    s.sums = {partial.data(), row.data(), nullptr, nullptr, nullptr};
    s.eliminated = z.data(), s.landmark = landmark.data(), s.H = H.data(), s.b = b.data();
    s.turned = turned.data(), s.axes = axes.data(), s.centres = centres.data();
    s.positions = data.estimate.current().landmarks;
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

  /// The reduced system, then the landmarks after a step and what the step promises. What is not written is not a number.
  template <class Policy>
  reduced_scene system_and_step(const Policy& policy, bool compact, bool hold) {
    constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
    auto& data = problem.data();
    data.need_blocks(ctx.policy());
    data.lists.point(s);
    s.blocks = static_cast<int>(data.structure.block_row.size());
    s.compact = compact;
    columns(true, hold);
    turbomap::launch_sum_frames<V, V>(policy, s);
    const turbomap::damping damping{1e-3};
    turbomap::launch_eliminate_landmarks<V>(policy, s, damping);
    const auto free = static_cast<std::size_t>(s.free_frames), blocks = static_cast<std::size_t>(s.blocks);
    const std::size_t size = (free + blocks) * V * V, right = free * V;
    const auto points = static_cast<std::size_t>(s.landmarks) * turbomap::landmark_stride;
    const auto gains = static_cast<std::size_t>(turbomap::landmark_gain_count(s.landmarks));
    std::vector<double> step;
    reduced_scene out{std::vector<double>(size, nothing), std::vector<double>(right, nothing),
                      std::vector<double>(points, nothing), std::vector<double>(gains, nothing)};
    turbomap::launch_reduce_blocks<V, V>(policy, s, {out.S.data(), out.right.data(), 0, false}, damping);
    for (std::size_t i = 0; i < right; ++i)
      step.push_back(hold && held[i / V] >> i % V & 1U ? 0 : 0.01 * std::sin(7.0 * i));
    turbomap::launch_substitute_landmarks<V, V>(policy, s, step.data(), damping, s.positions, out.moved.data(),
                                                out.gains.data());
    for (std::size_t i = 0; i < points; ++i) out.moved[i] -= s.positions[i];
    return out;
  }

  /// How far S is from another of the same scene: of each number, by what its two unknowns have before the elimination.
  double largest_difference_of_blocks(const reduced_scene& a, const reduced_scene& b) const {
    const auto before = [&](int unknown) {
      const double* block = H.data() + unknown / V * turbomap::frame_block<V>::triangle;
      const int i = unknown % V;
      return std::max(block[i * (i + 1) / 2 + i], 1e-3);
    };
    const auto& structure = problem.structure();
    double most = 0;
    for (int i = 0; i < s.free_frames + s.blocks; ++i) {
      const auto pair = static_cast<std::size_t>(i - s.free_frames);
      const int row = i < s.free_frames ? i : structure.block_row[pair];
      const int column = i < s.free_frames ? i : structure.block_column[pair];
      for (int k = 0; k < V * V; ++k) {
        const auto at = static_cast<std::size_t>(i * V * V + k);
        const double scale = std::sqrt(before(row * V + k / V) * before(column * V + k % V));
        most = larger_or_nan(most, std::abs(a.S[at] - b.S[at]) / scale);
      }
    }
    return most;
  }
};

template <class A>
double largest_difference(const std::vector<A>& a, const std::vector<A>& b) {
  double most = 0, scale = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    most = larger_or_nan(most, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
    scale = std::max(scale, std::abs(static_cast<double>(a[i])));
  }
  REQUIRE(scale > 0);
  return most / scale;
}

/// Axes of frames of which landmarks see V unknowns: nothing is written beyond what normal_equations takes for them.
template <class A, int V>
void check_room_of_axes() {
  CAPTURE(V);
  constexpr int frames = 3;
  constexpr std::size_t room = 6 * turbomap::column_lanes<V> * frames, centres = turbomap::landmark_stride * frames;
  const std::int32_t free_of_frame[frames] = {2, 0, 1};
  std::vector<turbomap::isometry<double>> T(frames);
  for (auto& x : T)
    for (int i = 0; i < 9; ++i) x.R.m[i] = 7 + i;
  constexpr int canary = -1;
  std::vector<A> axes(room + 64, A(canary));
  std::vector<double> centre(centres + 64, canary);
  turbomap::launch_prepare_axes<V>(sequential{}, frames, free_of_frame, T.data(), nullptr, axes.data(), centre.data());
  CHECK(std::count(axes.begin(), axes.begin() + room, A(canary)) == 0);
  CHECK(std::count(axes.begin() + room, axes.end(), A(canary)) == 64);
  CHECK(std::count(centre.begin() + centres, centre.end(), canary) == 64);
}

TEST_CASE_TEMPLATE("axes of frames stay within their room", A, double, float) {
  check_room_of_axes<A, 6>(), check_room_of_axes<A, 7>(), check_room_of_axes<A, 9>(), check_room_of_axes<A, 15>();
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

TEST_CASE("columns in compact form give the same system and the same step") {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig})
    for (const int points : {0, 1, 5, 60})
      for (const bool hold : {false, true}) {
        CAPTURE(static_cast<int>(kind));
        CAPTURE(points);
        CAPTURE(hold);
        eliminated_scene<double> scene(make_adjustment_scene(kind, 7, 2, points, 5));
        const turbomap_test::sequential policy;
        const auto plain = scene.system_and_step(policy, false, hold);
        const auto compact = scene.system_and_step(policy, true, hold);
        for (const auto* part : {&compact.S, &compact.right, &compact.moved, &compact.gains})
          for (const double x : *part) CHECK(std::isfinite(x));
        const double tolerance = 1e-12;
        CHECK(scene.largest_difference_of_blocks(plain, compact) < tolerance);
        if (points == 0) continue;
        CHECK(largest_difference(plain.right, compact.right) < tolerance);
        // A step of a landmark is what is left of larger numbers.
        CHECK(largest_difference(plain.moved, compact.moved) < 10 * tolerance);
        CHECK(largest_difference(plain.gains, compact.gains) < tolerance);
      }
}

// A vehicle that drives towards its landmarks: 80 m from the first frame, 1 m from the last. Sums with the q of one frame that
// are shifted to that of the other lose digits here: fewer than the blocks of the frames have lost anyway.
TEST_CASE("columns in compact form where one frame is much nearer than another") {
  constexpr int frames = 7;
  auto given = make_adjustment_scene(scene_kind::stereo, 0, 0, 0, 5);
  for (int l = 0; l < 60; ++l) {
    const double angle = 0.7 * l, aside = 0.1 + 0.005 * l;
    given.points.push_back({aside * std::cos(angle), aside * std::sin(angle), 80 + 0.01 * l});
  }
  for (int f = 0; f < frames; ++f) {
    given.poses.push_back({});
    given.poses.back().tz = -79.0 * f / (frames - 1);
    given.fixed.push_back(0);
    for (std::size_t l = 0; l < given.points.size(); ++l) {
      const vec3<double> p{given.points[l].x, given.points[l].y, given.points[l].z + given.poses.back().tz};
      vec2<double> q{};
      REQUIRE(given.rig[0].camera.project(p, q));
      given.frame.push_back(f), given.landmark.push_back(static_cast<std::int32_t>(l)), given.camera.push_back(0);
      given.pixel.push_back({q.x + 0.5, q.y - 0.5, q.x - given.rig[0].bf / p.z}), given.information.push_back(1);
    }
  }
  eliminated_scene<double> scene(given);
  const turbomap_test::sequential policy;
  const auto plain = scene.system_and_step(policy, false, false), compact = scene.system_and_step(policy, true, false);
  CHECK(scene.largest_difference_of_blocks(plain, compact) < 1e-14);
}

TEST_CASE_TEMPLATE("columns in compact form: the same bits under every policy", Policy, TURBOMAP_TEST_POLICIES) {
  eliminated_scene<double> scene(make_adjustment_scene(scene_kind::stereo, 12, 2, 300, 5));
  const auto once = scene.system_and_step(turbomap_test::sequential{}, true, false);
  CHECK(scene.system_and_step(Policy{}, true, false) == once);
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

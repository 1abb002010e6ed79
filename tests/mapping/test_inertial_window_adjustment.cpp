// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Inertial adjustment on a map: window and result against their definitions, what changes meanwhile, what cannot be used.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <turbomap/map/validate.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <functional>
#include <limits>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "inertial_adjustment_cases.hpp"
#include "support/policies.hpp"

namespace turbomap_test {

/// Somebody may enter before each time that the guard is taken.
struct entered_inertial_map : inertial_map {
  explicit entered_inertial_map(const inertial_map& map) : inertial_map(map) {}
  std::function<void()> before;
  std::mutex mutex;
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::entered_inertial_map> : turbomap::map_traits<turbomap_test::inertial_map> {
  static std::unique_lock<std::mutex> guard(turbomap_test::entered_inertial_map& m) {
    m.before();
    return std::unique_lock<std::mutex>(m.mutex);
  }
};
template <>
struct turbomap::inertial_traits<turbomap_test::entered_inertial_map>
    : turbomap::inertial_traits<turbomap_test::inertial_map> {};

namespace {

using namespace turbomap_test;
using turbomap::adjustment_end;
using turbomap::inertial_adjustment_options;
using turbomap::local_adjustment_options;
constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

local_adjustment_options exact() {
  local_adjustment_options o;
  o.solve.numbers = turbomap::precision::float64, o.solve.min_relative_decrease = 0;
  return o;
}
inertial_adjustment_options window_of(int keyframes, int observers = 200) {
  inertial_adjustment_options o;
  o.strong_points = -1, o.window.keyframes = keyframes, o.most_observers = observers;
  return o;
}

/// The window by its definition, in places of the scene.
struct defined_window {
  int first = 0;        ///< the end of the chain
  bool begins = false;  ///< it is the first keyframe of the map: its pose is held; else it is fixed
  std::set<std::size_t> points, observers;
  std::size_t rows = 0;
};
defined_window window_by_definition(const inertial_map_scene& s, int current, int keyframes, int most) {
  defined_window w;
  w.first = std::max(0, current - keyframes), w.begins = current < keyframes;
  const auto place = [&](const turbomap::map_keyframe_id& k) {
    return static_cast<std::size_t>(std::find(s.keyframes.begin(), s.keyframes.end(), k) - s.keyframes.begin());
  };
  std::vector<std::size_t> order;  // of points: as they are met
  for (int f = current; f > (w.begins ? -1 : w.first); --f) {
    const auto k = s.keyframes[static_cast<std::size_t>(f)];
    for (std::size_t i = 0; i < s.map.keypoints(k).size(); ++i) {
      const auto p = s.map.point_at(k, i);
      if (p == turbomap::map_point_id{}) continue;
      const auto l = static_cast<std::size_t>(std::find(s.points.begin(), s.points.end(), p) - s.points.begin());
      if (w.points.insert(l).second) order.push_back(l);
    }
  }
  const auto in = [&](std::size_t k) {
    return (static_cast<int>(k) >= w.first && static_cast<int>(k) <= current) || w.observers.count(k) != 0;
  };
  for (const std::size_t l : order) {
    if (static_cast<int>(w.observers.size()) == most) break;
    for (const auto& o : s.map.observations(s.points[l])) {
      const std::size_t k = place(s.map.keyframe_at(o.keyframe));
      if (in(k)) continue;
      w.observers.insert(k);
      break;
    }
  }
  for (const std::size_t l : order)
    for (const auto& o : s.map.observations(s.points[l])) w.rows += in(place(s.map.keyframe_at(o.keyframe))) ? 1 : 0;
  return w;
}

/// The adjusted states of the window, by a problem that is put together here, in the order of time.
std::vector<turbomap::inertial_state<double>> adjusted_by_definition(const inertial_map_scene& s,
                                                                     const defined_window& w, int current,
                                                                     const local_adjustment_options& options,
                                                                     const turbomap::inertial_window_options& window) {
  using edges_type = turbomap::inertial_edges;
  turbomap::context<sequential> ctx;
  std::vector<std::size_t> frames;
  for (int f = w.first; f <= current; ++f) frames.push_back(static_cast<std::size_t>(f));
  for (const std::size_t k : w.observers) frames.push_back(k);
  const std::size_t chain = static_cast<std::size_t>(current - w.first) + 1;
  std::vector<turbomap::inertial_state<double>> states;
  std::vector<std::uint8_t> fixed;
  std::vector<std::uint32_t> held(frames.size(), 0);
  using turbomap::inertial_frame;
  if (w.begins) held[0] = inertial_frame::hold_pose | (current < 10 ? inertial_frame::hold_biases : 0U);
  edges_type edges;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const auto k = s.keyframes[frames[f]];
    states.push_back({s.map.T_cw(k), s.map.velocity(k), s.map.bias(k)});
    fixed.push_back((f == 0 && !w.begins) || f >= chain ? 1 : 0);
    if (f > 0 && f < chain)
      edges.add(static_cast<std::int32_t>(f - 1), static_cast<std::int32_t>(f), *s.map.motion(k), f == 1 && !w.begins,
                window);
  }
  std::vector<turbomap::rig_camera<turbomap::pinhole<double>>> rig{{{435, 436, 367, 252}, {}, 47.9, {}}};
  auto seen = turbomap::huber_reprojections(turbomap::rig_view<turbomap::pinhole<double>>{rig.data(), 1});
  seen.mono_kernel.delta2 = options.mono_chi2, seen.stereo_kernel.delta2 = options.stereo_chi2;
  std::vector<std::int32_t> frame, landmark;
  std::vector<vec3<double>> pixel, points;
  for (const std::size_t l : w.points) {
    for (std::size_t f = 0; f < frames.size(); ++f)
      for (std::size_t i = 0; i < s.map.keypoints(s.keyframes[frames[f]]).size(); ++i) {
        if (!(s.map.point_at(s.keyframes[frames[f]], i) == s.points[l])) continue;
        const auto& k = s.map.keypoints(s.keyframes[frames[f]])[i];
        frame.push_back(static_cast<std::int32_t>(f)), landmark.push_back(static_cast<std::int32_t>(points.size()));
        pixel.push_back({static_cast<double>(k.x), static_cast<double>(k.y), static_cast<double>(k.u_right)});
      }
    points.push_back(s.map.position(s.points[l]));
  }
  const std::vector<double> information(frame.size(), 1);
  seen.frame = frame, seen.landmark = landmark, seen.pixel = pixel, seen.information = information;
  turbomap::inertial_factor factor;
  factor.T_bc = turbomap::to_isometry<double>(s.map.T_bc()), factor.gravity = s.map.gravity();
  turbomap::bundle_problem<sequential, turbomap::inertial_frame, turbomap::reprojections<turbomap::pinhole<double>>,
                           edges_type::factors, edges_type::robust_factors, edges_type::walk_factors>
      problem(ctx);
  problem.assign(ctx, {states, fixed, held}, {points, {}}, seen, edges.plain(factor), edges.robust(factor, window),
                 edges.walks());
  turbomap::adjustment_options solve = options.solve;
  solve.damping = turbomap::damping_rule::identity;
  solve.max_iterations = window.iterations, solve.initial_lambda = window.initial_lambda;
  turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, solve);
  turbomap::plain_vector<turbomap::inertial_state<double>> result;
  problem.frames(ctx, result);
  return {result.begin(), result.begin() + static_cast<std::ptrdiff_t>(chain)};
}

double difference(const turbomap::inertial_state<double>& a, const inertial_map& map, turbomap::map_keyframe_id k) {
  using turbomap::norm;
  const auto& T = map.T_cw(k);
  return std::max({norm(vec3<double>{a.T_cw.tx - T.tx, a.T_cw.ty - T.ty, a.T_cw.tz - T.tz}),
                   norm(vec3<double>{a.T_cw.qx - T.qx, a.T_cw.qy - T.qy, a.T_cw.qz - T.qz}),
                   norm(a.velocity - map.velocity(k)), norm(a.bias.gyro - map.bias(k).gyro),
                   norm(a.bias.acceleration - map.bias(k).acceleration)});
}

TEST_CASE_TEMPLATE("window and result are those of the definition", Policy, TURBOMAP_TEST_POLICIES) {
  for (const unsigned seed : {1U, 2U})
    for (const auto& numbers : std::vector<std::array<int, 3>>{
             {13, 5, 200}, {13, 5, 2}, {13, 40, 200}, {6, 40, 200}, {9, 4, 0}, {1, 1, 200}, {1, 2, 0}, {13, 1, 200}}) {
      const int current = numbers[0], keyframes = numbers[1], observers = numbers[2];
      CAPTURE(seed);
      CAPTURE(current);
      CAPTURE(keyframes);
      inertial_map_scene s({14, 20, seed});
      const auto options = exact();
      const auto inertial = window_of(keyframes, observers);
      const auto w = window_by_definition(s, current, keyframes, observers);
      const auto expected = adjusted_by_definition(s, w, current, options, inertial.window);
      const inertial_map_scene before = s;
      const auto summary = inertial_run<Policy>(Policy{}, s)(current, options, inertial);
      CHECK(summary.inertial);
      CHECK_FALSE(summary.stale);
      CHECK(summary.free_keyframes == static_cast<std::size_t>(current - w.first + (w.begins ? 1 : 0)));
      CHECK(summary.inertial_edges == static_cast<std::size_t>(current - w.first));
      CHECK(summary.fixed_keyframes == (w.begins ? 0 : 1) + w.observers.size());
      CHECK(summary.points == w.points.size());
      CHECK(summary.observations == w.rows);
      REQUIRE(summary.solve.accepted > 0);
      CHECK(summary.solve.undetermined == 0);
      for (int f = 0; f < 14; ++f) {
        const auto i = static_cast<std::size_t>(f);
        const bool moves = f >= w.first + (w.begins ? 0 : 1) && f <= current;
        if (moves)
          CHECK(difference(expected[static_cast<std::size_t>(f - w.first)], s.map, s.keyframes[i]) < 1e-7);
        else
          CHECK(difference({before.map.T_cw(s.keyframes[i]), before.map.velocity(s.keyframes[i]),
                            before.map.bias(s.keyframes[i])},
                           s.map, s.keyframes[i]) == 0);
      }
      if (w.begins) CHECK(before.map.T_cw(s.keyframes[0]).qx == s.map.T_cw(s.keyframes[0]).qx);
      CHECK(turbomap::validate(s.map).empty());
    }
}

TEST_CASE("velocities are nearer to the truth than before, positions than without the IMU") {
  double with = 0, without = 0;
  for (const unsigned seed : {1U, 2U, 3U, 4U, 5U}) {
    inertial_map_scene s({14, 8, seed, 2.0, 0.0}), visual({14, 8, seed, 2.0, 0.0});
    visual.map.set_initialised(false);
    const double velocity = s.velocity_error(4, 14);
    for (int current = 6; current < 14; ++current) {
      inertial_run<sequential>(sequential{}, s)(current, exact(), window_of(10));
      inertial_run<sequential>(sequential{}, visual)(current, exact(), window_of(10));
    }
    CHECK(s.velocity_error(4, 14) < 0.8 * velocity);
    with += s.position_error(4, 14), without += visual.position_error(4, 14);
  }
  CHECK(with < without);
}

TEST_CASE_TEMPLATE("all policies leave the same bits", Policy, TURBOMAP_TEST_POLICIES) {
  inertial_recipe recipe;
  recipe.outliers = 0.05;
  inertial_map_scene s(recipe), other(recipe);
  for (const int current : {7, 10, 13}) {
    const auto a = inertial_run<sequential>(sequential{}, s)(current);
    const auto b = inertial_run<Policy>(Policy{}, other)(current);
    CHECK(a.outliers == b.outliers);
    CHECK(s.state() == other.state());
  }
}

TEST_CASE("read in parts: the same bits; whether a keyframe was moved in between is seen") {
  inertial_recipe recipe;
  recipe.outliers = 0.05;
  inertial_map_scene s(recipe), other(recipe);
  inertial_run<sequential> whole(sequential{}, s), parted(sequential{}, other);
  auto scope = whole.scope(), parts = parted.scope();
  scope.points_read_per_guard = 0, parts.points_read_per_guard = 7;
  for (const std::size_t current : {7U, 10U, 13U}) {
    const auto a = whole.adjust(scope, s.keyframes[current], {});
    const auto b = parted.adjust(parts, other.keyframes[current], {});
    CHECK(a.observations == b.observations);
    CHECK(s.state() == other.state());
  }
  CHECK(parted.held.count > 5 * whole.held.count);

  turbomap::inertial_window<inertial_map> window;
  window.choose(scope, s.keyframes[13], {}, {});
  CHECK(window.read(scope, 7));
  CHECK_FALSE(window.moved(scope));
  auto T = s.map.T_cw(s.keyframes[11]);
  T.tx += 1;
  s.map.set_pose(s.keyframes[11], T);
  CHECK(window.moved(scope));
}

TEST_CASE("a fixed keyframe is moved between two parts of the window: nothing is adjusted") {
  inertial_map_scene scene;
  inertial_run<sequential> run(sequential{}, scene);
  const auto fixed = scene.keyframes[8];
  struct outcome {
    int guards = 0;
    turbomap::local_adjustment_summary summary;
    bool same = true;  ///< poses of the keyframes that would move
  };
  const auto adjust = [&](int moved_at) {
    turbomap::context<sequential> ctx;
    entered_inertial_map map(scene.map);
    outcome o;
    map.before = [&] {
      if (o.guards++ != moved_at) return;
      auto T = map.T_cw(fixed);
      T.tx += 1;
      map.set_pose(fixed, T);
    };
    turbomap::guard_times held;
    turbomap::mapping_scope<entered_inertial_map, sequential> scope{ctx, map, run.store, run.stored, held};
    scope.points_read_per_guard = 7;
    turbomap::inertial_adjustment<entered_inertial_map, sequential, turbomap::every_adjustment_method> stage(ctx);
    o.summary = stage(scope, scene.keyframes[13], {}, window_of(5));
    CHECK(stage.points().empty() == o.summary.stale);
    for (std::size_t f = 9; f <= 13; ++f)
      o.same = o.same && turbomap::is_same_pose(map.T_cw(scene.keyframes[f]), scene.map.T_cw(scene.keyframes[f]));
    return o;
  };
  const outcome undisturbed = adjust(-1);
  CHECK(undisturbed.guards > 20);
  CHECK_FALSE(undisturbed.summary.stale);
  CHECK_FALSE(undisturbed.same);
  for (int g = 1; g + 1 < undisturbed.guards; ++g) {  // the last one is the commit's
    CAPTURE(g);
    const outcome o = adjust(g);
    CHECK(o.summary.stale);
    CHECK(o.summary.solve.end == adjustment_end::no_observations);
    CHECK(o.same);
  }
}

TEST_CASE("outliers leave the map; near points have a wider gate") {
  inertial_recipe recipe;
  recipe.outliers = 0.08;
  inertial_map_scene s(recipe), strict_gate(recipe);
  const auto a = inertial_run<sequential>(sequential{}, s)(13);
  CHECK(a.outliers > 10);
  CHECK(turbomap::validate(s.map).empty());
  inertial_adjustment_options narrow;
  narrow.near_depth = 0;
  local_adjustment_options tight, wide;
  tight.mono_chi2 = wide.mono_chi2 = 0.8;  // so that many are between the two gates
  wide.near_mono_factor = 8;
  inertial_map_scene t(recipe), u(recipe), v(recipe);
  const auto off = inertial_run<sequential>(sequential{}, t)(13, tight, narrow).outliers;
  const auto on = inertial_run<sequential>(sequential{}, u)(13, tight).outliers;
  CHECK(on < off);
  CHECK(inertial_run<sequential>(sequential{}, v)(13, wide).outliers < on);
}

TEST_CASE("by default a window ends near its optimum in fewer iterations than published, with either damping") {
  local_adjustment_options published;
  published.use_published_steps();
  int iterations = 0, iterations_published = 0, other_states = 0;
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    CAPTURE(seed);
    const auto adjusted = [&](const local_adjustment_options& options, const inertial_adjustment_options& inertial,
                              std::string& state) {
      inertial_map_scene s({14, 20, seed});
      const auto solve = inertial_run<sequential>(sequential{}, s)(13, options, inertial).solve;
      state = s.state();
      return solve;
    };
    auto inertial = window_of(10), diagonal = inertial, endless = inertial;
    diagonal.window.initial_lambda = 0, endless.window.iterations = 100;
    std::string state, state_diagonal, unused;
    const double least = adjusted(exact(), endless, unused).cost_final;
    const auto ours = adjusted({}, inertial, state), scaled = adjusted({}, diagonal, state_diagonal);
    for (const auto& a : {ours, scaled}) {
      CHECK(a.end == adjustment_end::converged);
      CHECK(a.cost_final < (1 + 1e-3) * least);
    }
    other_states += state == state_diagonal ? 0 : 1;
    iterations += ours.iterations, iterations_published += adjusted(published, inertial, unused).iterations;
  }
  CHECK(iterations < iterations_published);
  CHECK(other_states == 4);
}

TEST_CASE("a time budget ends an adjustment that runs, and what it found is written") {
  inertial_map_scene s;
  const auto before = s.state();
  local_adjustment_options options;
  options.solve.time_budget_ms = 1e-6;
  const auto summary = inertial_run<sequential>(sequential{}, s)(13, options, window_of(10));
  CHECK(summary.solve.end == adjustment_end::time_budget);
  CHECK(summary.solve.iterations == 1);
  CHECK(summary.solve.accepted == 1);
  CHECK(s.state() != before);
}

TEST_CASE("before the IMU is initialised it is a local adjustment") {
  inertial_map_scene s, visual;
  s.map.set_initialised(false);
  turbomap::local_adjustment_options options;
  const auto a = inertial_run<sequential>(sequential{}, s)(13, options);
  CHECK_FALSE(a.inertial);
  CHECK(a.solve.accepted > 0);
  inertial_run<sequential> run(sequential{}, visual);
  turbomap::local_adjustment<inertial_map, sequential, turbomap::every_adjustment_method> adjust(run.ctx);
  adjust(run.scope(), visual.keyframes[13], options);
  CHECK(s.state() == visual.state());
}

TEST_CASE("a keyframe that has died leaves no points of the adjustment before") {
  inertial_map_scene s({14, 20, 1, 0.5, 0.1});
  inertial_run<sequential> run(sequential{}, s);
  for (const bool inertial : {false, true}) {
    CAPTURE(inertial);
    s.map.set_initialised(inertial);
    run(13 - (inertial ? 1 : 0));
    REQUIRE(run.adjust.points().size() > 0);
    const auto k = s.keyframes[inertial ? 12 : 13];
    turbomap::erase_keyframe(s.map, k);
    CHECK(run.adjust(run.scope(), k, {}).stale);
    CHECK(run.adjust.points().size() == 0);
    CHECK(run.adjust.points_that_lost_views().size() == 0);
  }
}

TEST_CASE("the large window where tracking is strong; young estimates make every edge robust") {
  inertial_map_scene s;
  inertial_adjustment_options o;
  o.window.keyframes = 3, o.large.keyframes = 6, o.strong_points = 1;
  CHECK(inertial_run<sequential>(sequential{}, s)(13, {}, o).free_keyframes == 6);
  o.strong_points = 100000;
  CHECK(inertial_run<sequential>(sequential{}, s)(13, {}, o).free_keyframes == 3);
  inertial_map_scene young, old;
  for (auto* m : {&young.map, &old.map})  // an edge that is badly off
    m->set_velocity(young.keyframes[12], {5, 5, 5});
  young.map.set_refined(false);
  auto few = exact();
  const auto a = inertial_run<sequential>(sequential{}, young)(13, few, window_of(8));
  const auto b = inertial_run<sequential>(sequential{}, old)(13, few, window_of(8));
  CHECK(a.solve.cost_initial < 0.5 * b.solve.cost_initial);
}

TEST_CASE("while the estimates are young the map may turn about its first keyframe") {
  for (const bool young : {false, true}) {
    inertial_map_scene s;
    s.map.set_refined(!young);
    const auto centre = [&s] {
      return turbomap::camera_centre(turbomap::to_isometry<double>(s.map.T_cw(s.keyframes[0])));
    };
    const auto at = centre();
    const double q = s.map.T_cw(s.keyframes[0]).qx;
    inertial_run<sequential>(sequential{}, s)(13, exact(), window_of(40));
    CHECK(turbomap::norm(centre() - at) < 1e-9);
    CHECK((s.map.T_cw(s.keyframes[0]).qx == q) == !young);
  }
}

TEST_CASE("where the keyframe before cannot be used, the window ends in a fixed one all the same") {
  for (const bool young : {false, true}) {
    inertial_map_scene s;
    s.map.set_refined(!young);
    inertial_run<sequential> run(sequential{}, s);
    run.stored.erase(inertial_map_traits::id(s.map, s.keyframes[2]));
    const auto before = s.map.T_cw(s.keyframes[3]);
    const auto velocity = s.map.velocity(s.keyframes[3]);
    const auto summary = run(13, exact(), window_of(40));
    CHECK(summary.free_keyframes == 10);
    REQUIRE(summary.solve.accepted > 0);
    CHECK(s.map.T_cw(s.keyframes[3]).qx == before.qx);
    CHECK(s.map.velocity(s.keyframes[3]).x == velocity.x);
  }
}

TEST_CASE("changed meanwhile: nothing is written") {
  for (const int what : {0, 1, 2, 3, 4}) {
    CAPTURE(what);
    inertial_map_scene s;
    inertial_run<sequential> run(sequential{}, s);
    turbomap::local_adjustment_summary summary;
    const auto scope = run.scope();
    run.adjust.snapshot(scope, s.keyframes[13], {}, window_of(6), summary);
    REQUIRE(run.adjust.compute(scope, {}, summary));
    const auto k = s.keyframes[11];
    if (what == 0) s.map.set_velocity(k, {1, 2, 3});
    if (what == 1) s.map.set_bias(k, {{0.1, 0, 0}, {}});
    if (what == 2) s.map.set_pose(k, {});
    if (what >= 3) {  // 11 moves; 7 holds the window
      const auto gone = what == 3 ? k : s.keyframes[7];
      turbomap::bridge_motion(s.map, gone);
      turbomap::erase_keyframe(s.map, gone);
    }
    const auto before = s.state();
    run.adjust.commit(scope, {}, summary);
    CHECK(summary.stale);
    CHECK(s.state() == before);
  }
}

TEST_CASE("stopped before it began, a dead keyframe, bad options: the map stays") {
  inertial_map_scene s;
  inertial_run<sequential> run(sequential{}, s);
  const auto before = s.state();
  const std::atomic<bool> stop{true};
  local_adjustment_options options;
  options.solve.stop = &stop;
  CHECK(run(13, options).solve.end == adjustment_end::stopped);
  CHECK(run.adjust(run.scope(), {}, {}).stale);
  for (int bad = 0; bad < 6; ++bad) {
    inertial_adjustment_options o;
    if (bad == 0) o.window.keyframes = 0;
    if (bad == 1) o.large.iterations = 0;
    if (bad == 2) o.window.initial_lambda = nan_value;
    if (bad == 3) o.most_observers = -1;
    if (bad == 4) o.max_time_error = nan_value;
    if (bad == 5) o.large.robust_chi2 = 0;
    CHECK_THROWS_AS(run(13, {}, o), std::invalid_argument);
  }
  s.map.set_gravity({0, nan_value, -9.81});
  CHECK_THROWS_AS(run(13), std::invalid_argument);
  CHECK(s.state() == before);
}

TEST_CASE("IMU data that cannot be used: refused, or noted and passed over") {
  using turbomap::map_fault;
  for (int what = 0; what < 7; ++what) {
    CAPTURE(what);
    inertial_map_scene s;
    const auto k = s.keyframes[11];
    turbomap::preintegration<double> p = *s.map.motion(k);
    map_fault expected = map_fault::bad_motion;
    if (what == 0) p.dV.x = nan_value, s.map.set_motion(k, p);
    if (what == 1) p.C_PP(1, 1) = std::numeric_limits<double>::infinity(), s.map.set_motion(k, p);
    if (what == 2) p.dt = 0, s.map.set_motion(k, p);
    if (what == 3) p.dt += 0.02, s.map.set_motion(k, p);  // another interval's
    if (what == 4) s.map.set_velocity(k, {nan_value, 0, 0}), expected = map_fault::bad_inertial_state;
    if (what == 5) s.map.set_bias(k, {{0, 0, nan_value}, {}}), expected = map_fault::bad_inertial_state;
    if (what == 6) s.map.clear_motion(k);  // a gap over the whole interval: known, so no fault
    const auto before = s.state();
    inertial_run<sequential> run(sequential{}, s);
    if (what < 6) {
      CHECK_THROWS_AS(run(13, {}, window_of(8)), turbomap::inconsistent_map);
      CHECK(s.state() == before);
    }
    turbomap::fault_list noted;
    const auto then = s.map.velocity(k);
    const auto summary = run(13, exact(), window_of(8), turbomap::fault_sink(noted));
    CHECK(noted.size() == (what < 6 ? 1 : 0));
    if (what < 6) {
      CHECK(noted[0].fault == expected);
      CHECK(noted[0].keyframe == 11);
    }
    CHECK(summary.free_keyframes == 8);
    CHECK(summary.inertial_edges == (what == 4 || what == 5 ? 6 : 7));
    REQUIRE(summary.solve.accepted > 0);
    CHECK(summary.solve.undetermined == 0);
    if (what == 4) CHECK(std::isnan(s.map.velocity(k).x));  // not made up
    if (what == 5) CHECK(s.map.velocity(k).x == then.x);
    // The biases of the first keyframe after the hole stay; its velocity is known from the next edge.
    if (what < 4 || what == 6) CHECK_FALSE(s.map.velocity(k).x == then.x);
    CHECK(summary.solve.cost_final < 0.5 * summary.solve.cost_initial);
  }
  inertial_map_scene s;  // no motion at all: velocities and biases stay, poses move
  for (const auto& k : s.keyframes) s.map.clear_motion(k);
  inertial_map_scene before = s;
  const auto summary = inertial_run<sequential>(sequential{}, s)(13, exact(), window_of(8));
  CHECK(summary.inertial_edges == 0);
  CHECK(summary.solve.accepted > 0);
  CHECK(summary.solve.undetermined == 0);
  for (const auto& k : s.keyframes) CHECK(s.map.velocity(k).x == before.map.velocity(k).x);
}

TEST_CASE("keyframes are culled: their motions merged are those integrated anew") {
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    inertial_map_scene s({20, 2, seed});
    const imu_bias<double> bias{{0.01, -0.02, 0.03}, {0.1, 0.2, -0.1}};
    for (int f = 1; f < 20; ++f) {
      const auto h = s.samples_between(f - 1, f);
      s.map.set_motion(s.keyframes[static_cast<std::size_t>(f)], turbomap::preintegrate(h, bias, {}), h);
    }
    std::mt19937 random(seed);
    std::vector<int> left;
    for (int f = 0; f < 20; ++f) left.push_back(f);
    while (left.size() > 4) {
      const auto at = 1 + random() % (left.size() - 1);
      const auto k = s.keyframes[static_cast<std::size_t>(left[at])];
      turbomap::bridge_motion(s.map, k);
      turbomap::erase_keyframe(s.map, k);
      left.erase(left.begin() + static_cast<std::ptrdiff_t>(at));
      for (std::size_t i = 1; i < left.size(); ++i) {
        const auto now = s.keyframes[static_cast<std::size_t>(left[i])];
        const auto* p = s.map.motion(now);
        REQUIRE(p != nullptr);
        const auto anew = turbomap::preintegrate(s.samples_between(left[i - 1], left[i]), bias, {});
        CHECK(std::abs(p->dt - anew.dt) < 1e-9);
        // At an end between two samples one integration has two steps where the other has one: noise and mean differ a little.
        CHECK(turbomap::norm(p->dV - anew.dV) < 2e-3 * anew.dt);
        CHECK(turbomap::norm(p->dP - anew.dP) < 2e-3 * anew.dt);
        // What is kept of the samples gives the merged motion again, to rounding.
        const auto again = turbomap::preintegrate(s.map.samples(now), bias, {});
        CHECK(turbomap::norm(p->dV - again.dV) < 1e-12);
        CHECK(turbomap::norm(p->dP - again.dP) < 1e-12);
        CHECK(covariance_difference(covariance_of(*p), covariance_of(again)) < 1e-9);
      }
    }
  }
  inertial_map_scene s;  // without one of the two motions the next keyframe has none
  s.map.clear_motion(s.keyframes[5]);
  turbomap::bridge_motion(s.map, s.keyframes[5]);
  turbomap::erase_keyframe(s.map, s.keyframes[5]);
  CHECK(s.map.motion(s.keyframes[6]) == nullptr);
  turbomap::bridge_motion(s.map, s.keyframes[13]);  // the last one: nothing follows
}

TEST_CASE("a bias that moved far: the samples are integrated again") {
  inertial_map_scene s;
  using inertial = turbomap::inertial_traits<inertial_map>;
  const auto k = s.keyframes[5];
  const auto before = *s.map.motion(k);
  imu_bias<double> bias = before.bias;
  bias.gyro.x += 0.005;  // below the limit
  inertial::bias_changed(s.map, k, bias);
  CHECK(s.map.motion(k)->bias.gyro.x == before.bias.gyro.x);
  bias.gyro.x += 0.05;
  inertial::bias_changed(s.map, k, bias);
  CHECK(s.map.motion(k)->bias.gyro.x == bias.gyro.x);
  CHECK(turbomap::norm(s.map.motion(k)->dP - before.dP) > 1e-6);
  s.map.set_motion(k, before);  // without samples it stays
  inertial::bias_changed(s.map, k, bias);
  CHECK(s.map.motion(k)->bias.gyro.x == before.bias.gyro.x);
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Inertial adjustment on a map: the cases of inertial_window_cases.hpp under host policies; reading in parts, gates, options, culling.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <turbomap/map/validate.hpp>

#include <cmath>
#include <functional>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "inertial_initialisation_cases.hpp"
#include "inertial_window_cases.hpp"
#include "support/policies.hpp"

namespace turbomap_test {

/// Somebody may enter before each time that the guard is taken.
struct entered_inertial_map : inertial_map {
  explicit entered_inertial_map(const inertial_map& map) : inertial_map(map) {}
  std::function<void()> before;
  std::mutex mutex;
  mutable int asked_of_dead = 0;  ///< whether one is the origin
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::entered_inertial_map> : turbomap::map_traits<turbomap_test::inertial_map> {
  static std::unique_lock<std::mutex> guard(turbomap_test::entered_inertial_map& m) {
    m.before();
    return std::unique_lock<std::mutex>(m.mutex);
  }
  static bool is_origin(const turbomap_test::entered_inertial_map& m, keyframe k) {
    m.asked_of_dead += m.alive(k) ? 0 : 1;
    return m.alive(k) && turbomap::map_traits<turbomap_test::inertial_map>::is_origin(m, k);
  }
};
template <>
struct turbomap::inertial_traits<turbomap_test::entered_inertial_map>
    : turbomap::inertial_traits<turbomap_test::inertial_map> {
  /// What converts to a transform will do.
  struct own_transform {
    rigid_transform<double> T;
    operator rigid_transform<double>() const { return T; }
  };
  static own_transform T_bc(const turbomap_test::entered_inertial_map& m) { return {m.T_bc()}; }
};

namespace {

using namespace turbomap_test;
using turbomap::adjustment_end;
using turbomap::inertial_adjustment_options;
using turbomap::local_adjustment_options;

TEST_CASE_TEMPLATE("window and result are those of the definition", Policy, TURBOMAP_TEST_POLICIES) {
  check_definition(Policy{});
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

TEST_CASE("the oldest keyframe of a window leaves the map between two parts: it is asked whether it lives, no more") {
  inertial_recipe recipe;
  recipe.step_ns = 20'000'000;  // others see the same points
  inertial_map_scene scene(recipe);
  inertial_run<sequential> run(sequential{}, scene);
  const auto oldest = scene.keyframes[8];
  int guards = 2;
  for (int at = 1; at < guards; ++at) {
    CAPTURE(at);
    turbomap::context<sequential> ctx;
    entered_inertial_map map(scene.map);
    int guard = 0;
    map.before = [&] {
      if (guard++ == at) turbomap::erase_keyframe<inertial_map>(map, oldest);
    };
    turbomap::guard_times held;
    turbomap::mapping_scope<entered_inertial_map, sequential> scope{ctx, map, run.store, run.stored, held};
    scope.points_read_per_guard = 100;
    turbomap::inertial_adjustment<entered_inertial_map, sequential, turbomap::every_adjustment_method> stage(ctx);
    stage(scope, scene.keyframes[13], {}, window_of(5));
    CHECK(map.asked_of_dead == 0);
    CHECK(turbomap::validate(map).empty());
    guards = guard;
  }
  CHECK(guards > 5);
}

TEST_CASE_TEMPLATE("outliers leave the map", Policy, TURBOMAP_TEST_POLICIES) { check_outliers(Policy{}); }

TEST_CASE("near points have a wider gate") {
  inertial_recipe recipe;
  recipe.outliers = 0.08;
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

TEST_CASE("by default a window ends near its optimum in fewer iterations than published") {
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
    auto inertial = window_of(10), identity = inertial, endless = inertial;
    identity.use_published_steps(), endless.window.iterations = 100;
    std::string state, state_identity, unused;
    const double least = adjusted(exact(), endless, unused).cost_final;
    const auto ours = adjusted({}, inertial, state);
    CHECK(ours.end == adjustment_end::converged);
    CHECK(ours.cost_final < (1 + 1e-3) * least);
    iterations += ours.iterations, iterations_published += adjusted(published, identity, unused).iterations;
    adjusted({}, identity, state_identity);
    other_states += state == state_identity ? 0 : 1;
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

TEST_CASE_TEMPLATE("the large window where tracking is strong", Policy, TURBOMAP_TEST_POLICIES) {
  check_large_window(Policy{});
}

TEST_CASE("young estimates make every edge robust") {
  inertial_map_scene young, old;
  for (auto* m : {&young.map, &old.map})  // an edge that is badly off
    m->set_velocity(young.keyframes[12], {5, 5, 5});
  young.map.set_refined(false);
  auto few = exact();
  const auto a = inertial_run<sequential>(sequential{}, young)(13, few, window_of(8));
  const auto b = inertial_run<sequential>(sequential{}, old)(13, few, window_of(8));
  CHECK(a.solve.cost_initial < 0.5 * b.solve.cost_initial);
}

TEST_CASE_TEMPLATE("while the estimates are young the map may turn about its first keyframe", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_young_map_turns(Policy{});
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

/// The position error of a keyframe that was set 5 cm off, before and after the adjustment of another one.
double corrected_by(inertial_map_scene& s, int off, int current, const turbomap::inertial_adjustment_options& options,
                    bool knows_previous = true) {
  auto T = s.map.T_cw(s.keyframes[static_cast<std::size_t>(off)]);
  T.tx += 0.05;
  s.map.set_pose(s.keyframes[static_cast<std::size_t>(off)], T);
  const double before = s.position_error(off, off + 1);
  inertial_run<sequential> run(sequential{}, s);
  if (!knows_previous) run.stored.erase(inertial_map_traits::id(s.map, s.keyframes[static_cast<std::size_t>(off - 1)]));
  run(current, exact(), options);
  return s.position_error(off, off + 1) / before;
}

TEST_CASE("a chain that begins anew in the middle of a map is held by the keyframes that see its points") {
  inertial_recipe recipe{14, 30, 1};
  recipe.step_ns = 20'000'000;  // they see the same points
  const inertial_map_scene whole(recipe);
  recipe.begins_anew = 10;
  for (const int current : {10, 13}) {
    CAPTURE(current);
    inertial_map_scene s(recipe), alone(recipe);
    CHECK(corrected_by(s, 10, current, window_of(10)) < 0.5);
    CHECK(corrected_by(alone, 10, current, window_of(10, 0)) == 1);  // nothing else would hold it
  }
  inertial_map_scene s = whole, origin = whole;
  CHECK(corrected_by(s, 13, 13, window_of(10), false) < 0.5);
  CHECK(corrected_by(origin, 0, 5, window_of(10), true) == 1);  // all keyframes that see it move
}

TEST_CASE("biases that do not walk are held by each other, not left free") {
  for (const bool gyro : {false, true}) {
    inertial_map_scene s({14, 60, 1});
    turbomap::preintegration_options options;
    (gyro ? options.noise.gyro_walk : options.noise.acceleration_walk) = 0;
    const auto bias = s.truth[0].bias;
    for (std::size_t f = 0; f < 14; ++f) {
      s.map.set_bias(s.keyframes[f], bias);
      if (f == 0) continue;
      const auto h = s.samples_between(static_cast<int>(f) - 1, static_cast<int>(f));
      s.map.set_motion(s.keyframes[f], turbomap::preintegrate(h, bias, options), h);
    }
    const auto summary = inertial_run<sequential>(sequential{}, s)(13, exact(), window_of(10));
    CHECK(summary.solve.accepted > 0);
    CHECK(summary.solve.undetermined == 0);
    for (std::size_t f = 4; f < 14; ++f) {
      CHECK(turbomap::norm(s.map.bias(s.keyframes[f]).gyro - bias.gyro) < 0.02);
      CHECK(turbomap::norm(s.map.bias(s.keyframes[f]).acceleration - bias.acceleration) < 0.2);
    }
  }
}

TEST_CASE("a motion whose covariance has no inverse is a hole: what is adjusted is as if it had not been measured") {
  for (const bool all : {true, false}) {
    CAPTURE(all);
    inertial_map_scene s, unmeasured;
    turbomap::preintegration_options exact_imu;
    exact_imu.noise = {0, 0, 0, 0, 0};
    for (std::size_t f = all ? 1 : 13; f < 14; ++f) {
      const auto h = s.samples_between(static_cast<int>(f) - 1, static_cast<int>(f));
      s.map.set_motion(s.keyframes[f], turbomap::preintegrate(h, s.truth[0].bias, exact_imu), h);
      unmeasured.map.clear_motion(s.keyframes[f]);
    }
    const auto summary = inertial_run<sequential>(sequential{}, s)(13, {}, window_of(10));
    const auto expected = inertial_run<sequential>(sequential{}, unmeasured)(13, {}, window_of(10));
    CHECK(summary.inertial_edges == (all ? 0 : 9));
    CHECK(summary.solve.iterations == expected.solve.iterations);
    CHECK(summary.solve.cost_final == expected.solve.cost_final);
    CHECK(distance(positions_of(s), positions_of(unmeasured)) == 0);
    CHECK(largest_difference(s, unmeasured) == 0);
  }
}

TEST_CASE("quaternions that are not quite of length 1, as floats give them, mean the same") {
  inertial_map_scene s, same;
  for (const auto& k : s.keyframes) {
    auto T = s.map.T_cw(k);
    const double scale = 1 + 4e-4;
    T.qx *= scale, T.qy *= scale, T.qz *= scale, T.qw *= scale;
    s.map.set_pose(k, T);
  }
  inertial_run<sequential>(sequential{}, s)(13, exact(), window_of(8));
  inertial_run<sequential>(sequential{}, same)(13, exact(), window_of(8));
  CHECK(s.position_error(6, 14) == doctest::Approx(same.position_error(6, 14)).epsilon(1e-6));
  CHECK(s.velocity_error(6, 14) == doctest::Approx(same.velocity_error(6, 14)).epsilon(1e-6));
}

TEST_CASE_TEMPLATE("changed meanwhile: nothing is written", Policy, TURBOMAP_TEST_POLICIES) {
  check_changed_meanwhile(Policy{});
}

TEST_CASE_TEMPLATE("stopped before it began, a dead keyframe, bad options: the map stays", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_refused(Policy{});
}

TEST_CASE_TEMPLATE("IMU data that cannot be used: refused, or noted and passed over", Policy, TURBOMAP_TEST_POLICIES) {
  check_unusable_imu_data(Policy{});
}

TEST_CASE_TEMPLATE("windows after an initialisation", Policy, TURBOMAP_TEST_TWO_POLICIES) {
  check_after_initialisation(Policy{});
}

TEST_CASE_TEMPLATE("a window of which keyframes were culled", Policy, TURBOMAP_TEST_POLICIES) {
  check_culled_window(Policy{});
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
  for (const int bad : {9, 10}) {  // nor with one that is no number: it would spoil the longer interval
    auto motion = *s.map.motion(s.keyframes[static_cast<std::size_t>(bad)]);
    motion.dV.x = std::nan("");
    s.map.set_motion(s.keyframes[static_cast<std::size_t>(bad)], motion);
    turbomap::bridge_motion(s.map, s.keyframes[9]);
    CHECK(s.map.motion(s.keyframes[10]) == nullptr);
    s.map.set_motion(s.keyframes[9], *s.map.motion(s.keyframes[8])),
        s.map.set_motion(s.keyframes[10], *s.map.motion(s.keyframes[8]));
  }
}

TEST_CASE("a keyframe that leaves: its motion is merged unless it is beyond the force that the options allow") {
  using stage = inertial_run<sequential>::adjustment;
  for (const bool allowed : {true, false}) {
    inertial_map_scene s;
    turbomap::inertial_adjustment_options options;
    if (!allowed) options.max_force = 1;  // gravity alone is more
    stage::erasing(s.map, s.keyframes[5], options);
    CHECK((s.map.motion(s.keyframes[6]) != nullptr) == allowed);
  }
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

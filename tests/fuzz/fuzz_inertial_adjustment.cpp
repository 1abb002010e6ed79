// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Adjustment with an IMU: problems of inertial frames in every solver, and the stage on a map, where motions, velocities, biases,
// poses, points and gravity are replaced by hostile ones.

#define DOCTEST_CONFIG_DISABLE
#include <thrust/execution_policy.h>

#include <cmath>
#include <cstring>
#include <type_traits>
#include <vector>

#include <turbomap/adjustment/covariance.hpp>
#include <turbomap/map/validate.hpp>

#include "hostile_inertial.hpp"
#include "inertial/inertial_scene.hpp"
#include "mapping/inertial_adjustment_cases.hpp"

using namespace turbomap_fuzz;

namespace {

using policy = std::decay_t<decltype(thrust::seq)>;

turbomap::adjustment_options solve(choices& c) {
  turbomap::adjustment_options o;
  o.max_iterations = static_cast<int>(c.below(5)), o.max_retries = static_cast<int>(c.below(6));
  o.damping = c.flag() ? turbomap::damping_rule::identity : turbomap::damping_rule::diagonal;
  o.solver = static_cast<turbomap::reduced_solver>(c.below(4));
  o.numbers = static_cast<turbomap::precision>(c.below(3));
  return o;
}

/// How many directions nothing tells, and which frames that concerns.
template <class Problem>
void directions(turbomap::context<policy>& ctx, const turbomap_test::inertial_scene& s, Problem& problem) {
  const int open = turbomap::undetermined_directions(ctx, problem);
  int unknowns = 0;
  std::vector<std::int32_t> frames;
  for (std::size_t f = 0; f < s.states.size(); ++f) {
    frames.push_back(static_cast<std::int32_t>(f));
    if (s.fixed.empty() || s.fixed[f] == 0) unknowns += 15;
  }
  expect(open >= 0 && open <= unknowns, "there are no more directions than unknowns");
  std::vector<double> covariance;
  const bool all = turbomap::frame_covariance(ctx, problem, turbomap::span<const std::int32_t>(frames), covariance);
  expect(!all || open == 0, "where every frame is determined nothing is open");
}

/// Through bundle_problem.
void problem_of_frames(choices& c) {
  static const auto small = turbomap_test::make_inertial_scene(3, 3, 5),
                    large = turbomap_test::make_inertial_scene(5, 4, 7);
  auto s = c.flag() ? large : small;
  for (unsigned n = c.byte() % 8; n > 0; --n) {
    const std::size_t f = c.below(s.states.size()), e = c.below(s.edges.size());
    const unsigned what = c.byte() % 10;
    if (what < 2) spoil_state(s.states[f], c);
    if (what == 2) {
      auto motion = s.edges[e].motion;
      spoil_motion(motion, c);
      turbomap::make_inertial_row(motion, c.number(1), s.edges[e]);
      turbomap::make_walk_row(motion, s.walks[e]);
    }
    if (what == 3) s.edges[e].whitening[c.below(81)] = c.number(100);
    if (what == 4) s.points[c.below(s.points.size())] = c.vector(20);
    if (what == 5 && !s.pixel.empty()) s.pixel[c.below(s.pixel.size())] = c.vector(1000);
    if (what == 6) s.gravity = c.vector(10);
    if (what == 7) s.fixed[f] = 1 - s.fixed[f];
    if (what == 8) s.held.assign(s.states.size(), 0), s.held[f] = c.word();
    if (what == 9) s.priors[0].velocity = c.vector(10), s.priors[0].gyro_weight = c.number(10);
  }
  turbomap::context<policy> ctx;
  turbomap_test::inertial_problem<policy> problem(ctx);
  if (!allowed([&] { s.assign(ctx, problem, turbomap::inertial_factor{}); })) return;
  if (c.byte() % 4 == 1) directions(ctx, s, problem);
  const auto summary = turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, solve(c));
  std::vector<state> found;
  problem.frames(ctx, found);
  expect(found.size() == s.states.size(), "every frame has its state");
  if (summary.accepted == 0) {
    expect(std::memcmp(found.data(), s.states.data(), found.size() * sizeof(state)) == 0,
           "without an accepted step the estimate is what was given");
    return;
  }
  expect(finite({summary.cost_final}) && summary.cost_final <= summary.cost_initial, "steps lower the cost");
  for (std::size_t f = 0; f < found.size(); ++f) {
    expect(is_unit(found[f].T_cw), "poses are poses");
    expect(is_finite(found[f]) || !is_finite(s.states[f]), "velocities and biases are finite");
    if (s.fixed[f] != 0) expect(std::memcmp(&found[f], &s.states[f], sizeof(state)) == 0, "what is fixed stays");
  }
}

bool is_number(turbomap::map_fault f) {
  return f == turbomap::map_fault::bad_pose || f == turbomap::map_fault::position_not_finite;
}

/// Through the stage, on a map.
void stage_on_a_map(choices& c) {
  static const turbomap_test::inertial_map_scene made = [] {
    turbomap_test::inertial_recipe r;
    r.keyframes = 7, r.points_per_keyframe = 5;
    return turbomap_test::inertial_map_scene(r);
  }();
  auto s = made;
  auto& map = s.map;
  turbomap_test::inertial_run<policy> run(policy(), s);
  bool spoilt = false;
  for (unsigned n = c.byte() % 8; n > 0; --n) {
    const auto k = s.keyframes[c.below(s.keyframes.size())];
    const auto p = s.points[c.below(s.points.size())];
    if (!map.alive(k)) continue;
    state x{map.T_cw(k), map.velocity(k), map.bias(k)};
    const unsigned what = c.byte() % 9;
    if (what < 3) {
      spoil_state(x, c);
      map.set_pose(k, x.T_cw), map.set_velocity(k, x.velocity), map.set_bias(k, x.bias);
    }
    if (what == 3 && map.motion(k) != nullptr) {
      auto motion = *map.motion(k);
      spoil_motion(motion, c);
      map.set_motion(k, motion, c.flag() ? map.samples(k) : turbomap::imu_history{});
    }
    if (what == 4) map.clear_motion(k);
    if (what == 5 && map.alive(p)) turbomap_test::inertial_map_traits::set_position(map, p, c.vector(20));
    if (what == 6 && c.byte() % 4 == 0) map.set_gravity(c.vector(10));
    if (what == 7 && s.keyframes.back() != k) turbomap::erase_keyframe(map, k);
    if (what == 8 && map.alive(p)) turbomap::erase_point(map, p);
  }
  for (const auto& v : turbomap::validate(map)) spoilt = spoilt || is_number(v.fault);
  turbomap::local_adjustment_options options;
  options.solve = solve(c);
  turbomap::inertial_adjustment_options inertial;
  inertial.window.keyframes = static_cast<int>(c.below(8)), inertial.fewest_edges = static_cast<int>(c.below(4));
  inertial.window.all_robust = c.flag();
  inertial.marginal_prior = c.flag(), inertial.strong_points = inertial.marginal_prior ? -1 : 100;
  turbomap::fault_list noted;
  std::vector<state> before;
  for (const auto& k : s.keyframes)
    if (map.alive(k)) before.push_back({map.T_cw(k), map.velocity(k), map.bias(k)});
  const int current =
      c.flag() ? static_cast<int>(c.below(s.keyframes.size())) : static_cast<int>(s.keyframes.size()) - 1;
  // A prior comes of a window that slides: the second call is about the next keyframe.
  for (int n = inertial.marginal_prior ? 1 : 0; n >= 0; --n)
    allowed([&] { run(current > n ? current - n : current, options, inertial, turbomap::fault_sink(noted)); });
  for (const auto& v : turbomap::validate(map))
    expect(spoilt && is_number(v.fault), "the map is sound but for numbers that an edit wrote");
  std::size_t i = 0;
  for (const auto& k : s.keyframes)
    if (map.alive(k)) {
      const state& was = before[i++];
      expect(is_finite({map.T_cw(k), map.velocity(k), map.bias(k)}) || !is_finite(was), "states stay finite");
    }
  expect(run.store.statistics().pinned_sets == 0, "nothing stays pinned");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  if (c.flag())
    stage_on_a_map(c);
  else
    problem_of_frames(c);
  return 0;
}

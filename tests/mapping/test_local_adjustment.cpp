// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Adjustment around a keyframe on maps of several types: window and result against their definitions, what changes meanwhile,
// what must leave the map alone.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <turbomap/map/validate.hpp>

#include <algorithm>
#include <atomic>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "adjustment_expectation.hpp"
#include "local_adjustment_cases.hpp"
#include "reference/larger_or_nan.hpp"
#include "scenes/pointer_map.hpp"
#include "scenes/watched_map.hpp"
#include "support/policies.hpp"

namespace turbomap_test {

/// A map that counts how often a commit looks at a point again, as it does in a copy.
struct looked_map : flat_map {
  using flat_map::flat_map;
  mutable std::map<std::int32_t, int> looks;
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::looked_map> : turbomap::map_traits<turbomap_test::flat_map> {
  using map = turbomap_test::looked_map;
  static void look_at_list(const map& m, point p) { ++m.looks[p.index]; }
  template <class List>
  static void look_at_slots_of(const map&, point, List&) {}
  static void look_again(const map&, keyframe) {}
  static void look_again(const map&, keyframe, std::size_t) {}
  static void look_at_position(const map&, point) {}
  static void ask_for_state(const map&, point) {}
  static void ask_for(const map&, point) {}
  static void forget_copy(const map&) {}
  static void hear_refresh(const map&) {}
};

namespace {

using namespace turbomap_test;
using turbomap::adjustment_end;
using turbomap::local_adjustment_options;
using turbomap_test::sequential;
using watched = watched_map<map_descriptor>;
constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

TEST_CASE_TEMPLATE("the window: who is free, who is fixed, and nobody else moves", Map, flat_map, pointer_map) {
  using traits = turbomap::map_traits<Map>;
  std::set<std::size_t> sizes;
  int widened = 0, bounded = 0;
  struct recipe {
    int shared, second, most;
  };
  for (const std::size_t current : {0, 1, 5, 9})
    for (const recipe& r : std::vector<recipe>{{1, 0, 0},
                                               {15, 0, 128},
                                               {40, 0, 128},
                                               {60, 0, 128},
                                               {100000, 0, 128},
                                               {60, 40, 128},
                                               {60, 70, 0},
                                               {100000, 60, 128},
                                               {1, 0, 1},
                                               {1, 0, 4},
                                               {60, 40, 5},
                                               {60, 40, 2}}) {
      const int shared = r.shared, second = r.second;
      const std::size_t most = r.most == 0 ? 1000000 : static_cast<std::size_t>(r.most);
      CAPTURE(current);
      CAPTURE(shared);
      CAPTURE(second);
      local_scene<Map> s;
      const auto w = window_by_definition(sightings_of(s), current, shared, origin_of(s), second, most);
      const auto all = window_by_definition(sightings_of(s), current, shared, origin_of(s), second);
      bounded += w.free.size() < all.free.size() ? 1 : 0;
      const auto first = window_by_definition(sightings_of(s), current, shared, origin_of(s));
      widened += w.free.size() > first.free.size() ? 1 : 0;
      std::vector<turbomap::rigid_transform<double>> poses;
      std::vector<turbomap::vec3<double>> positions;
      for (const auto& k : s.keyframes) poses.push_back(traits::pose(s.map, k));
      for (const auto& p : s.points) positions.push_back(traits::position(s.map, p));
      local_adjustment_options options;
      options.min_shared_points = shared, options.solve.max_iterations = 2;
      options.second_min_shared_points = second, options.most_keyframes = r.most;
      const auto summary = adjust_around(sequential{}, s, current, options);
      CHECK(summary.free_keyframes == w.free.size());
      CHECK(summary.fixed_keyframes == w.fixed.size());
      CHECK(summary.points == w.points.size());
      CHECK(summary.observations == w.observations);
      CHECK_FALSE(summary.stale);
      REQUIRE((summary.solve.accepted > 0 || w.free.empty()));
      for (std::size_t f = 0; f < poses.size(); ++f)
        CHECK(same_pose(traits::pose(s.map, s.keyframes[f]), poses[f]) == (w.free.count(f) == 0));
      for (std::size_t l = 0; l < positions.size(); ++l)
        if (traits::alive(s.map, s.points[l]))
          CHECK(same_place(traits::position(s.map, s.points[l]), positions[l]) ==
                (w.points.count(l) == 0 || w.free.empty()));
      sizes.insert(w.free.size());
    }
  CHECK(sizes.size() >= 4);
  CHECK(widened >= 4);
  CHECK(bounded >= 8);
}

TEST_CASE("with nothing fixed the oldest keyframe is; its age is its id, not its place") {
  local_scene<flat_map> s(local_recipe{4, 40});
  turbomap::erase_keyframe(s.map, s.keyframes[0], 0);  // the origin is gone, its place is taken by a new keyframe
  const auto young = insert_keyframe(s.map, {make_keypoint(0)}, 9, {});
  REQUIRE(young.index == s.keyframes[0].index);
  turbomap::observe(s.map, turbomap::map_traits<flat_map>::point_at(s.map, s.keyframes[1], 0), young, 0);
  s.keyframes[0] = young;
  const auto w = window_by_definition(sightings_of(s), 3, 1, 0);
  REQUIRE(w.fixed == oracle_ids{1});
  const auto before = s.map.T_cw(s.keyframes[1]);
  local_adjustment_options options;
  options.min_shared_points = 1;
  const auto summary = adjust_around(sequential{}, s, 3, options);
  CHECK(summary.free_keyframes == 3);
  CHECK(summary.fixed_keyframes == 1);
  REQUIRE(summary.solve.accepted > 0);
  CHECK(same_pose(s.map.T_cw(s.keyframes[1]), before));
}

TEST_CASE_TEMPLATE("poses, points, outliers and deaths are the oracle's", Policy, TURBOMAP_TEST_POLICIES) {
  for (const double outliers : {0.0, 0.05, 0.2}) {
    CAPTURE(outliers);
    local_recipe recipe{8, 60};
    recipe.outliers = outliers, recipe.cameras = outliers > 0.1 ? 1 : 2;
    local_scene<flat_map> s(recipe);
    local_adjustment_options options;
    options.min_shared_points = 20, options.solve.min_relative_decrease = 0, options.solve.max_iterations = 6;
    options.solve.damping = turbomap::damping_rule::identity;  // the oracle's
    options.fewest_measurements = outliers > 0.1 ? 4 : 2, options.solve.numbers = turbomap::precision::float64;
    const auto seen = sightings_of(s);
    const auto w = window_by_definition(seen, 6, 20, 0);
    REQUIRE(w.free.size() >= 2);
    REQUIRE(w.points.size() < s.points.size());
    const auto expected = expect_adjusted(s, seen, w, 6);
    const auto dead = dead_by_definition(expected.observations, options.fewest_measurements);
    const auto summary = adjust_around(Policy{}, s, 6, options);
    CHECK(summary.solve.cost_final == doctest::Approx(expected.problem.cost()).epsilon(1e-6));
    CHECK(summary.solve.cost_final < 0.8 * summary.solve.cost_initial);
    CHECK(distance(s, expected.problem) < 1e-5);
    CHECK(summary.points_erased == dead.size());
    CHECK((dead.size() > 2) == (outliers > 0.1));
    for (std::size_t l = 0; l < s.points.size(); ++l) CHECK(s.map.alive(s.points[l]) == (dead.count(l) == 0));
    std::size_t gone = 0;
    for (const auto& o : expected.observations) {
      const auto at = s.map.point_at(s.keyframes[o.keyframe], o.keypoint);
      CHECK((at == turbomap::map_point_id{}) == (o.outlier || dead.count(o.point) != 0));
      gone += o.outlier ? 1 : 0;
    }
    CHECK(summary.outliers <= gone);  // a point that died takes its other outliers with it
    CHECK(summary.outliers + 2 * dead.size() >= gone);
    if (outliers == 0.05) {  // and they are those that were made
      CHECK(summary.outliers > 10);
      for (const auto& o : expected.observations) CHECK(o.outlier == (s.wrong.count({o.keyframe, o.keypoint}) != 0));
    }
    CHECK(turbomap::validate(s.map).empty());
  }
}

TEST_CASE("the defaults end nearer the optimum than the published steps, in fewer iterations") {
  double excess = 0, excess_published = 0;
  int iterations = 0, iterations_published = 0;
  for (const unsigned seed : {1U, 2U, 3U, 4U})
    for (const double outliers : {0.0, 0.05}) {
      CAPTURE(seed);
      CAPTURE(outliers);
      local_recipe recipe;
      recipe.seed = seed, recipe.outliers = outliers;
      const auto adjusted = [&](const local_adjustment_options& options) {
        local_scene<flat_map> s(recipe);
        return adjust_around(sequential{}, s, 6, options).solve;
      };
      local_adjustment_options options, published, exact;
      published.use_published_steps();
      exact.solve.max_iterations = 100, exact.solve.min_relative_decrease = 0;
      const auto ours = adjusted(options), theirs = adjusted(published);
      const double least = adjusted(exact).cost_final;
      CHECK(ours.end == adjustment_end::converged);
      CHECK(ours.cost_final < (1 + 1e-3) * least);
      excess += ours.cost_final / least - 1, excess_published += theirs.cost_final / least - 1;
      iterations += ours.iterations, iterations_published += theirs.iterations;
    }
  CHECK(excess < excess_published);
  CHECK(iterations * 5 <= iterations_published * 3);
}

TEST_CASE("the unit of length does not matter") {
  local_scene<flat_map> metres, millimetres;
  const auto scale = [](auto& x) { x *= 1000; };
  for (auto& camera : millimetres.rig) {
    auto& T = camera.T_camera_body;
    scale(camera.bf), scale(T.tx), scale(T.ty), scale(T.tz);
  }
  for (const auto& k : millimetres.keyframes) {
    auto T = millimetres.map.T_cw(k);
    scale(T.tx), scale(T.ty), scale(T.tz);
    millimetres.map.set_pose(k, T);
  }
  for (const auto& p : millimetres.points) {
    auto x = turbomap::map_traits<flat_map>::position(millimetres.map, p);
    scale(x.x), scale(x.y), scale(x.z);
    turbomap::map_traits<flat_map>::set_position(millimetres.map, p, {x.x, x.y, x.z});
  }
  local_adjustment_options options;
  options.solve.numbers = turbomap::precision::float64;
  const auto in_metres = adjust_around(sequential{}, metres, 6, options);
  const auto in_millimetres = adjust_around(sequential{}, millimetres, 6, options);
  REQUIRE(in_metres.solve.accepted > 1);
  CHECK(in_millimetres.solve.iterations == in_metres.solve.iterations);
  CHECK(in_millimetres.solve.cost_final == doctest::Approx(in_metres.solve.cost_final).epsilon(1e-6));
  CHECK(in_millimetres.outliers == in_metres.outliers);
}

TEST_CASE("outliers are beyond the factor, which changes nothing else") {
  local_recipe recipe;
  recipe.pixel_noise = 1;
  local_scene<flat_map> narrow(recipe), wide(recipe), endless(recipe);
  local_adjustment_options options;
  options.mono_chi2 = options.stereo_chi2 = 1;  // many outliers
  const auto taken = adjust_around(sequential{}, narrow, 6, options);
  options.outlier_factor = 4;
  const auto fewer = adjust_around(sequential{}, wide, 6, options);
  options.outlier_factor = 1e300;
  const auto none = adjust_around(sequential{}, endless, 6, options);
  CHECK(taken.outliers > 2 * fewer.outliers);
  CHECK(fewer.outliers > 0);
  CHECK(none.outliers == 0);
  CHECK(taken.solve.cost_final == none.solve.cost_final);
  for (std::size_t k = 0; k < narrow.keyframes.size(); ++k)
    for (std::size_t i = 0; i < turbomap::map_traits<flat_map>::keypoint_count(narrow.map, narrow.keyframes[k]); ++i)
      if (wide.map.point_at(wide.keyframes[k], i) == turbomap::map_point_id{})  // then for the narrow gate too
        CHECK(narrow.map.point_at(narrow.keyframes[k], i) == turbomap::map_point_id{});
}

template <class Map>
void check_truth_is_found(bool two_rigs) {
  using traits = turbomap::map_traits<Map>;
  local_recipe recipe;
  recipe.pixel_noise = 0.1, recipe.outliers = 0.02, recipe.alternate = two_rigs;
  local_scene<Map> s(recipe);
  const auto w = window_by_definition(sightings_of(s), 7, 50, origin_of(s));
  REQUIRE(w.free.size() >= 3);
  for (const auto f : w.fixed) traits::set_pose(s.map, s.keyframes[f], s.true_poses[f]);
  const auto errors = [&](double& pose, double& point) {
    pose = point = 0;
    for (const auto f : w.free) {
      const auto a = frame_of(traits::pose(s.map, s.keyframes[f])), b = frame_of(s.true_poses[f]);
      pose = larger_or_nan(pose, (a.R.transpose() * a.t - b.R.transpose() * b.t).norm());
      pose = larger_or_nan(pose, (a.R - b.R).norm());
    }
    double sum = 0;
    for (const auto l : w.points) {
      if (!traits::alive(s.map, s.points[l])) continue;
      const auto p = traits::position(s.map, s.points[l]);
      sum += turbomap::norm(p - s.true_points[l]), point = sum / static_cast<double>(w.points.size());
    }
  };
  double pose_before, point_before, pose_after, point_after;
  errors(pose_before, point_before);
  local_adjustment_options options;
  options.min_shared_points = 50, options.solve.max_iterations = 20;
  const auto summary = adjust_around(sequential{}, s, 7, options);
  CHECK(adjust_around(sequential{}, s, 7, options).outliers == 0);  // undisturbed by them now
  errors(pose_after, point_after);
  CHECK(summary.free_keyframes == w.free.size());
  CHECK(summary.outliers > 5);
  CHECK(pose_before > 0.02);
  CHECK(pose_after < 0.01);
  CHECK(point_before > 0.05);
  CHECK(point_after < 0.01);
}

TEST_CASE_TEMPLATE("the truth is found, whatever the map", Map, flat_map, pointer_map, watched) {
  check_truth_is_found<Map>(false);
}
TEST_CASE("the truth is found, with two rigs in one map") { check_truth_is_found<flat_map>(true); }

TEST_CASE("the same bits under every policy, in any memory") {
  local_recipe recipe;
  recipe.outliers = 0.05;
  for (const auto numbers : {turbomap::precision::float64, turbomap::precision::mixed}) {
    local_adjustment_options options;
    options.solve.numbers = numbers;
    local_scene<flat_map> expected(recipe), c(recipe);
    std::vector<local_scene<flat_map>> parallel;  // one per policy
    turbomap_test::for_each_parallel_policy([&](auto) { parallel.emplace_back(recipe); });
    adjustment_run<flat_map, sequential> run(sequential{}, c);
    for (const std::size_t current : {9, 4, 6, 2}) {
      const auto summary = adjust_around(sequential{}, expected, current, options);
      CHECK(summary.solve.accepted > 0);
      auto scene = parallel.begin();
      turbomap_test::for_each_parallel_policy([&](auto policy) {
        CHECK(adjust_around(policy, *scene, current, options).outliers == summary.outliers);
        CHECK(scene++->state() == expected.state());
      });
      CHECK(run(current, options).outliers == summary.outliers);
      CHECK(run.adjust.points().size() == summary.points);
      CHECK(c.state() == expected.state());
    }
    CHECK(run.held.count == 8);
  }
}

/// Adjusts around keyframe 5 while `meanwhile` happens: after the map was copied, before the result is written.
template <class Function>
turbomap::local_adjustment_summary adjust_while(local_scene<watched>& s, Function meanwhile) {
  adjustment_run<watched, sequential> run(sequential{}, s);
  int times = 0;
  s.map.watch.before = [&] {
    if (++times == 2) meanwhile();
  };
  s.map.watch.armed = true;
  const auto summary = run(5);
  s.map.watch.armed = false, s.map.watch.before = {};
  CHECK(times == 2);
  CHECK(run.held.count == 2);
  CHECK(run.held.longest_ms <= run.held.total_ms);
  CHECK_FALSE(s.map.watch.held);
  CHECK(turbomap::validate(s.map).empty());
  return summary;
}

using watched_traits = turbomap::map_traits<watched>::base;  // what is done under no guard of ours

struct meanwhile_scene {
  local_scene<watched> s{[] {
    local_recipe recipe;
    recipe.outliers = 0.05, recipe.keyframes = 16;
    return recipe;
  }()};
  oracle_window w = window_by_definition(sightings_of(s), 5, 15, 0);
  std::size_t fixed = static_cast<std::size_t>(*w.fixed.rbegin()), point = static_cast<std::size_t>(*w.points.begin());
};

TEST_CASE("a free keyframe that moved or died meanwhile: nothing is written") {
  for (const bool dies : {false, true}) {
    meanwhile_scene m;
    std::string then;
    REQUIRE(m.w.free.count(6) == 1);
    const auto summary = adjust_while(m.s, [&] {
      auto T = m.s.map.T_cw(m.s.keyframes[6]);
      T.tz += 1e-12;
      watched_traits::set_pose(m.s.map, m.s.keyframes[6], T);
      if (dies) turbomap::erase_keyframe(static_cast<watched_traits::map&>(m.s.map), m.s.keyframes[6]);
      then = m.s.state();
    });
    CHECK(summary.stale);
    CHECK(summary.solve.accepted > 0);
    CHECK(summary.outliers == 0);
    CHECK(m.s.state() == then);
  }
}

TEST_CASE("a fixed keyframe may move or die meanwhile") {
  for (const bool dies : {false, true}) {
    meanwhile_scene m;
    REQUIRE(m.fixed != 0);
    const auto T = m.s.true_poses[m.fixed];
    const auto summary = adjust_while(m.s, [&] {
      watched_traits::set_pose(m.s.map, m.s.keyframes[m.fixed], T);
      if (dies) turbomap::erase_keyframe(static_cast<watched_traits::map&>(m.s.map), m.s.keyframes[m.fixed]);
    });
    CHECK_FALSE(summary.stale);
    CHECK(summary.outliers > 0);
    CHECK(m.s.map.alive(m.s.keyframes[m.fixed]) == !dies);
    if (!dies) CHECK(same_pose(m.s.map.T_cw(m.s.keyframes[m.fixed]), T));
  }
}

TEST_CASE("points that moved, died or were taken elsewhere meanwhile keep what they have") {
  meanwhile_scene still;
  adjust_while(still.s, [] {});
  SUBCASE("moved: its place and its views, outliers too") {
    bool found = false;
    for (std::size_t l = 0; l < still.s.points.size() && !found; ++l) {
      if (still.w.points.count(l) == 0) continue;
      meanwhile_scene m;
      const std::size_t views = m.s.map.observations(m.s.points[l]).size();
      if (still.s.map.alive(still.s.points[l]) && still.s.map.observations(still.s.points[l]).size() == views) continue;
      const turbomap::vec3<double> place{1, 2, 3};
      adjust_while(m.s, [&] { watched_traits::set_position(m.s.map, m.s.points[l], place); });
      REQUIRE(m.s.map.alive(m.s.points[l]));
      CHECK(same_place(m.s.map.position(m.s.points[l]), place));
      CHECK(m.s.map.observations(m.s.points[l]).size() == views);
      for (std::size_t other = 0; other < m.s.points.size(); ++other)  // all others as if it had not
        if (other != l && still.s.map.alive(still.s.points[other]))
          CHECK(same_place(m.s.map.position(m.s.points[other]), still.s.map.position(still.s.points[other])));
      found = true;
    }
    CHECK(found);
  }
  SUBCASE("died") {
    meanwhile_scene m;
    const auto summary = adjust_while(m.s, [&] {
      auto& map = static_cast<watched_traits::map&>(m.s.map);
      for (std::size_t i = 0; i < 20; ++i) {
        const auto p = watched_traits::point_at(map, m.s.keyframes[5], i);
        if (!(p == turbomap::map_point_id{})) turbomap::erase_point(map, p);
      }
    });
    CHECK_FALSE(summary.stale);
    CHECK(m.s.map.alive(m.s.keyframes[5]));
  }
  SUBCASE("an outlier's keypoint was given to another point") {
    meanwhile_scene m;
    std::size_t f = 0, i = 0;
    for (const auto& [k, keypoint] : m.s.wrong)
      if (k == 5 && still.s.map.alive(m.s.map.point_at(m.s.keyframes[k], keypoint))) f = k, i = keypoint;
    REQUIRE(f == 5);
    REQUIRE(still.s.map.point_at(still.s.keyframes[f], i) == turbomap::map_point_id{});
    turbomap::map_point_id fresh;
    adjust_while(m.s, [&] {
      auto& map = static_cast<watched_traits::map&>(m.s.map);
      turbomap::forget(map, m.s.keyframes[f], i);
      fresh = map.add_point({4, 5, 6}, m.s.keyframes[f]);
      turbomap::observe(map, fresh, m.s.keyframes[f], i);
    });
    CHECK(m.s.map.point_at(m.s.keyframes[f], i) == fresh);
    CHECK(same_place(m.s.map.position(fresh), {4, 5, 6}));
  }
  CHECK(still.s.map.watch.unguarded == 0);
}

TEST_CASE("a point comes to contradict the map between two parts: its outliers stay, and what was written does") {
  local_adjustment_options options;
  options.points_per_guard = 16;
  meanwhile_scene still;
  const auto undisturbed = adjustment_run<watched, sequential>(sequential{}, still.s)(5, options);
  std::size_t victim = 0;
  turbomap::map_point_id p;
  for (const auto& [f, i] : still.s.wrong) {
    const auto at = meanwhile_scene().s.map.point_at(still.s.keyframes[f], i);
    if (f == 5 && still.s.map.alive(at)) victim = i, p = at;
  }
  REQUIRE_FALSE(p == turbomap::map_point_id{});
  using lie = void (*)(watched_traits::map&, turbomap::map_point_id, turbomap::map_keyframe_id, std::size_t);
  const std::pair<turbomap::map_fault, lie> lies[] = {
      {turbomap::map_fault::keypoint_out_of_range,
       [](auto& map, auto point, auto k, auto) { watched_traits::add_observation(map, point, k, 1000000); }},
      {turbomap::map_fault::slot_without_observation,
       [](auto& map, auto point, auto k, auto i) { watched_traits::erase_observation(map, point, k, i); }}};
  for (const auto& one : lies)
    for (const bool strict : {false, true}) {
      CAPTURE(static_cast<int>(one.first));
      CAPTURE(strict);
      meanwhile_scene m;
      adjustment_run<watched, sequential> run(sequential{}, m.s);
      turbomap::fault_list noted;
      auto scope = run.scope();
      if (!strict) scope.faults = turbomap::fault_sink(noted);
      int times = 0;
      bool lied = false;
      const auto unadjusted = m.s.map.T_cw(m.s.keyframes[5]);
      m.s.map.watch.before = [&] {
        ++times;
        if (lied || same_pose(m.s.map.T_cw(m.s.keyframes[5]), unadjusted)) return;
        lied = true;  // poses are written
        one.second(m.s.map, p, m.s.keyframes[5], victim);
      };
      if (strict) {
        CHECK_THROWS_AS(run.adjust(scope, m.s.keyframes[5], options), turbomap::inconsistent_map);
      } else {
        const auto summary = run.adjust(scope, m.s.keyframes[5], options);
        CHECK(summary.outliers < undisturbed.outliers);
        CHECK(summary.outliers > undisturbed.outliers / 2);
        REQUIRE(noted.size() == 1);
        CHECK(noted[0].fault == one.first);
        CHECK(noted[0].point == watched_traits::id(m.s.map, p));
      }
      m.s.map.watch.before = {};
      CHECK(times > 5);
      CHECK(lied);
      CHECK(m.s.map.point_at(m.s.keyframes[5], victim) == p);
      CHECK_FALSE(same_pose(m.s.map.T_cw(m.s.keyframes[5]), unadjusted));
      CHECK(turbomap::validate(static_cast<watched_traits::map&>(m.s.map)).size() == 1);
    }
}

TEST_CASE("on a copy of a map the commit reads each point of an outlier once, however many it has") {
  local_recipe recipe;
  recipe.outliers = 0.2;
  local_scene<looked_map> s(recipe);
  local_adjustment_options options;
  options.points_per_guard = 0;  // the guard is held once
  const auto summary = adjust_around(sequential{}, s, 5, options);
  CHECK(s.map.looks.size() > 10);
  CHECK(summary.outliers > s.map.looks.size());
  for (const auto& [point, looks] : s.map.looks) CHECK(looks == 1);
}

TEST_CASE("a point behind its only camera is an outlier, however well it fits") {
  using turbomap::operator*;
  local_scene<flat_map> s;
  const auto k = s.keyframes[5];
  const auto keypoints = s.map.keypoints(k);
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const auto& z = keypoints[i];
    if (z.camera != 0 || z.u_right >= 0) continue;
    turbomap::forget(s.map, k, i);
    const double x = static_cast<double>((z.x - 320) / 400), y = static_cast<double>((z.y - 240) / 401);
    const auto mirrored = s.map.add_point(
        turbomap::inverse(turbomap::to_isometry<double>(s.map.T_cw(k))) * turbomap::vec3<double>{-5 * x, -5 * y, -5},
        k);
    turbomap::observe(s.map, mirrored, k, i);
    const auto summary = adjust_around(sequential{}, s, 5);
    CHECK(summary.solve.accepted > 0);
    CHECK_FALSE(s.map.alive(mirrored));
    CHECK(s.map.point_at(k, i) == turbomap::map_point_id{});
    CHECK(summary.points_erased == 1);
    return;
  }
  FAIL("no such keypoint");
}

/// The map stays to the last bit, and the end is this.
template <class Map>
turbomap::local_adjustment_summary check_unchanged(local_scene<Map>& s, std::size_t current, adjustment_end end,
                                                   const local_adjustment_options& options = {}) {
  const auto before = s.state();
  adjustment_run<Map, sequential> run(sequential{}, s);
  const auto summary = run(current, options);
  CHECK(s.state() == before);
  CHECK(std::string(turbomap::to_string(summary.solve.end)) == turbomap::to_string(end));
  CHECK(summary.solve.accepted == 0);
  CHECK(summary.outliers == 0);
  CHECK(run.held.count == 1);  // nothing to write
  return summary;
}

/// What is not finite is refused where the scope notes no faults: see test_refused.cpp for where it does.
void check_refused(local_scene<flat_map>& s, std::size_t k) {
  adjustment_run<flat_map, sequential> run(sequential{}, s);
  const auto before = s.state();
  CHECK_THROWS_AS(run(k, {}), turbomap::inconsistent_map);
  CHECK(s.state() == before);
}

TEST_CASE("nothing to do, or not possible: the map stays, and the summary says why") {
  local_scene<flat_map> s;
  local_adjustment_options options;
  SUBCASE("a point that is not a number") {
    s.map.add_point({});
    using traits = turbomap::map_traits<flat_map>;
    traits::set_position(s.map, traits::point_at(s.map, s.keyframes[5], 3), {0, nan_value, 0});
    check_refused(s, 5);
  }
  SUBCASE("a pose that is not a number") {
    s.map.set_pose(s.keyframes[4], {0, 0, 0, nan_value, 0, 0, 0});
    check_refused(s, 5);
  }
  SUBCASE("a keyframe without points, and one without keypoints") {
    s.keyframes.push_back(insert_keyframe(s.map, {make_keypoint(0), make_keypoint(1)}, 11, {}));
    s.keyframes.push_back(insert_keyframe(s.map, {}, 12, {}));
    for (const std::size_t k : {10, 11}) {
      const auto summary = check_unchanged(s, k, adjustment_end::no_observations);
      CHECK(summary.points + summary.observations == 0);
    }
  }
  SUBCASE("a keyframe alone: it is the oldest, and fixed") {
    for (const std::size_t k : {0, 5}) {
      local_scene<flat_map> alone;
      for (std::size_t f = 0; f < alone.keyframes.size(); ++f)
        if (f != k) turbomap::erase_keyframe(alone.map, alone.keyframes[f], 0);
      const auto summary = check_unchanged(alone, k, adjustment_end::nothing_free);
      CHECK(summary.free_keyframes == 0);
      CHECK(summary.fixed_keyframes == 1);
      CHECK(summary.observations > 0);
    }
  }
  SUBCASE("the flag was set before") {
    const std::atomic<bool> stop{true};
    options.solve.stop = &stop;
    const auto summary = check_unchanged(s, 5, adjustment_end::stopped, options);
    CHECK(summary.free_keyframes > 0);
  }
  SUBCASE("a keyframe that died") {
    turbomap::erase_keyframe(s.map, s.keyframes[5]);
    CHECK(check_unchanged(s, 5, adjustment_end::no_observations).stale);
    s.keyframes[5] = {};
    adjustment_run<flat_map, sequential> run(sequential{}, s);
    CHECK(run(5, options).stale);
  }
}

template <class Map>
void check_refused(local_scene<Map>& s, const local_adjustment_options& options, const std::string& words) {
  const auto before = s.state();
  try {
    adjust_around(sequential{}, s, 5, options);
    FAIL_CHECK("not refused: " << words);
  } catch (const std::invalid_argument& e) {
    CAPTURE(e.what());
    CHECK(std::string(e.what()).find(words) != std::string::npos);
  }
  CHECK(s.state() == before);
}

TEST_CASE("bad input is refused by name, and the map stays") {
  local_scene<watched> s;
  const auto with = [](auto change) {
    local_adjustment_options o;
    change(o);
    return o;
  };
  check_refused(s, with([](auto& o) { o.mono_chi2 = 0; }), "options.mono_chi2 = 0");
  check_refused(s, with([](auto& o) { o.mono_chi2 = nan_value; }), "options.mono_chi2");
  check_refused(s, with([](auto& o) { o.stereo_chi2 = -1; }), "options.stereo_chi2 = -1");
  for (const double v : {0.0, -1.0, nan_value})
    check_refused(s, with([v](auto& o) { o.outlier_factor = v; }), "options.outlier_factor");
  check_refused(s, with([](auto& o) { o.scales.scale_factor = 0.5F; }), "options.scales.scale_factor = 0.5");
  check_refused(s, with([](auto& o) { o.second_min_shared_points = -1; }), "options.second_min_shared_points = -1");
  check_refused(s, with([](auto& o) { o.most_keyframes = -1; }), "options.most_keyframes = -1");
  check_refused(s, with([](auto& o) { o.fewest_measurements = -1; }), "options.fewest_measurements = -1");
  check_refused(s, with([](auto& o) { o.solve.max_iterations = -1; }), "options.max_iterations = -1");
  CHECK_FALSE(s.map.watch.held);
}

TEST_CASE("one for the map and context of a scope") {
  local_scene<flat_map> s, expected;
  adjustment_run<flat_map, sequential> run(sequential{}, s);
  turbomap::local_adjustment adjust(run.scope());
  CHECK(adjust(run.scope(), s.keyframes[5], {}).solve.accepted > 0);
  adjust_around(sequential{}, expected, 5);
  CHECK(s.state() == expected.state());
}

TEST_CASE("keyframes that are not in the store are passed over; the current one must be there") {
  local_scene<flat_map> s;
  adjustment_run<flat_map, sequential> all(sequential{}, s), run(sequential{}, s);
  const std::string before = s.state();
  const std::uint64_t current = turbomap::map_traits<flat_map>::id(s.map, s.keyframes[5]);
  run.stored.erase(current);
  CHECK_THROWS_AS(run(5), std::invalid_argument);
  CHECK(s.state() == before);
  run.insert(5);
  for (const std::size_t f : {2, 6}) run.stored.erase(turbomap::map_traits<flat_map>::id(s.map, s.keyframes[f]));
  const auto T_2 = s.map.T_cw(s.keyframes[2]), T_6 = s.map.T_cw(s.keyframes[6]);
  const auto summary = run(5);
  CHECK(summary.solve.accepted > 0);
  CHECK(same_pose(s.map.T_cw(s.keyframes[2]), T_2));
  CHECK(same_pose(s.map.T_cw(s.keyframes[6]), T_6));
  const auto with_all = all(5);
  CHECK(with_all.free_keyframes + with_all.fixed_keyframes == summary.free_keyframes + summary.fixed_keyframes + 2);
  CHECK(with_all.observations > summary.observations);
}

TEST_CASE("a keypoint that the map, or the store, does not have is refused, and nothing is written") {
  local_scene<flat_map> s;
  adjustment_run<flat_map, sequential> run(sequential{}, s);
  s.keyframes.push_back(insert_keyframe(s.map,
                                        s.map.keypoints(s.keyframes[5]).size() == 0
                                            ? std::vector<turbomap::keypoint>{}
                                            : std::vector<turbomap::keypoint>{make_keypoint(0)},
                                        20, {}));
  // The store has it with fewer keypoints than the map says.
  turbomap::keyframe_data<map_descriptor, pinhole_camera> data;
  const auto rig = s.rig_of(0);
  data.cameras = rig.cameras, data.camera_count = rig.count;
  run.stored.add(turbomap::map_traits<flat_map>::id(s.map, s.keyframes.back()), run.store.insert(data));
  const auto p = s.map.point_at(s.keyframes[5], 0);
  turbomap::observe(s.map, p, s.keyframes.back(), 0);
  const std::string before = s.state();
  CHECK_THROWS_AS(run(5), std::invalid_argument);
  CHECK(s.state() == before);
}

TEST_CASE("an outlier whose point contradicts the map: refused, and nothing is written") {
  local_recipe recipe;
  recipe.outliers = 0.05;
  local_scene<flat_map> s(recipe), sound(recipe);
  adjust_around(sequential{}, sound, 5);
  for (const auto& [f, i] : s.wrong) {
    const auto p = s.map.point_at(s.keyframes[f], i);
    if (f != 5 || !sound.map.alive(p)) continue;
    REQUIRE(sound.map.point_at(s.keyframes[f], i) == turbomap::map_point_id{});
    for (const auto& o : s.map.observations(p)) {  // a slot forgets it, its list does not
      if (s.map.keyframe_at(o.keyframe) == s.keyframes[f]) continue;
      turbomap::map_traits<flat_map>::set_point(s.map, s.map.keyframe_at(o.keyframe),
                                                static_cast<std::size_t>(o.keypoint), {});
      break;
    }
    const auto before = s.state();
    CHECK_THROWS_AS(adjust_around(sequential{}, s, 5), turbomap::inconsistent_map);
    CHECK(s.state() == before);
    return;
  }
  FAIL("no outlier in the window");
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Adjustment of a whole map: who takes part, the oracle's result, what changes meanwhile, what must leave the map alone.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <turbomap/map/validate.hpp>

#include <atomic>
#include <stdexcept>
#include <string>
#include <vector>

#include "adjustment_expectation.hpp"
#include "local_adjustment_cases.hpp"
#include "reference/larger_or_nan.hpp"
#include "scenes/mapping_scene.hpp"
#include "scenes/pointer_map.hpp"
#include "scenes/watched_map.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_end;
using turbomap::global_adjustment_options;
using watched = watched_map<map_descriptor>;
using watched_traits = turbomap::map_traits<watched>::base;  // what is done under no guard of ours

/// Takes the points that keyframes on both sides of a cut see out of the map: two maps, which share nothing.
template <class Map>
void cut_in_two(local_scene<Map>& s, std::size_t first_of_second) {
  const auto seen = sightings_of(s);
  for (std::size_t p = 0; p < s.points.size(); ++p) {
    bool before = false, behind = false;
    for (const auto& [k, points] : seen)
      if (points.count(p) != 0) (k < first_of_second ? before : behind) = true;
    if (before && behind) turbomap::erase_point(s.map, s.points[p]);
  }
}

TEST_CASE_TEMPLATE("who takes part: all that is connected, from wherever it is asked for; nobody else moves", Map,
                   flat_map, pointer_map) {
  using traits = turbomap::map_traits<Map>;
  for (const bool cut : {false, true})
    for (const std::size_t anyone : {0, 5, 9}) {
      CAPTURE(cut);
      CAPTURE(anyone);
      local_scene<Map> s;
      if (cut) cut_in_two(s, 5);
      const auto w = connected_by_definition(sightings_of(s), anyone, origin_of(s));
      CHECK(w.free.size() == (cut ? 4 : 9));
      std::vector<turbomap::rigid_transform<double>> poses;
      for (const auto& k : s.keyframes) poses.push_back(traits::pose(s.map, k));
      global_adjustment_options options;
      options.solve.max_iterations = 2;
      const auto summary = adjust_globally(sequential{}, s, anyone, options);
      CHECK(summary.free_keyframes == w.free.size());
      CHECK(summary.fixed_keyframes == 1);
      CHECK(summary.points == w.points.size());
      CHECK(summary.observations == w.observations);
      REQUIRE(summary.solve.accepted > 0);
      for (std::size_t f = 0; f < poses.size(); ++f)
        CHECK(same_pose(traits::pose(s.map, s.keyframes[f]), poses[f]) == (w.free.count(f) == 0));
    }
}

TEST_CASE("keyframes that are named move, others that see their points hold them") {
  local_scene<flat_map> s;
  adjustment_run<flat_map, sequential> run(sequential{}, s);
  turbomap::global_adjustment adjust(run.scope());
  turbomap::erase_keyframe(s.map, s.keyframes[8]);
  const std::vector<turbomap::map_keyframe_id> named{
      s.keyframes[3], s.keyframes[4], {}, s.keyframes[8], s.keyframes[3]};
  std::vector<turbomap::rigid_transform<double>> poses;
  for (const auto& k : s.keyframes)
    poses.push_back(s.map.alive(k) ? s.map.T_cw(k) : turbomap::rigid_transform<double>{});
  const auto summary = adjust(run.scope(), named, global_adjustment_options{});
  CHECK(summary.free_keyframes == 2);
  CHECK(summary.fixed_keyframes >= 4);
  REQUIRE(summary.solve.accepted > 0);
  for (std::size_t f = 0; f < poses.size(); ++f)
    if (s.map.alive(s.keyframes[f])) CHECK(same_pose(s.map.T_cw(s.keyframes[f]), poses[f]) == (f != 3 && f != 4));
  const std::vector<turbomap::map_keyframe_id> nobody{{}, s.keyframes[8]};
  CHECK(adjust(run.scope(), nobody, global_adjustment_options{}).stale);
  CHECK(adjust.points().size() == 0);
}

TEST_CASE_TEMPLATE("poses, points, outliers and deaths are the oracle's", Policy, TURBOMAP_TEST_POLICIES) {
  local_recipe recipe{8, 60};
  recipe.outliers = 0.05;
  for (const auto solver :
       {turbomap::reduced_solver::dense, turbomap::reduced_solver::sparse, turbomap::reduced_solver::pcg}) {
    CAPTURE(turbomap::to_string(solver));
    local_scene<flat_map> s(recipe);
    global_adjustment_options options;
    options.solve.solver = solver, options.solve.numbers = turbomap::precision::float64;
    options.solve.max_iterations = 40, options.solve.min_relative_decrease = 0, options.solve.pcg_tolerance = 1e-10;
    const auto seen = sightings_of(s);
    const auto w = connected_by_definition(seen, 6, 0);
    REQUIRE(w.free.size() == 7);
    const auto expected = expect_adjusted(s, seen, w, 40);
    const auto dead = dead_by_definition(expected.observations, options.fewest_measurements);
    const auto summary = adjust_globally(Policy{}, s, 6, options);
    CHECK(summary.solve.cost_final == doctest::Approx(expected.problem.cost()).epsilon(1e-6));
    CHECK(distance(s, expected.problem) < 1e-4);
    CHECK(summary.points_erased == dead.size());
    CHECK(summary.outliers > 10);
    for (const auto& o : expected.observations) {
      const auto at = s.map.point_at(s.keyframes[o.keyframe], o.keypoint);
      CHECK((at == turbomap::map_point_id{}) == (o.outlier || dead.count(o.point) != 0));
    }
    CHECK(turbomap::validate(s.map).empty());
  }
}

TEST_CASE("the same bits under every policy, in any memory") {
  local_recipe recipe;
  recipe.outliers = 0.05;
  for (const auto numbers : {turbomap::precision::float64, turbomap::precision::mixed}) {
    global_adjustment_options options;
    options.solve.numbers = numbers;
    local_scene<flat_map> expected(recipe), again(recipe);
    const auto summary = adjust_globally(sequential{}, expected, 4, options);
    CHECK(summary.solve.accepted > 0);
    adjustment_run<flat_map, sequential> run(sequential{}, again);
    run.adjust_globally(4, options);
    CHECK(again.state() == expected.state());
    turbomap_test::for_each_parallel_policy([&](auto policy) {
      local_scene<flat_map> scene(recipe);
      CHECK(adjust_globally(policy, scene, 4, options).outliers == summary.outliers);
      CHECK(scene.state() == expected.state());
    });
  }
}

TEST_CASE("a bend that no window of the way sees goes out at once") {
  local_recipe recipe;
  recipe.keyframes = 24, recipe.points = 300, recipe.pixel_noise = 0.1, recipe.error_m = 0, recipe.error_rad = 0;
  local_scene<flat_map> s(recipe);
  const auto worst = [&] {
    double d = 0;
    for (std::size_t f = 0; f < s.keyframes.size(); ++f)
      d = larger_or_nan(d, std::abs(s.map.T_cw(s.keyframes[f]).tz - s.true_poses[f].tz));
    return d;
  };
  for (std::size_t f = 0; f < s.keyframes.size(); ++f) {
    auto T = s.map.T_cw(s.keyframes[f]);
    T.tz += 0.002 * static_cast<double>(f * f);
    s.map.set_pose(s.keyframes[f], T);
  }
  CHECK(worst() > 1);
  CHECK(adjust_globally(sequential{}, s, 23).solve.end == adjustment_end::converged);
  CHECK(worst() < 0.1);
}

/// Adjusts all of the map while `meanwhile` happens: before the result is written, or before a later part of it.
template <class Function>
turbomap::local_adjustment_summary adjust_while(local_scene<watched>& s, Function meanwhile, int part = 2,
                                                int points_per_guard = 0) {
  adjustment_run<watched, sequential> run(sequential{}, s);
  int times = 0;
  s.map.watch.before = [&] {
    if (++times == part) meanwhile();
  };
  s.map.watch.armed = true;
  global_adjustment_options options;
  options.points_per_guard = points_per_guard;
  const auto summary = run.adjust_globally(5, options);
  s.map.watch.armed = false, s.map.watch.before = {};
  CHECK(times >= part);
  CHECK_FALSE(s.map.watch.held);
  CHECK(turbomap::validate(s.map).empty());
  return summary;
}
local_recipe with_outliers() {
  local_recipe recipe;
  recipe.outliers = 0.05;
  return recipe;
}

TEST_CASE("a keyframe that moved or died meanwhile: nothing is written") {
  for (const bool dies : {false, true}) {
    local_scene<watched> s(with_outliers());
    std::string then;
    const auto summary = adjust_while(s, [&] {
      auto T = s.map.T_cw(s.keyframes[6]);
      T.tz += 1e-12;
      watched_traits::set_pose(s.map, s.keyframes[6], T);
      if (dies) turbomap::erase_keyframe(static_cast<watched_traits::map&>(s.map), s.keyframes[6]);
      then = s.state();
    });
    CHECK(summary.stale);
    CHECK(summary.solve.accepted > 0);
    CHECK(s.state() == then);
  }
}

TEST_CASE("points that moved or died meanwhile keep what they have, the rest is written") {
  local_scene<watched> still(with_outliers()), s(with_outliers());
  adjust_while(still, [] {});
  const turbomap::vec3<double> place{1, 2, 3};
  std::vector<std::size_t> dead;
  std::size_t moved = s.points.size();
  const auto summary = adjust_while(s, [&] {
    auto& map = static_cast<watched_traits::map&>(s.map);
    for (std::size_t p = 0; p < s.points.size(); ++p) {
      if (p % 7 == 0 && s.map.alive(s.points[p])) turbomap::erase_point(map, s.points[p]), dead.push_back(p);
      if (p % 7 != 0 && moved == s.points.size() && still.map.alive(s.points[p])) moved = p;
    }
    watched_traits::set_position(s.map, s.points[moved], place);
  });
  CHECK_FALSE(summary.stale);
  CHECK(dead.size() > 5);
  for (const std::size_t p : dead) CHECK_FALSE(s.map.alive(s.points[p]));
  CHECK(same_place(s.map.position(s.points[moved]), place));
  for (std::size_t f = 0; f < s.keyframes.size(); ++f)
    CHECK(same_pose(s.map.T_cw(s.keyframes[f]), still.map.T_cw(still.keyframes[f])));
  for (std::size_t p = 0; p < s.points.size(); ++p)
    if (p % 7 != 0 && p != moved && still.map.alive(still.points[p]))
      CHECK(same_place(s.map.position(s.points[p]), still.map.position(still.points[p])));
}

TEST_CASE("in parts: the same map, and once somebody moves a keyframe no more is written") {
  local_scene<watched> whole(with_outliers()), parts(with_outliers()), early(with_outliers()), late(with_outliers());
  const auto summary = adjust_while(whole, [] {});
  const std::string unadjusted = early.state();
  const auto move = [](local_scene<watched>& s) {
    return [&s] {
      auto T = s.map.T_cw(s.keyframes[6]);
      T.tz += 1;
      watched_traits::set_pose(s.map, s.keyframes[6], T);
    };
  };
  const long before = parts.map.watch.taken;
  CHECK(adjust_while(
            parts, [] {}, 4, 16)
            .outliers == summary.outliers);
  CHECK(parts.map.watch.unguarded == 0);
  CHECK(parts.state() == whole.state());
  // One hold to read, then outliers are looked for, poses and positions written, outliers taken out, four in each.
  const long times = parts.map.watch.taken - before, taking_out = (static_cast<long>(summary.outliers) + 3) / 4;
  const auto nothing_written = adjust_while(early, move(early), 3, 16);
  CHECK(nothing_written.stale);
  auto T = early.map.T_cw(early.keyframes[6]);
  T.tz -= 1;
  watched_traits::set_pose(early.map, early.keyframes[6], T);
  CHECK(early.state() == unadjusted);
  // All points are moved when the first four of the outliers have been found: those keep what they have, too.
  local_scene<watched> shifted(with_outliers());
  const auto nothing_taken = adjust_while(
      shifted,
      [&] {
        for (const auto p : shifted.points) {
          if (!shifted.map.alive(p)) continue;
          auto x = shifted.map.position(p);
          x.z += 1e-6;
          watched_traits::set_position(shifted.map, p, x);
        }
      },
      3, 16);
  CHECK(summary.outliers > 8);
  CHECK_FALSE(nothing_taken.stale);
  CHECK(nothing_taken.outliers == 0);
  const auto stopped = adjust_while(late, move(late), static_cast<int>(times - taking_out), 16);
  CHECK(stopped.stale);
  CHECK(stopped.outliers == 0);
  CHECK(same_pose(late.map.T_cw(late.keyframes[3]), whole.map.T_cw(whole.keyframes[3])));  // poses come first
}

/// Adjusts a map that is read in parts of this size. \param named  keyframes that move; none: all that is connected
turbomap::local_adjustment_summary adjust_read_in_parts(local_scene<watched>& s, int most,
                                                        const std::vector<turbomap::map_keyframe_id>& named = {}) {
  adjustment_run<watched, sequential> run(sequential{}, s);
  auto scope = run.scope();
  scope.points_read_per_guard = most;
  turbomap::global_adjustment adjust(scope);
  s.map.watch.armed = true;
  const auto summary = named.empty() ? adjust(scope, s.keyframes[5], global_adjustment_options{})
                                     : adjust(scope, named, global_adjustment_options{});
  s.map.watch.armed = false;
  CHECK(s.map.watch.unguarded == 0);
  return summary;
}

TEST_CASE("read in parts: the same map, however long they are") {
  for (const bool all : {true, false}) {
    local_scene<watched> whole(with_outliers());
    const auto named = [&](const local_scene<watched>& s) {
      return all ? std::vector<turbomap::map_keyframe_id>{}
                 : std::vector<turbomap::map_keyframe_id>{s.keyframes[3], s.keyframes[4], s.keyframes[7]};
    };
    const auto summary = adjust_read_in_parts(whole, 0, named(whole));
    CHECK(summary.solve.accepted > 0);
    for (const int most : {1, 7, 100}) {
      CAPTURE(most);
      local_scene<watched> s(with_outliers());
      const auto again = adjust_read_in_parts(s, most, named(s));
      CHECK(s.map.watch.taken > whole.map.watch.taken);
      CHECK(again.observations == summary.observations);
      CHECK(s.state() == whole.state());
    }
  }
}

TEST_CASE("the whole map is moved between two parts of what is read: what is adjusted is of one time") {
  local_scene<watched> still(with_outliers());
  const auto expected = adjust_read_in_parts(still, 20);
  for (int part = 2; part < 8; ++part) {
    CAPTURE(part);
    local_scene<watched> s(with_outliers());
    int times = 0;
    s.map.watch.before = [&] {
      if (++times == part) move_all(static_cast<watched_traits::map&>(s.map), 64);
    };
    const auto summary = adjust_read_in_parts(s, 20);
    s.map.watch.before = {};
    CHECK_FALSE(summary.stale);
    CHECK(summary.observations == expected.observations);
    CHECK(summary.solve.cost_final == doctest::Approx(expected.solve.cost_final).epsilon(1e-3));
  }
}

/// The map stays to the last bit, and the end is this.
turbomap::local_adjustment_summary check_unchanged(local_scene<flat_map>& s, std::size_t anyone, adjustment_end end,
                                                   const global_adjustment_options& options = {}) {
  const auto before = s.state();
  const auto summary = adjust_globally(sequential{}, s, anyone, options);
  CHECK(s.state() == before);
  CHECK(std::string(turbomap::to_string(summary.solve.end)) == turbomap::to_string(end));
  CHECK(summary.solve.accepted + static_cast<int>(summary.outliers) == 0);
  return summary;
}

TEST_CASE("nothing to do, or not possible: the map stays, and the summary says why") {
  local_scene<flat_map> s;
  global_adjustment_options options;
  SUBCASE("one keyframe: it is fixed") {
    for (std::size_t f = 0; f < s.keyframes.size(); ++f)
      if (f != 5) turbomap::erase_keyframe(s.map, s.keyframes[f], 0);
    const auto summary = check_unchanged(s, 5, adjustment_end::nothing_free);
    CHECK(summary.free_keyframes == 0);
    CHECK(summary.fixed_keyframes == 1);
  }
  SUBCASE("no points") {
    for (const auto& p : s.points) turbomap::erase_point(s.map, p);
    CHECK(check_unchanged(s, 5, adjustment_end::no_observations).points == 0);
  }
  SUBCASE("a keyframe that died, and none") {
    turbomap::erase_keyframe(s.map, s.keyframes[5]);
    CHECK(check_unchanged(s, 5, adjustment_end::no_observations).stale);
    s.keyframes[5] = {};
    adjustment_run<flat_map, sequential> run(sequential{}, s);
    CHECK(run.adjust_globally(5).stale);
  }
  SUBCASE("the flag was set before") {
    const std::atomic<bool> stop{true};
    options.solve.stop = &stop;
    CHECK(check_unchanged(s, 5, adjustment_end::stopped, options).free_keyframes == 9);
  }
  SUBCASE("a keyframe that is not in the store") {
    adjustment_run<flat_map, sequential> run(sequential{}, s);
    const auto before = s.state();
    run.stored.erase(turbomap::map_traits<flat_map>::id(s.map, s.keyframes[5]));
    CHECK_THROWS_AS(run.adjust_globally(5), std::invalid_argument);
    CHECK(s.state() == before);
    CHECK(run.adjust_globally(4).free_keyframes == 8);  // others go round it
  }
  SUBCASE("bad options, by name") {
    options.points_per_guard = -1;
    try {
      adjust_globally(sequential{}, s, 5, options);
      FAIL_CHECK("not refused");
    } catch (const std::invalid_argument& e) {
      CHECK(std::string(e.what()).find("options.points_per_guard = -1") != std::string::npos);
    }
  }
}

}  // namespace

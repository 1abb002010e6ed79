// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The update of points on a user's map under every host policy: against the oracle, and what is passed over.

#include <thrust/execution_policy.h>

#include <limits>
#include <random>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "duplicate_fusion_cases.hpp"
#include "scenes/lying_map.hpp"
#include "scenes/watched_map.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::map_point_id;
using turbomap_test::sequential;

/// A few keyframes whose points have gone stale: positions moved, appearances wiped.
template <class Map, class Camera, class Policy>
struct stale_map {
  using traits = turbomap::map_traits<Map>;
  mapping_recipe recipe;
  mapping_scene<Camera> scene;
  mapping_run<Map, Policy> run;
  turbomap::appearance_update<Map, Policy> update{run.ctx};
  turbomap::appearance_options options;
  turbomap::guard_times held;
  std::vector<map_point_id> points;

  explicit stale_map(const test_rig<Camera>& rig, unsigned seed = 1)
      : recipe(with_noise(seed)), scene(rig, recipe), run(scene, unfused({})) {
    run.steps(5);
    std::mt19937 random(seed);
    const std::vector<std::uint8_t> wiped(32, 0xAA);
    traits::for_each_point(run.map, [&](map_point_id p) { points.push_back(p); });
    for (const auto p : points) {
      auto x = traits::position(run.map, p);
      x.x += mapping_scene<Camera>::uniform(random, -0.2, 0.2);
      traits::set_position(run.map, p, x);
      traits::set_appearance(run.map, p, {1, 2, 3}, 4, 5, wiped.data());
      if (random() % 4 == 0) traits::set_reference(run.map, p, run.keyframes()[random() % 5]);  // need not see it
    }
  }
  static mapping_recipe with_noise(unsigned seed) {
    mapping_recipe r;
    r.seed = seed, r.noisy_bits = 40, r.pixel_noise = 0.5;
    return r;
  }
  std::size_t operator()(const std::vector<map_point_id>& which) { return update(run.scope(held), which, options); }
};

template <class Policy, class Camera>
void check_update(const test_rig<Camera>& rig, unsigned seed) {
  stale_map<mapped<Camera>, Camera, Policy> s(rig, seed);
  oracle_world<Camera> world(s.scene, s.run);
  std::vector<oracle_id> all;
  for (const auto p : s.points) all.push_back(turbomap::map_traits<mapped<Camera>>::id(s.run.map, p));
  world.oracle.refresh(all, s.options.scales);
  CHECK(s(s.points) == s.points.size());
  CHECK(s.points.size() > 100);
  check_equal(s.run.map, world.oracle);
  CHECK(s.held.count == 2);
}

TEST_CASE_TEMPLATE("all points, against the oracle", Policy, TURBOMAP_TEST_POLICIES) {
  check_update<Policy>(pinhole_rig(50), 1);
  check_update<Policy>(fisheye_rig(2), 2);
}

TEST_CASE("dead, empty, repeated and unobserved points are passed over") {
  stale_map<flat_map, pinhole_camera, sequential> s(pinhole_rig(50));
  const auto before = content(s.run.map);
  CHECK(s({}) == 0);
  CHECK(s({map_point_id{}, map_point_id{}}) == 0);
  CHECK(content(s.run.map) == before);
  const auto lonely = s.run.map.add_point({1, 2, 3});
  const auto dead = s.points[0], one = s.points[1];
  turbomap::erase_point(s.run.map, dead);
  CHECK(s({one, dead, one, map_point_id{}, lonely, s.points[2], one}) == 2);
  CHECK(stale_map<flat_map, pinhole_camera, sequential>::traits::max_distance(s.run.map, lonely) == 0);
}

TEST_CASE("points that changed and points that only moved: each once, and the guard is not taken for none") {
  using map = watched_map<mapped_descriptor>;
  using traits = turbomap::map_traits<map>;
  stale_map<map, pinhole_camera, sequential> s(pinhole_rig(50)), whole(pinhole_rig(50));
  whole(whole.points);
  using list = turbomap::span<const map_point_id>;
  const std::size_t half = s.points.size() / 2;
  CHECK(s.update(s.run.scope(s.held), list(s.points.data(), half), list(), s.options) == half);
  CHECK(s.held.count == 2);
  CHECK(s.update(s.run.scope(s.held), list(s.points.data(), half), list(s.points), s.options) == s.points.size());
  CHECK(s.held.count == 6);
  for (std::size_t i = 0; i < s.points.size(); ++i) {
    CHECK(traits::max_distance(s.run.map, s.points[i]) == traits::max_distance(whole.run.map, s.points[i]));
    CHECK((traits::descriptor_data(s.run.map, s.points[i])[7] == 0xAA) ==
          (i >= half || traits::descriptor_data(whole.run.map, s.points[i])[7] == 0xAA));
  }
}

TEST_CASE("observers that are not in the store do not count") {
  stale_map<flat_map, pinhole_camera, sequential> s(pinhole_rig(50)), expected(pinhole_rig(50));
  const auto outside = s.run.keyframes()[2];
  std::size_t spare = 0;
  while (s.run.map.point_at(outside, spare) != map_point_id{}) ++spare;
  for (auto* one : {&s, &expected}) {  // a point that only that one sees
    one->points.push_back(one->run.map.add_point({1, 2, 3}, outside));
    CHECK(turbomap::observe(one->run.map, one->points.back(), outside, spare));
  }
  s.run.mapper.remove(2);
  // The same map without that keyframe's views.
  for (std::size_t i = 0; i < expected.run.map.keypoints(outside).size(); ++i)
    turbomap::forget(expected.run.map, outside, i);
  const std::size_t updated = s(s.points);
  CHECK(updated == expected(expected.points));
  CHECK(updated + 1 == s.points.size());
  CHECK(updated > 50);
  using traits = turbomap::map_traits<flat_map>;
  std::size_t different = 0;
  for (const auto p : s.points) {
    // A point that lost its reference got another one in the map: the first observer stands in, the same.
    different += traits::max_distance(s.run.map, p) == traits::max_distance(expected.run.map, p) ? 0 : 1;
    for (int e = 0; e < 32; ++e)
      different += traits::descriptor_data(s.run.map, p)[e] == traits::descriptor_data(expected.run.map, p)[e] ? 0 : 1;
  }
  CHECK(different == 0);
}

TEST_CASE("covariances are kept where they are asked for, those of the views that a point has") {
  using traits = turbomap::map_traits<flat_map>;
  stale_map<flat_map, pinhole_camera, sequential> s(pinhole_rig(50));
  s(s.points);
  for (const auto p : s.points) CHECK(traits::covariance(s.run.map, p).zz == 0);
  s.options.covariance = true;
  s(s.points);
  const auto before = [&](map_point_id p) { return traits::covariance(s.run.map, p); };
  std::vector<turbomap::point_covariance> first;
  for (const auto p : s.points) first.push_back(before(p));
  for (const auto& c : first) CHECK((c.xx > 0 && c.yy > 0 && c.zz > 0 && c.xx + c.yy + c.zz < 1e3F));
  // A view less: known worse.
  std::size_t worse = 0, less = 0;
  for (const auto p : s.points) {
    const auto views = s.run.map.observations(p);
    if (views.size() < 3) continue;
    turbomap::forget(s.run.map, s.run.map.keyframe_at(views[0].keyframe), static_cast<std::size_t>(views[0].keypoint));
    ++less;
  }
  s(s.points);
  for (std::size_t i = 0; i < s.points.size(); ++i) {
    const auto c = before(s.points[i]);
    worse += c.xx + c.yy + c.zz > first[i].xx + first[i].yy + first[i].zz ? 1 : 0;
  }
  CHECK(less > 20);
  CHECK(worse == less);
}

TEST_CASE("a point that is to keep its descriptor and has none: its covariance is written all the same") {
  using traits = turbomap::map_traits<lying_map>;
  stale_map<lying_map, pinhole_camera, sequential> s(pinhole_rig(50));
  const auto bare = s.points[5];
  s.run.map.bare.insert(bare.index);
  s.options.descriptors = false, s.options.covariance = true;
  turbomap::fault_list noted;
  const auto scope = s.run.scope(s.held);
  s.update({scope.ctx, scope.map, scope.store, scope.stored, scope.held, turbomap::fault_sink(noted)}, s.points,
           s.options);
  CHECK(noted.size() == 1);
  CHECK(traits::max_distance(s.run.map, bare) == 5);  // its appearance is left alone
  CHECK(traits::covariance(s.run.map, bare).zz > 0);
  CHECK(traits::covariance(s.run.map, s.points[4]).zz > 0);
}

TEST_CASE("what is not asked for stays as it is") {
  using traits = turbomap::map_traits<flat_map>;
  stale_map<flat_map, pinhole_camera, sequential> s(pinhole_rig(50)), whole(pinhole_rig(50));
  whole(whole.points);
  s.options.geometry = false;
  CHECK(s(s.points) == s.points.size());
  for (const auto p : s.points) {
    CHECK(traits::normal(s.run.map, p).y == 2);
    CHECK(traits::min_distance(s.run.map, p) == 4);
    CHECK(traits::max_distance(s.run.map, p) == 5);
    for (int e = 0; e < 32; ++e)
      CHECK(traits::descriptor_data(s.run.map, p)[e] == traits::descriptor_data(whole.run.map, p)[e]);
  }
  stale_map<flat_map, pinhole_camera, sequential> g(pinhole_rig(50));
  g.options.descriptors = false;
  CHECK(g(g.points) == g.points.size());
  for (const auto p : g.points) {
    CHECK(traits::descriptor_data(g.run.map, p)[7] == 0xAA);
    CHECK(traits::max_distance(g.run.map, p) == traits::max_distance(whole.run.map, p));
  }
}

TEST_CASE("a point that dies meanwhile is left alone, and so is the one that got its place") {
  using map = watched_map<mapped_descriptor>;
  stale_map<map, pinhole_camera, sequential> s(pinhole_rig(50));
  const auto victim = s.points[3];
  int times = 0;
  map_point_id heir;
  s.run.map.watch.before = [&] {
    if (++times != 2) return;  // between snapshot and commit
    turbomap::erase_point(s.run.map, victim);
    heir = s.run.map.add_point({1, 2, 3});
  };
  s({victim, s.points[4]});
  s.run.map.watch.before = {};
  REQUIRE(times == 2);
  REQUIRE(heir.index == victim.index);
  CHECK(turbomap::map_traits<map>::max_distance(s.run.map, heir) == 0);
  CHECK(turbomap::map_traits<map>::max_distance(s.run.map, s.points[4]) != 5);
}

TEST_CASE(
    "maps that contradict themselves, positions that are not finite, bad options: refused, and no point is changed") {
  stale_map<lying_map, pinhole_camera, sequential> s(pinhole_rig(50));
  auto& map = s.run.map;
  const auto victim = s.points[s.points.size() / 2];
  auto before = content(static_cast<flat_map&>(map));
  const auto spare = s.run.add();
  turbomap::erase_keyframe(map, spare);
  for (const auto& [k, i] : {std::pair(s.run.keyframes()[0], std::size_t{1000000}), std::pair(spare, std::size_t{0}),
                             std::pair(turbomap::map_keyframe_id{}, std::size_t{0})}) {
    map.invented.insert({victim.index, {k, i}});
    CHECK_THROWS_AS(s(s.points), turbomap::inconsistent_map);
    map.tell_the_truth();
  }
  s.options.scales.levels = 0;
  CHECK_THROWS_AS(s(s.points), std::invalid_argument);
  s.options.scales = {};
  CHECK(content(static_cast<flat_map&>(map)) == before);
  const auto x = map.position(victim);
  turbomap::map_traits<lying_map>::set_position(map, victim, {std::numeric_limits<double>::quiet_NaN(), 0, 0});
  before = content(static_cast<flat_map&>(map));
  CHECK_THROWS_AS(s(s.points), std::invalid_argument);
  CHECK(content(static_cast<flat_map&>(map)) == before);
  turbomap::map_traits<lying_map>::set_position(map, victim, x);
  CHECK(s(s.points) == s.points.size());
}

}  // namespace

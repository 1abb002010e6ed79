// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Duplicate fusion end to end under every host policy: equal to the sequential oracle in both modes; empty, dead and unknown
/// keyframes; maps that contradict themselves.

#include <thrust/execution_policy.h>

#include <limits>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "duplicate_fusion_cases.hpp"
#include "scenes/failing_map.hpp"
#include "scenes/lying_map.hpp"
#include "scenes/watched_map.hpp"
#include "support/policies.hpp"

namespace turbomap_test {

/// A map that keeps no covariances.
struct forgetful_map : flat_map {
  using flat_map::flat_map;
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::forgetful_map> final  // final: what is deleted on purpose is no mistake
    : turbomap::map_traits<turbomap_test::flat_map> {
  using map = turbomap_test::forgetful_map;
  static void covariance() = delete;
  static void set_covariance() = delete;
};

namespace {

using namespace turbomap_test;
using turbomap_test::sequential;

TEST_CASE_TEMPLATE("a stereo pair: both modes, all merge rules", Policy, TURBOMAP_TEST_POLICIES) {
  check_fusions(Policy{}, pinhole_rig(50), 1);
}
TEST_CASE_TEMPLATE("a fisheye rig of two cameras", Policy, TURBOMAP_TEST_POLICIES) {
  const auto tally = check_fusions(Policy{}, fisheye_rig(2), 100, 1);
  CHECK(tally.conflicts > 0);
}

/// A run, and what a fusion of its last keyframe takes.
template <class Map, class Policy = sequential>
struct prepared {
  mapping_scene<pinhole_camera> scene{pinhole_rig(50), mapping_recipe{}};
  mapping_run<Map, Policy> run{scene, unfused({})};
  turbomap::duplicate_fusion<Map, Policy> fusion{run.ctx};
  turbomap::neighbourhood<Map> around;
  std::vector<turbomap::map_keyframe_id> targets;
  turbomap::fusion_options options;
  turbomap::guard_times held;

  explicit prepared(int keyframes = 5) {
    run.steps(keyframes);
    targets = around.targets(run.map, run.keyframes().back(), {});
  }
  turbomap::fusion_summary forward() {
    return fusion.forward(run.scope(held), run.keyframes().back(), targets, options);
  }
  turbomap::fusion_summary backward() {
    return fusion.backward(run.scope(held), run.keyframes().back(), targets, options);
  }
};

TEST_CASE("no targets, dead ones, and such as nobody inserted: nothing happens to them") {
  for (const auto mode : {turbomap::fusion_mode::snapshot, turbomap::fusion_mode::serial_exact}) {
    prepared<flat_map> p;
    p.options.mode = mode;
    const auto all = p.targets;
    p.targets.clear();
    const auto before = content(p.run.map);
    CHECK(p.forward().entries == 0);
    CHECK(p.backward().entries == 0);
    CHECK(content(p.run.map) == before);
    const auto unknown = p.run.add();
    CHECK(p.run.map.alive(unknown));
    turbomap::erase_keyframe(p.run.map, all[0]);
    const auto dead_only = content(p.run.map);
    p.targets = {all[0]};
    CHECK(p.forward().entries == 0);
    CHECK(p.backward().entries == 0);
    CHECK(content(p.run.map) == dead_only);
    p.targets = {all[0], all[1], unknown};
    const auto query = p.run.keyframes()[p.run.keyframes().size() - 2];
    const auto done = p.fusion.forward(p.run.scope(p.held), query, p.targets, p.options);
    CHECK(done.merged + done.observations_added > 0);
    CHECK(turbomap::validate(p.run.map).empty());
    for (std::size_t i = 0; i < p.run.map.keypoints(unknown).size(); ++i)
      CHECK(p.run.map.point_at(unknown, i) == turbomap::map_point_id{});
  }
}

TEST_CASE("what was fused once is not fused again") {
  prepared<flat_map> p;
  p.fusion.begin();
  CHECK(p.forward().merged > 0);
  p.backward();
  CHECK(p.held.commit_ms > 0);
  CHECK(p.held.commit_ms < p.held.total_ms);  // the rest was read
  CHECK_FALSE(p.fusion.touched().empty());
  p.fusion.begin();
  CHECK(p.fusion.touched().empty());
  const auto again = p.forward();
  CHECK(again.merged == 0);
}

TEST_CASE("what was fused before the traits threw is counted") {
  for (const auto mode : {turbomap::fusion_mode::snapshot, turbomap::fusion_mode::serial_exact})
    for (const int entries_per_guard : {0, 3}) {  // one part, many
      prepared<failing_map> p;
      p.options.mode = mode, p.options.commit.entries_per_guard = entries_per_guard;
      p.fusion.begin();
      p.run.map.adds_left = 40;
      CHECK_THROWS_AS(p.forward(), broken_write);
      const auto& done = p.fusion.done();
      CHECK(done.merged > 0);
      CHECK(done.observations_added + done.merged == p.fusion.touched().size());  // what is applied touches one point
    }
}

TEST_CASE("points that are known badly are found farther away; exact ones as ever") {
  using traits = turbomap::map_traits<flat_map>;
  const auto fuse = [](bool covariances, float variance) {
    prepared<flat_map> p;
    p.options.covariances = covariances;
    traits::for_each_point(p.run.map, [&](turbomap::map_point_id id) {
      traits::set_covariance(p.run.map, id, {variance, 0, variance, 0, 0, variance});
      auto x = p.run.map.position(id);
      x.x += 0.03;  // out of the exact gate
      if (variance > 0) traits::set_position(p.run.map, id, x);
    });
    const auto done = p.forward();
    return std::make_pair(content(p.run.map), done.entries);
  };
  CHECK(fuse(true, 0).first == fuse(false, 0).first);
  CHECK(fuse(true, 0.01F).second > fuse(false, 0.01F).second + 5);
}

TEST_CASE_TEMPLATE("a map without covariances is fused as one that keeps them", Policy, TURBOMAP_TEST_POLICIES) {
  static_assert(!turbomap::detail::map_has_v<forgetful_map, turbomap::detail::map_covariance_member>);
  const auto fuse = [](auto map, bool covariances, turbomap::fusion_mode mode) {
    using map_type = decltype(map);
    using traits = turbomap::map_traits<map_type>;
    prepared<map_type, Policy> p;
    p.options.mode = mode;
    p.options.covariances = covariances, p.options.stereo_correlation = 0.5;
    p.options.commit.tolerance.position_chi2 = 0;  // only a map that keeps them could tell what lies apart
    turbomap::appearance_options views;
    views.covariance = true, views.stereo_correlation = 0.5;
    turbomap::appearance_update<map_type, Policy> update(p.run.ctx);
    const auto all = [&] {
      std::vector<turbomap::map_point_id> points;
      traits::for_each_point(p.run.map, [&](turbomap::map_point_id id) { points.push_back(id); });
      return points;
    };
    for (const auto id : all()) {  // out of the exact gate
      auto x = p.run.map.position(id);
      x.x += 0.03;
      traits::set_position(p.run.map, id, x);
    }
    update(p.run.scope(p.held), all(), views);  // a map that keeps covariances has them up to date
    auto entries = p.forward().entries;
    update(p.run.scope(p.held), all(), views);
    entries += p.backward().entries;
    return std::make_pair(content(p.run.map), entries);
  };
  for (const auto mode : {turbomap::fusion_mode::snapshot, turbomap::fusion_mode::serial_exact}) {
    const auto kept = fuse(flat_map(8), true, mode), computed = fuse(forgetful_map(8), true, mode);
    if (mode == turbomap::fusion_mode::snapshot) CHECK(computed == kept);
    CHECK(computed.second > fuse(forgetful_map(8), false, mode).second + 5);
    CHECK(fuse(forgetful_map(8), false, mode) == fuse(flat_map(8), false, mode));
  }
}

TEST_CASE("what died between search and commit is stale") {
  prepared<watched_map<mapped_descriptor>> p;
  p.options.commit.entries_per_guard = 0;  // the snapshot, then the commit
  auto& map = p.run.map;
  const auto query = p.run.keyframes().back();
  int times = 0;
  map.watch.before = [&] {
    if (++times != 2) return;
    turbomap::erase_keyframe(map, p.targets[0]);
    for (std::size_t i = 0; i < map.keypoints(query).size(); i += 2)
      if (const auto q = map.point_at(query, i); q != turbomap::map_point_id{}) turbomap::erase_point(map, q);
  };
  const auto done = p.forward();
  CHECK(times == 2);
  CHECK(done.stale > 10);
  CHECK(done.merged > 0);
  CHECK(turbomap::validate(map).empty());
}

TEST_CASE("bad options are refused with the map as it was") {
  for (const auto mode : {turbomap::fusion_mode::snapshot, turbomap::fusion_mode::serial_exact}) {
    prepared<flat_map> p;
    p.options.mode = mode;
    const auto before = content(p.run.map);
    p.options.search.radius = -1;
    CHECK_THROWS_AS(p.forward(), std::invalid_argument);
    p.options.search = {};
    p.options.commit.tolerance.chi2 = -1;
    CHECK_THROWS_AS(p.forward(), std::invalid_argument);
    CHECK(content(p.run.map) == before);
    p.options.commit = {};
    CHECK(p.forward().merged > 0);
  }
}

TEST_CASE("a map that contradicts itself is refused and stays as it was") {
  prepared<lying_map> p;
  auto& map = p.run.map;
  const auto query = p.run.keyframes().back();
  int refused = 0;
  const auto try_lie = [&] {
    map.writes = 0;
    try {
      p.forward();
      FAIL_CHECK("not refused");
    } catch (const turbomap::inconsistent_map&) {
      ++refused;
    }
    CHECK(map.writes == 0);
    map.tell_the_truth();
  };
  const auto before = content(map);
  for (const auto target : p.targets)
    for (std::size_t i = 0; i < map.keypoints(target).size(); ++i)  // slots of points that do not list them
      if (map.point_at(target, i) != turbomap::map_point_id{})
        map.hidden[{map.point_at(target, i).index, {target.index, i}}];
  try_lie();
  for (std::size_t i = 0; i < map.keypoints(query).size(); ++i)  // an index beyond all keypoints
    if (const auto q = map.point_at(query, i); q != turbomap::map_point_id{})
      map.invented.insert({q.index, {p.targets[0], 1000000}});
  try_lie();
  for (std::size_t i = 0; i < map.keypoints(query).size(); ++i)  // an observation without its slot
    if (const auto q = map.point_at(query, i); q != turbomap::map_point_id{})
      map.invented.insert({q.index, {p.run.keyframes()[0], i % map.keypoints(p.run.keyframes()[0]).size()}});
  try_lie();
  CHECK(refused == 3);
  CHECK(content(map) == before);
  CHECK(turbomap::validate(map).empty());
  CHECK(p.forward().merged > 0);
}

}  // namespace

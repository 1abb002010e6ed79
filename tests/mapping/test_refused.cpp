// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Local mapping goes on around what it cannot use: poses and positions that are no numbers, observations that contradict the
/// map. What is wrong at insert() is refused there; what turns bad later is passed over and reported, or thrown where the
/// options are strict.

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "local_mapper_cases.hpp"
#include "scenes/lying_map.hpp"
#include "scenes/pointer_map.hpp"

namespace turbomap_test {

/// A map of pointers that is read directly.
struct direct_pointer_map : pointer_map {};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::direct_pointer_map> : turbomap::map_traits<turbomap_test::pointer_map> {
  static constexpr bool mirrored = false;
};

namespace {

using namespace turbomap_test;
using turbomap::map_fault;
using turbomap::mapping_stage;
using turbomap::stage_outcome;
using lying_traits = turbomap::map_traits<lying_map>;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

struct lying_run {
  mapping_case<pinhole_camera> c = stereo_case(noisy(3));
  mapping_scene<pinhole_camera> scene{c.rig, c.recipe};
  mapping_run<lying_map, sequential_policy, turbomap::local_adjustment<lying_map, sequential_policy>> run;

  explicit lying_run(bool strict, turbomap::local_mapper_hooks<lying_map> hooks = {}, bool culls = false)
      : run(scene, with(c.options, strict, culls), std::move(hooks)) {}
  static turbomap::local_mapper_options with(turbomap::local_mapper_options options, bool strict, bool culls) {
    options.strict = strict;
    options.enabled[mapping_stage::keyframe_culling] = culls;
    options.keyframe_culling.redundant_share = 0.6F;
    return options;
  }
  turbomap::map_point_id a_point(turbomap::map_keyframe_id k) const {
    for (std::size_t i = 0; i < run.map.keypoints(k).size(); ++i)
      if (run.map.point_at(k, i) != turbomap::map_point_id{}) return run.map.point_at(k, i);
    return {};
  }
};

bool names(const turbomap::mapping_report& report, map_fault fault) {
  for (const auto& v : report.refused)
    if (v.fault == fault) return true;
  return false;
}

struct spoiler {
  const char* name;
  map_fault fault;
  std::function<void(lying_run&)> spoil, mend;
};
std::vector<spoiler> spoilers() {
  const auto shift = [](double norm, double t) {
    return [=](lying_run& r) {
      auto T = r.run.map.T_cw(r.run.keyframes()[3]);
      T.qw *= norm, T.qx *= norm, T.qy *= norm, T.qz *= norm, T.tx += t;
      r.run.map.set_pose(r.run.keyframes()[3], T);
    };
  };
  const auto restore = [](lying_run& r) { r.run.map.set_pose(r.run.keyframes()[3], r.scene.pose(3)); };
  const auto truth = [](lying_run& r) { r.run.map.tell_the_truth(); };
  return {
      {"a pose that is not finite", map_fault::bad_pose, shift(1, nan), restore},
      {"a quaternion of norm 1.0006", map_fault::bad_pose, shift(1.0006, 0), restore},
      {"a position that is not finite", map_fault::position_not_finite,
       [](lying_run& r) {
         lying_traits::set_position(r.run.map, r.a_point(r.run.keyframes()[3]), {nan, 0, 5});
       },
       [](lying_run& r) {
         lying_traits::set_position(r.run.map, r.a_point(r.run.keyframes()[3]), {0, 0, 5});
       }},
      {"an observer that is dead", map_fault::observer_not_alive,
       [](lying_run& r) {
         flat_map& map = r.run.map;
         const turbomap::map_keyframe_id dead{r.run.keyframes()[0].index, r.run.keyframes()[0].generation + 1};
         for (const auto k : {r.run.keyframes()[2], r.run.keyframes()[3]})
           for (std::size_t i = 0; i < map.keypoints(k).size(); ++i)
             if (map.point_at(k, i) != turbomap::map_point_id{})
               r.run.map.invented.insert({map.point_at(k, i).index, {dead, 0}});
       },
       truth},
      {"a keypoint that is not there", map_fault::keypoint_out_of_range,
       [](lying_run& r) {
         r.run.map.invented.insert({r.a_point(r.run.keyframes()[3]).index, {r.run.keyframes()[2], 1000000}});
       },
       truth},
      {"a point without descriptor", map_fault::no_descriptor,
       [](lying_run& r) { r.run.map.bare.insert(r.a_point(r.run.keyframes()[3]).index); }, truth},
  };
}

TEST_CASE("what turns bad is passed over and reported, and the rest of the work is done") {
  for (const spoiler& s : spoilers()) {
    CAPTURE(s.name);
    lying_run r(false);
    r.run.steps(4);
    CHECK(r.run.mapper.report().refused.empty());
    s.spoil(r);
    std::size_t created = 0, merged = 0, reported = 0;
    for (int n = 0; n < 5; ++n) {
      const auto& report = r.run.step();
      for (const auto stage :
           {mapping_stage::search, mapping_stage::creation, mapping_stage::fusion, mapping_stage::adjustment})
        CHECK(report.outcome[stage] == stage_outcome::done);
      reported += names(report, s.fault) ? 1 : 0;
      created += report.points_created, merged += report.fused.merged;
      CHECK(report.adjustment.solve.accepted > 0);
      CHECK(report.neighbours >= 3);
    }
    CHECK(reported >= 3);  // until no keyframe shares points with it
    CHECK(created > 2);
    // All points of two keyframes list a dead observer: what concerns them is not merged.
    if (s.fault != map_fault::observer_not_alive) CHECK(merged > 5);
    s.mend(r);
    CHECK(r.run.step().refused.empty());
    CHECK(turbomap::validate(r.run.map).empty());
  }
}

TEST_CASE("every stage is done beside what turned bad, and keyframes are culled") {
  std::size_t culled = 0, points_culled = 0;
  for (const spoiler& s : spoilers()) {
    CAPTURE(s.name);
    lying_run r(false, {}, true);
    r.run.steps(4);
    s.spoil(r);
    std::size_t reported = 0;
    for (int n = 0; n < 8; ++n) {
      const auto& report = r.run.step();
      for (std::size_t stage = 0; stage < turbomap::mapping_stages; ++stage) {
        CAPTURE(stage);
        CHECK(report.outcome.values[stage] == stage_outcome::done);
      }
      reported += names(report, s.fault) ? 1 : 0;
      culled += report.keyframes_culled.size(), points_culled += report.points_culled;
    }
    CHECK(reported >= 1);
    CHECK(r.run.store.statistics().pinned_sets == 0);
    CHECK(r.run.store.size() == r.run.map.keyframe_count());
  }
  CHECK(culled > 5);
  CHECK(points_culled > 0);
}

TEST_CASE("strict: what turns bad is an exception, again and again, and nothing stays pinned") {
  for (const spoiler& s : spoilers()) {
    CAPTURE(s.name);
    lying_run r(true);
    r.run.steps(4);
    s.spoil(r);
    for (int n = 0; n < 2; ++n) {
      CHECK_THROWS_AS(r.run.step(), turbomap::inconsistent_map);
      CHECK(r.run.store.statistics().pinned_sets == 0);
    }
    s.mend(r);
    r.run.note();
    CHECK_NOTHROW(r.run.step());
  }
}

TEST_CASE("the pose of the keyframe itself turns bad: what needs none is done") {
  for (const double norm : {nan, 1.0006}) {
    lying_run r(false);
    r.run.steps(4);
    const auto k = r.run.track();
    auto T = r.run.map.T_cw(k);
    T.qw *= norm, T.qx *= norm, T.qy *= norm, T.qz *= norm;
    r.run.map.set_pose(k, T);
    const auto& report = r.run.mapper.process(k);
    for (std::size_t i = 0; i < turbomap::mapping_stages - 1; ++i) {
      const auto stage = static_cast<mapping_stage>(i);
      CHECK(report.outcome[stage] == (stage < mapping_stage::search ? stage_outcome::done : stage_outcome::refused));
    }
    REQUIRE(report.refused.size() == 1);
    CHECK(report.refused[0].fault == map_fault::bad_pose);
    CHECK(report.refused[0].keyframe == 4);
    CHECK(report.points_updated > 0);
    r.run.note();
    for (int n = 0; n < 3; ++n) CHECK(r.run.step().outcome[mapping_stage::adjustment] == stage_outcome::done);
    CHECK(turbomap::validate(r.run.map).size() == 1);  // the pose
  }
}

/// A stereo camera goes along a wall, in a map of pointers; nobody's name may be asked for anything. Tracking knows 60 of 100 points
/// of the wall.
template <class Map>
struct wall_run {
  using traits = turbomap::map_traits<Map>;
  Map map;
  turbomap::context<sequential_policy> ctx;
  turbomap::store_of<Map, sequential_policy> store;
  turbomap::local_mapper<Map, sequential_policy> mapper;
  turbomap_test::test_rig<map_camera> rig = turbomap_test::pinhole_rig(50);
  std::vector<std::uint8_t> descriptors;
  std::vector<pointer_keyframe*> keyframes;
  std::vector<pointer_point*> points;

  explicit wall_run(bool strict) : mapper(ctx, map, store, with(strict)) {
    std::mt19937 random(1);
    for (int b = 0; b < 100 * 32; ++b) descriptors.push_back(static_cast<std::uint8_t>(random()));
    for (int n = 0; n < 3; ++n) step();
  }
  static turbomap::local_mapper_options with(bool strict) {
    auto options = turbomap::local_mapper_options::stereo(0.11, 10);
    options.strict = strict;
    return options;
  }
  static turbomap::vec3<double> on_wall(int i) { return {0.3 * (i % 10) - 1, 0.3 * (i / 10) - 1.4, 4 + 0.1 * (i % 7)}; }
  const turbomap::mapping_report& step() { return mapper.process(track()); }
  pointer_keyframe* track() {
    const auto n = static_cast<double>(keyframes.size());
    const auto& camera = rig.cameras[0];
    std::vector<turbomap::keypoint> keypoints;
    for (int i = 0; i < 100; ++i) {
      const auto x = on_wall(i);
      turbomap::vec2<double> uv{};
      camera.camera.project(turbomap::vec3<double>{x.x - 0.25 * n, x.y, x.z}, uv);
      auto k = make_keypoint(0, 0, static_cast<float>(uv.x - camera.bf / x.z), static_cast<float>(x.z));
      k.x = static_cast<float>(uv.x), k.y = static_cast<float>(uv.y);
      keypoints.push_back(k);
    }
    auto* const k = insert_keyframe(map, keypoints, n, nullptr);
    k->T_cw.tx = -0.25 * n;
    for (int i = 0; i < 60; ++i) {
      if (n == 0) points.push_back(traits::add_point(map, on_wall(i), k));
      turbomap::observe(map, points[static_cast<std::size_t>(i)], k, static_cast<std::size_t>(i));
    }
    keyframes.push_back(k);
    mapper.insert(k, turbomap::keyframe_data<map_descriptor, map_camera>{100, k->keypoints.data(), descriptors.data(),
                                                                         rig.cameras.data(), 1, rig.bounds});
    return k;
  }
};

TEST_CASE_TEMPLATE("names are pointers: what turns bad is passed over, and no name of nothing is asked for anything",
                   Map, pointer_map, direct_pointer_map) {
  struct damage {
    const char* name;
    map_fault fault;
    void (*make)(wall_run<Map>&);
  };
  const damage all[] = {
      {"a pose that is not finite", map_fault::bad_pose, [](wall_run<Map>& r) { r.keyframes[1]->T_cw.tx = nan; }},
      {"a position that is not finite", map_fault::position_not_finite,
       [](wall_run<Map>& r) { r.points[5]->position.x = nan; }},
      {"a keypoint that is not there", map_fault::keypoint_out_of_range,
       [](wall_run<Map>& r) { r.points[5]->observations[r.keyframes[2]].push_back(100000); }},
      {"an observer that is dead, and in the store", map_fault::observer_not_alive,
       [](wall_run<Map>& r) { r.keyframes[1]->bad = true; }},
      {"the first keyframe is dead, and in the store", map_fault::observer_not_alive,
       [](wall_run<Map>& r) { r.keyframes[0]->bad = true; }},
      {"an observer that is none", map_fault::observer_not_alive,
       [](wall_run<Map>& r) { r.points[5]->observations[nullptr].push_back(3); }},
  };
  for (const damage& d : all)
    for (const bool reported : {true, false}) {
      CAPTURE(d.name);
      CAPTURE(reported);
      wall_run<Map> r(false);
      d.make(r);
      if (reported) r.mapper.refresh();
      for (int n = 0; n < 3; ++n) {
        const auto& report = r.step();
        for (const auto stage :
             {mapping_stage::search, mapping_stage::creation, mapping_stage::fusion, mapping_stage::adjustment})
          CHECK(report.outcome[stage] == stage_outcome::done);
        // What nobody reports may not be seen, or be an edit of others.
        if (reported) CHECK(names(report, d.fault));
        CHECK(report.adjustment.observations > 100);
        CHECK(report.adjustment.free_keyframes > 1);
      }
      CHECK(r.map.points.size() > 80);
      CHECK(r.store.statistics().pinned_sets == 0);
    }
  for (const damage& d : all) {
    CAPTURE(d.name);
    wall_run<Map> r(true);
    d.make(r);
    r.mapper.refresh();
    CHECK_THROWS_AS(r.step(), turbomap::inconsistent_map);
    CHECK(r.store.statistics().pinned_sets == 0);
  }
}

TEST_CASE("an exception between the stages leaves nothing pinned") {
  turbomap::local_mapper_hooks<lying_map> hooks;
  bool armed = false;
  hooks.stage_done = [&](mapping_stage s, const turbomap::mapping_report&) {
    if (armed && s == mapping_stage::search) throw std::runtime_error("a hook");
  };
  lying_run r(false, hooks);
  r.run.steps(3);
  const auto k = r.run.track();
  armed = true;
  CHECK_THROWS_AS(r.run.mapper.process(k), std::runtime_error);
  armed = false;
  CHECK(r.run.store.statistics().pinned_sets == 0);
  CHECK_NOTHROW(r.run.mapper.process(k));
}

TEST_CASE("insert refuses what no stage could use") {
  lying_run r(false);
  r.run.steps(2);
  const auto k = r.run.add();
  auto data = r.scene.data<map_descriptor>(r.run.view(2));
  const auto good = data;
  const auto refused = [&](const char* what) {
    try {
      r.run.mapper.insert(k, data);
      FAIL_CHECK("not refused: " << what);
    } catch (const std::invalid_argument& e) {
      CHECK(std::string(e.what()).find(what) != std::string::npos);
    }
    data = good;
    CHECK(r.run.store.size() == 2);
    CHECK_FALSE(r.run.mapper.stored().contains(2));
  };
  data.bounds = {-3e38F, -3e38F, 3e38F, 3e38F};
  refused("bounds.max_x - bounds.min_x = inf");
  data.bounds = {0, 0, 1e-40F, 480};
  refused("bounds.max_x - bounds.min_x");
  data.bounds = {0, 0, 640, 1e-40F};
  refused("bounds.max_y - bounds.min_y");
  --data.keypoint_count;
  refused("keypoint_count");
  auto T = r.scene.pose(2);
  const auto with_pose = [&](double norm, double t, const char* what) {
    auto bad = T;
    bad.qw *= norm, bad.qx *= norm, bad.qy *= norm, bad.qz *= norm, bad.tx += t;
    r.run.map.set_pose(k, bad);
    refused(what);
  };
  with_pose(1, nan, "keyframe.T_cw");
  with_pose(1.0006, 0, "keyframe.T_cw squared quaternion norm");
  r.run.map.set_pose(k, T);
  r.run.mapper.insert(k, data);
  CHECK_NOTHROW(r.run.mapper.process(k));
}

}  // namespace

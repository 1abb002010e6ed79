// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Each fault of a map is found, named, and refused by commits with the map as it was.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/fusion_commit.hpp>
#include <turbomap/mapping/keyframe_culling.hpp>
#include <turbomap/mapping/point_culling.hpp>

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "scenes/lying_map.hpp"
#include "scenes/map_scene.hpp"

namespace {

using namespace turbomap_test;
using turbomap::map_fault;

/// Three keyframes of a rig that see the same two points; a third keypoint of each camera is free.
struct small_world {
  lying_map map;
  std::vector<turbomap::map_keyframe_id> k;
  std::vector<turbomap::map_point_id> p;

  small_world() {
    std::vector<turbomap::keypoint> rig;
    for (int camera = 0; camera < 2; ++camera)
      for (int i = 0; i < 3; ++i) rig.push_back(make_keypoint(i, camera, 5));
    for (int i = 0; i < 6; ++i)
      k.push_back(map.add_keyframe(rig, {}, 0.1 * i, i == 0 ? turbomap::map_keyframe_id{} : k.back()));
    for (int i = 0; i < 3; ++i) p.push_back(map.add_point({}, k[0]));
    for (std::size_t i = 0; i < 5; ++i)  // keyframe 5 and point 2 are alone
      for (std::size_t j = 0; j < 2; ++j)
        for (std::size_t camera = 0; camera < 2; ++camera) turbomap::observe(map, p[j], k[i], 3 * camera + j);
    map.writes = 0;
  }
  std::vector<map_fault> faults() const {
    std::vector<map_fault> all;
    for (const auto& v : turbomap::validate(map)) all.push_back(v.fault);
    return all;
  }
};

using faults = std::vector<map_fault>;

/// What a lie is, and what validate() says of it.
struct lie {
  const char* name;
  std::function<void(small_world&)> tell;
  faults expected;
  bool refused;  ///< by a commit that concerns point 0 and keyframe 1
};

std::vector<lie> lies() {
  using view = lying_map::view;
  return {
      {"slot of a point that never was",
       [](small_world& w) {
         w.map.slots[view{w.k[1].index, 0}] = {77, 0};
       },
       {map_fault::slot_of_dead_point, map_fault::observation_without_slot},
       true},
      {"slot of an erased point",
       [](small_world& w) {
         const auto dead = w.map.add_point({});
         turbomap::erase_point(w.map, dead);
         w.map.writes = 0;
         w.map.slots[view{w.k[1].index, 2}] = dead;
       },
       {map_fault::slot_of_dead_point},
       true},
      {"slot without observation",
       [](small_world& w) {
         w.map.slots[view{w.k[1].index, 2}] = w.p[0];
       },
       {map_fault::slot_without_observation},
       true},
      {"slot whose observation is not told",
       [](small_world& w) {
         w.map.hidden[{w.p[0].index, view{w.k[1].index, 0}}] = true;
         w.map.counts[w.p[0].index] = {4, 0, 0, 0, 0, 0, 0, 0};
         w.map.hidden[{w.p[0].index, view{w.k[1].index, 3}}] = true;
       },
       {map_fault::slot_without_observation, map_fault::slot_without_observation},
       true},
      {"observation whose slot is empty",
       [](small_world& w) {
         w.map.slots[view{w.k[4].index, 0}] = {};
       },
       {map_fault::observation_without_slot},
       true},
      {"observation whose slot holds another point",
       [](small_world& w) {
         w.map.slots[view{w.k[4].index, 0}] = w.p[1];
       },
       {map_fault::slot_without_observation, map_fault::observation_without_slot},
       true},
      {"observation by a keyframe that is gone",
       [](small_world& w) {
         const auto dead = w.map.add_keyframe(std::vector<turbomap::keypoint>(9), {});
         turbomap::erase_keyframe(w.map, dead);
         w.map.writes = 0;
         w.map.invented.insert({w.p[0].index, {dead, 4}});
       },
       {map_fault::observer_not_alive},
       true},
      {"observation by no keyframe",
       [](small_world& w) {
         w.map.invented.insert({w.p[0].index, {turbomap::map_keyframe_id{}, 0}});
       },
       {map_fault::observer_not_alive},
       true},
      {"observation by a keypoint beyond the last",
       [](small_world& w) {
         w.map.invented.insert({w.p[0].index, {w.k[5], 6}});
       },
       {map_fault::keypoint_out_of_range},
       true},
      {"observation by keypoint -1",
       [](small_world& w) {
         w.map.invented.insert({w.p[0].index, {w.k[5], static_cast<std::size_t>(-1)}});
       },
       {map_fault::keypoint_out_of_range},
       true},
      {"two keypoints of a camera",
       [](small_world& w) {
         w.map.slots[view{w.k[1].index, 2}] = w.p[0];
         w.map.invented.insert({w.p[0].index, {w.k[1], 2}});
       },
       {map_fault::seen_twice_by_camera},
       false},
      {"an observation listed twice",
       [](small_world& w) {
         w.map.invented.insert({w.p[0].index, {w.k[1], 0}});
         w.map.counts[w.p[0].index] = {6, 0, 0, 0, 0, 0, 0, 0};
       },
       {map_fault::seen_twice_by_camera},
       false},
      {"counts for fewer octaves",
       [](small_world& w) { w.map.counts[w.p[1].index] = {0}; },
       {map_fault::octave_out_of_range, map_fault::octave_out_of_range, map_fault::octave_out_of_range,
        map_fault::octave_out_of_range, map_fault::octave_out_of_range, map_fault::octave_out_of_range,
        map_fault::octave_out_of_range, map_fault::octave_out_of_range, map_fault::octave_out_of_range,
        map_fault::octave_out_of_range},
       true},
      {"wrong counts",
       [](small_world& w) { w.map.counts[w.p[0].index] = {5, 0, 0, 1, 0, 0, 0, 0}; },
       {map_fault::wrong_octave_counts},
       false},
      {"counts by view, not by keyframe",
       [](small_world& w) { w.map.counts[w.p[0].index] = {10, 0, 0, 0, 0, 0, 0, 0}; },
       {map_fault::wrong_octave_counts},
       false},
  };
}

TEST_CASE("a sound map has no fault") {
  const small_world w;
  CHECK(w.faults().empty());
  CHECK(turbomap::validate(flat_map()).empty());
  for (const auto p : w.p) CHECK_NOTHROW(turbomap::require_consistent(w.map, p));
  for (const auto k : w.k) CHECK_NOTHROW(turbomap::require_consistent_keyframe(w.map, k));
}

TEST_CASE("poses and positions that cannot be used are told") {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  using traits = turbomap::map_traits<flat_map>;
  small_world w;
  auto T = w.map.T_cw(w.k[1]);
  T.qw = 1.0006;
  traits::set_pose(w.map, w.k[1], T);
  traits::set_position(w.map, w.p[2], {0, nan, 0});
  CHECK(w.faults() == std::vector<map_fault>{map_fault::bad_pose, map_fault::position_not_finite});
  const auto all = turbomap::validate(w.map);
  CHECK(all[0].keyframe == traits::id(w.map, w.k[1]));
  CHECK(all[1].point == traits::id(w.map, w.p[2]));
}

TEST_CASE("a sink with a list notes each fault once") {
  turbomap::fault_list noted;
  const turbomap::fault_sink sink(noted);
  for (int n = 0; n < 2; ++n)
    for (const map_fault f : {map_fault::bad_pose, map_fault::position_not_finite})
      for (const std::uint64_t id : {1U, 2U}) sink({f, id, 0, 0}), sink({f, 0, id, 0}), sink({f, 0, 0, id});
  CHECK(noted.size() == 12);
  for (int n = 0; n < 2; ++n)
    for (std::uint64_t id = 3; id < 5003; ++id) sink({map_fault::observer_not_alive, 0, id, id % 7});
  REQUIRE(noted.size() == 5012);
  CHECK(noted[1].point == 1);
  for (std::size_t i = 12; i < noted.size(); ++i) CHECK(noted[i].point == i - 9);
  CHECK_THROWS_AS(turbomap::fault_sink()({map_fault::bad_pose, 1, 0, 0}), turbomap::inconsistent_map);
}

TEST_CASE("each lie is told apart") {
  for (const lie& one : lies()) {
    CAPTURE(one.name);
    small_world w;
    one.tell(w);
    CHECK(w.faults() == one.expected);
    w.map.tell_the_truth();
    CHECK(w.faults().empty());
  }
}

/// Runs a commit that must refuse, and looks at what it wrote.
template <class Commit>
void check_refused(small_world& w, Commit commit) {
  const auto before = everything(w.map);
  CHECK_THROWS_AS(commit(), turbomap::inconsistent_map);
  CHECK(w.map.writes == 0);
  CHECK(everything(w.map) == before);
}

TEST_CASE("commits refuse what contradicts itself, and leave the map as it was") {
  using duplicate = turbomap::duplicate<std::int32_t>;
  for (const lie& one : lies()) {
    if (!one.refused) continue;
    CAPTURE(one.name);
    for (const int commit : {0, 1, 2}) {
      CAPTURE(commit);
      small_world w;
      one.tell(w);
      if (commit == 0) {
        // The first entry is sound, and applied only if all are.
        std::vector<duplicate> plan{{1, 0, 2, 2, 9}};
        for (std::int32_t i = 0; i < 3; ++i) plan.push_back({0, 0, 0, i, 9}), plan.push_back({0, 0, 1, i, 9});
        const std::vector<turbomap::map_keyframe_id> targets{w.k[1], w.k[5]};
        turbomap::fusion_commit<lying_map> fusion;
        check_refused(w, [&] {
          fusion(w.map, turbomap::span<const duplicate>(plan), turbomap::span<const turbomap::map_keyframe_id>(targets),
                 turbomap::span<const turbomap::map_point_id>(w.p));
        });
        CHECK(fusion.touched().empty());
      } else if (commit == 1) {
        turbomap::keyframe_culling_options o;
        o.redundant_share = 0, o.observers = 1, o.octave_slack = 7;
        o.fewest_measurements = 100;  // all points would die, so all of them is looked at
        std::vector<turbomap::culling_record<turbomap::map_keyframe_id>> records;
        std::vector<turbomap::map_point_id> touched;
        const std::vector<turbomap::map_keyframe_id> candidates{w.k[0], w.k[1]};
        check_refused(w, [&] {
          turbomap::cull_keyframes(w.map, w.k[5], turbomap::span<const turbomap::map_keyframe_id>(candidates), o,
                                   records, &touched);
        });
        CHECK(touched.empty());
        CHECK(records.size() == 1);  // of the protected one before it
      } else {
        if (std::string(one.name).rfind("slot", 0) == 0) continue;  // a point does not know slots that it does not list
        std::vector<turbomap::recent_point<turbomap::map_point_id>> recent{{w.p[2], 0}, {w.p[0], 0}, {w.p[1], 0}};
        check_refused(w, [&] { turbomap::cull_recent_points(w.map, recent, 2); });
        CHECK(recent.size() == 3);
      }
    }
  }
}

TEST_CASE("a keyframe is taken out beside lies that do not concern the removal, and makes no new ones") {
  turbomap::keyframe_culling_options o;
  o.redundant_share = 0, o.observers = 1, o.octave_slack = 7;
  std::vector<std::string> taken;
  for (const lie& one : lies()) {
    if (!one.refused) continue;
    CAPTURE(one.name);
    small_world w;
    one.tell(w);
    const auto before = everything(w.map);
    std::vector<turbomap::culling_record<turbomap::map_keyframe_id>> records;
    turbomap::fault_list noted;
    turbomap::cull_keyframes(w.map, w.k[5], turbomap::span<const turbomap::map_keyframe_id>(&w.k[1], 1), o, records,
                             nullptr, turbomap::ignore_keyframe(), turbomap::fault_sink(noted));
    CHECK((records[0].verdict == turbomap::culling_verdict::erased) == noted.empty());
    CHECK((everything(w.map) == before) == !noted.empty());
    if (!noted.empty()) continue;
    taken.push_back(one.name);
    CHECK(w.faults() == one.expected);
  }
  CHECK(taken ==
        std::vector<std::string>{"observation whose slot is empty", "observation whose slot holds another point"});
}

TEST_CASE("a commit looks at the point that is found, and at the one that it would replace") {
  using duplicate = turbomap::duplicate<std::int32_t>;
  for (const lie& one : lies()) {
    if (std::string(one.name).rfind("observation", 0) != 0) continue;  // of point 0, elsewhere
    CAPTURE(one.name);
    for (const auto& plan : {std::vector<duplicate>{{0, 0, 2, 0, 9}}, std::vector<duplicate>{{1, 0, 0, 2, 9}},
                             std::vector<duplicate>{{1, 0, 2, 2, 9}, {1, 0, 1, 2, 9}, {1, 0, 0, 2, 9}}}) {
      small_world w;
      one.tell(w);
      const std::vector<turbomap::map_keyframe_id> targets{w.k[1], w.k[5]};
      turbomap::fusion_commit<lying_map> fusion;
      check_refused(w, [&] {
        fusion(w.map, turbomap::span<const duplicate>(plan), turbomap::span<const turbomap::map_keyframe_id>(targets),
               turbomap::span<const turbomap::map_point_id>(w.p));
      });
    }
  }
}

TEST_CASE("an octave beyond the counts of the point that is found is refused") {
  small_world w;
  w.map.counts[w.p[2].index] = {0, 0};
  const std::vector<turbomap::duplicate<std::int32_t>> plan{{0, 0, 2, 1, 9}, {0, 0, 2, 2, 9}};
  const std::vector<turbomap::map_keyframe_id> targets{w.k[5]};
  turbomap::fusion_commit<lying_map> fusion;
  check_refused(w, [&] {
    fusion(w.map, turbomap::span<const turbomap::duplicate<std::int32_t>>(plan),
           turbomap::span<const turbomap::map_keyframe_id>(targets), turbomap::span<const turbomap::map_point_id>(w.p));
  });
}

TEST_CASE("a violation says what, where and who") {
  small_world w;
  w.map.slots[{w.k[4].index, 0}] = {};
  const auto faults = turbomap::validate(w.map);
  REQUIRE(faults.size() == 1);
  CHECK(faults[0].keyframe == 4);
  CHECK(faults[0].keypoint == 0);
  CHECK(faults[0].point == 0);
  CHECK(turbomap::to_string(faults[0]) ==
        "an observation whose slot does not hold the point: keyframe 4, keypoint 0, point 0");
  try {
    turbomap::require_consistent(w.map, w.p[0]);
    CHECK(false);
  } catch (const turbomap::inconsistent_map& e) {
    CHECK(e.violation.keyframe == 4);
    CHECK(std::string(e.what()) == "turbomap: map: " + turbomap::to_string(faults[0]));
  }
  for (int f = 0; f <= static_cast<int>(map_fault::wrong_octave_counts); ++f)
    CHECK(std::string(turbomap::to_string(static_cast<map_fault>(f))).size() > 10);
}

}  // namespace

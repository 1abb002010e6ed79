// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// What a duplicate search is told of a map: the points of keyframes, each once, and who sees them already. A keyframe tells by
/// its slots what the lists of the points tell, of each camera of its rig; points without a descriptor are left out of both.

#include <turbomap/map/map_edit.hpp>
#include <turbomap/mapping/duplicate_snapshot.hpp>

#include <cstddef>
#include <set>
#include <vector>

#include "local_mapper_cases.hpp"

namespace turbomap_test {

/// A map in which some points have no descriptor yet.
struct partly_described_map : mapped_by<fisheye_camera> {
  std::set<std::size_t> undescribed;  ///< indices of points
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::partly_described_map>
    : turbomap::map_traits<turbomap_test::mapped_by<turbomap_test::fisheye_camera>> {
  using base = turbomap::map_traits<turbomap_test::mapped_by<turbomap_test::fisheye_camera>>;
  static const element* descriptor_data(const turbomap_test::partly_described_map& m, point p) {
    return m.undescribed.count(p.index) != 0 ? nullptr : base::descriptor_data(m, p);
  }
};

namespace {

using namespace turbomap_test;
using map_type = partly_described_map;
using traits = turbomap::map_traits<map_type>;

TEST_CASE("who sees the points: by lists and by slots") {
  auto c = rig_case(noisy(1));
  c.options.enabled[turbomap::mapping_stage::keyframe_culling] = false;
  const mapping_scene<fisheye_camera> scene(c.rig, c.recipe);
  mapping_run<map_type, sequential_policy> run(scene, c.options);
  run.steps(5);
  auto& map = run.map;
  for (std::size_t i = 0; i < map.keypoints(run.keyframes()[2]).size(); i += 7)
    map.undescribed.insert(map.point_at(run.keyframes()[2], i).index);
  turbomap::duplicate_snapshot<map_type> by_lists, by_slots;
  turbomap::fault_list faults;
  int seen = 0, by_both_cameras = 0;
  for (const auto target : run.keyframes()) {
    turbomap::keyframe_selection<map_type> targets;
    targets.place(map, target, run.mapper.stored());
    for (auto* snapshot : {&by_lists, &by_slots}) {
      snapshot->clear();
      snapshot->add_point(map, turbomap::map_point_id{});
      for (const auto k : run.keyframes()) snapshot->add_points_of(map, k, turbomap::fault_sink(faults));
    }
    by_lists.note_observed(map, targets);
    by_slots.note_observed_by(map, target);
    by_lists.mark_observed({2}), by_slots.mark_observed({2});
    const auto& points = by_slots.points();
    REQUIRE(by_lists.points() == points);
    std::set<std::size_t> live;
    for (const auto k : run.keyframes())
      for (std::size_t i = 0; i < map.keypoints(k).size(); ++i)
        if (const auto p = map.point_at(k, i); p != turbomap::map_point_id{} && map.undescribed.count(p.index) == 0)
          live.insert(p.index);
    CHECK(points.size() == live.size());
    const auto lists = by_lists.skip(0), slots = by_slots.skip(0);
    REQUIRE(slots.size() == 2 * points.size());
    for (std::size_t p = 0; p < points.size(); ++p) {
      bool truth[2] = {false, false};
      traits::for_each_observation(map, points[p], [&](turbomap::map_keyframe_id k, std::size_t i) {
        if (k == target) truth[map.keypoints(k)[i].camera] = true;
      });
      for (std::size_t c = 0; c < 2; ++c) {
        CHECK((lists[c * points.size() + p] != 0) == truth[c]);
        CHECK((slots[c * points.size() + p] != 0) == truth[c]);
      }
      seen += truth[0] || truth[1] ? 1 : 0, by_both_cameras += truth[0] && truth[1] ? 1 : 0;
    }
  }
  CHECK(faults.size() > 5);
  CHECK(seen > 100);
  CHECK(by_both_cameras > 10);

  const auto gone = run.keyframes()[1];
  turbomap::erase_keyframe(map, gone);
  by_slots.clear();
  for (const auto k : run.keyframes())
    if (map.alive(k)) by_slots.add_points_of(map, k, turbomap::fault_sink(faults));
  by_slots.note_observed_by(map, gone);
  by_slots.mark_observed({2});
  for (const auto skip : by_slots.skip(0)) CHECK(skip == 0);
}

}  // namespace

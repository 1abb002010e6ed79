// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Stages read the map in parts, between which others may take its guard. The map is the same, however long the parts are; and
/// where somebody moves the whole map between two parts, what is computed is of one time: ranges of points fit their distances,
/// fusion finds what it finds otherwise, and only a move after the last part makes an adjustment stale.

#include <thrust/detail/seq.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

#include "local_mapper_cases.hpp"
#include "reference/larger_or_nan.hpp"
#include "scenes/watched_map.hpp"

namespace {

using namespace turbomap_test;
using watched = watched_map<turbomap::binary_descriptor<256>>;
using traits = turbomap::map_traits<watched>;
template <class Map>
using run_of = mapping_run<Map, sequential_policy, turbomap::local_adjustment<Map, sequential_policy>>;
using run_type = run_of<watched>;

constexpr double shift = 64;  // m
constexpr int before = 4;     // keyframes that are mapped undisturbed

mapping_case<pinhole_camera> parted_case(int points_read_per_guard) {
  auto c = stereo_case(noisy(3));
  c.options.points_read_per_guard = points_read_per_guard;
  c.options.adjustment.points_per_guard = 0;  // a commit is stale, or is done
  c.options.adjustment.solve.max_iterations = 3;
  return c;
}

/// By how much a point's range differs from its distance to the keyframe of its reference at most, as a share.
double worst_range(const watched& map, const turbomap::pyramid& scales) {
  double worst = 0;
  std::size_t looked_at = 0;
  traits::for_each_point(map, [&](turbomap::map_point_id p) {
    const auto reference = traits::reference(map, p);
    bool first = true;
    traits::for_each_observation(map, p, [&](turbomap::map_keyframe_id k, std::size_t i) {
      if (!(k == reference) || !first) return;
      first = false;
      const auto centre = to_oracle_pose(traits::pose(map, k)).inverse().t;
      const auto& x = traits::position(map, p);
      const double distance = (centre - Eigen::Vector3d(x.x, x.y, x.z)).norm();
      const double expected = distance * std::pow(scales.scale_factor, traits::keypoint(map, k, i).octave);
      worst = larger_or_nan(worst, std::abs(traits::max_distance(map, p) - expected) / expected);
      ++looked_at;
    });
  });
  CHECK(looked_at > 100);
  return worst;
}

struct outcome {
  int guards = 0;
  bool stale = false;
  std::size_t created = 0, found = 0, merged = 0;
  double worst_range = 0;
  std::vector<Eigen::Vector3d> centres;  ///< of the keyframes, moved back
};

/// The last of five keyframes; somebody moves the whole map before guard `moved_at`, if there is one, and says so.
template <class Map = watched>
outcome last_keyframe(const mapping_case<pinhole_camera>& c, const mapping_scene<pinhole_camera>& scene, int moved_at) {
  run_of<Map> run(scene, c.options);
  run.steps(before);
  const auto k = run.track();
  outcome o;
  run.map.watch.before = [&] {
    if (o.guards++ != moved_at) return;
    move_all(run.map, shift);
    run.mapper.refresh();
  };
  const auto& report = run.mapper.process(k);
  run.map.watch.before = {};
  CHECK(turbomap::validate(run.map).empty());
  CHECK(report.refused.empty());
  o.stale = report.adjustment.stale, o.created = report.points_created;
  o.found = report.fused.entries, o.merged = report.fused.merged;
  o.worst_range = worst_range(run.map, c.recipe.scales);
  traits::for_each_keyframe(run.map, [&](turbomap::map_keyframe_id i) {
    const Eigen::Vector3d back(moved_at < 0 ? 0 : shift, 0, 0);
    o.centres.push_back(to_oracle_pose(traits::pose(run.map, i)).inverse().t - back);
  });
  return o;
}

TEST_CASE_TEMPLATE("the same map, however long the parts are", Map, watched, mirrored_watched_map) {
  const auto whole = parted_case(0);
  const mapping_scene<pinhole_camera> scene(whole.rig, whole.recipe);
  run_of<Map> expected(scene, whole.options);
  expected.steps(before + 2);
  const long held = expected.map.watch.taken;
  for (const int most : {1, 50, 100000}) {
    run_of<Map> run(scene, parted_case(most).options);
    run.steps(before + 2);
    CHECK(content(run.map) == content(expected.map));
    CHECK((run.map.watch.taken > held) == (most < 100000));
  }
}

TEST_CASE_TEMPLATE("the time of a stage has all in it for which it held the guard", Map, watched,
                   mirrored_watched_map) {
  const auto c = parted_case(50);
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  run_of<Map> run(scene, c.options);
  for (int n = 0; n < before + 2; ++n) {
    const auto& report = run.step();
    for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) {
      CAPTURE(std::string(turbomap::to_string(static_cast<turbomap::mapping_stage>(s))));
      CHECK(report.ms.values[s] + 1e-6 >= report.held.values[s].total_ms);
    }
  }
}

TEST_CASE("the whole map is moved between any two parts") {
  const auto c = parted_case(40);
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  const outcome undisturbed = last_keyframe(c, scene, -1);
  CHECK(undisturbed.guards > 60);
  CHECK(undisturbed.found > 10);
  CHECK(undisturbed.worst_range < 1e-5);
  int stale = 0, not_created = 0;
  for (int g = 0; g < undisturbed.guards; ++g) {
    CAPTURE(g);
    const outcome o = last_keyframe(c, scene, g);
    stale += o.stale ? 1 : 0;
    CHECK(o.worst_range < 1e-5);
    if (o.created != undisturbed.created) {  // between the search and its commit
      ++not_created;
      continue;
    }
    CHECK(o.found == undisturbed.found);
    CHECK(o.merged == undisturbed.merged);
  }
  CHECK(stale == 1);
  CHECK(not_created == 1);
}

// What was copied before the move must not be solved with what was moved, nor ranges computed from both.
TEST_CASE("the whole map is moved between any two parts of what reads a copy of it") {
  const auto c = parted_case(40);
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  const outcome undisturbed = last_keyframe<mirrored_watched_map>(c, scene, -1);
  CHECK(undisturbed.guards > 60);
  CHECK(undisturbed.worst_range < 1e-5);
  for (int g = 0; g < undisturbed.guards; ++g) {
    CAPTURE(g);
    const outcome o = last_keyframe<mirrored_watched_map>(c, scene, g);
    CHECK(o.worst_range < 1e-5);
    REQUIRE(o.centres.size() == undisturbed.centres.size());
    for (std::size_t k = 0; k < o.centres.size(); ++k) CHECK((o.centres[k] - undisturbed.centres[k]).norm() < 0.1);
  }
}

TEST_CASE("a part has a size") {
  const auto c = parted_case(-1);
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  CHECK_THROWS_AS(run_type(scene, c.options), std::invalid_argument);
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Why points had to be merged: one merge of each cause, by hand.

#include "replay/merge_causes.hpp"

#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>

#include <utility>
#include <vector>

#include <doctest/doctest.h>

namespace {

using map_type = turbomap::simple_map<turbomap::binary_descriptor<256>, turbomap::pinhole<float>>;
using keyframe = turbomap::map_traits<map_type>::keyframe;
using point = turbomap::map_traits<map_type>::point;
using turbomap::mapping_stage;

/// Four keyframes of four keypoints. Calls search number 0 and 1.
struct scene {
  map_type map{8};
  std::vector<keyframe> k;
  turbomap_replay::merge_causes<map_type> causes;

  scene() {
    const std::vector<turbomap::keypoint> keypoints(4);
    for (int i = 0; i < 4; ++i) k.push_back(map.add_keyframe(keypoints, {}));
  }
  /// A point that is seen at these (keyframe, keypoint).
  point add(const std::vector<std::pair<std::size_t, std::size_t>>& views) {
    const point p = map.add_point({}, k[views[0].first]);
    for (const auto& v : views) REQUIRE(turbomap::observe(map, p, k[v.first], v.second));
    return p;
  }
  void created() { causes.stage_done(map, mapping_stage::creation, std::vector<keyframe>{k[0], k[1]}); }
  turbomap_replay::merge_counts merge(point from, point into) {
    std::vector<std::pair<keyframe, std::size_t>> scratch;
    REQUIRE(turbomap::merge_points(map, from, into, turbomap::merge_rule::drop, scratch));
    causes.stage_done(map, mapping_stage::fusion, std::vector<keyframe>{});
    return causes.counts();
  }
};

}  // namespace

TEST_CASE("merges of tracking's points") {
  scene s;
  const point a = s.add({{2, 0}}), b = s.add({{3, 0}});
  s.causes.begin(s.map);
  s.created();
  CHECK(s.merge(a, b).by_tracking == 1);
  const point old = s.add({{0, 1}, {1, 1}});
  s.created();
  const point late = s.add({{2, 2}});
  s.causes.begin(s.map);
  s.created();
  const auto counts = s.merge(old, late);
  CHECK(counts.beside_mapping == 1);
  CHECK(counts.all() == 2);
}

TEST_CASE("merges of points that one call made") {
  scene s;
  s.causes.begin(s.map);
  const point a = s.add({{0, 0}, {1, 0}}), b = s.add({{0, 1}, {1, 1}});
  s.created();
  const auto counts = s.merge(a, b);
  CHECK(counts.same_call == 1);
  CHECK(counts.all() == 1);
}

TEST_CASE("merges with an older point: where the call saw it") {
  scene s;
  // Beside the younger one's keypoint, at a keypoint of another image of the call, in no image of it.
  const point apart = s.add({{1, 0}, {2, 0}}), mapped = s.add({{1, 2}, {2, 1}}), away = s.add({{2, 2}, {3, 2}});
  s.causes.begin(s.map);
  const point y1 = s.add({{0, 0}, {1, 1}}), y2 = s.add({{0, 1}, {3, 1}}), y3 = s.add({{0, 2}, {1, 3}});
  s.created();
  CHECK(s.merge(y1, apart).seen_apart == 1);
  s.created();
  CHECK(s.merge(mapped, y2).at_mapped == 1);
  s.created();
  const auto counts = s.merge(y3, away);
  CHECK(counts.out_of_reach == 1);
  CHECK(counts.all() == 3);
}

TEST_CASE("a point is looked for under the names of those that became it") {
  scene s;
  const point lost = s.add({{1, 0}}), old = s.add({{2, 0}, {3, 0}});
  s.causes.begin(s.map);
  const point young = s.add({{0, 0}, {3, 1}});
  s.created();
  s.merge(lost, old);  // both of tracking; `lost` was seen in an image of the call
  s.created();
  const auto counts = s.merge(young, old);
  CHECK(counts.at_mapped == 1);
  CHECK(counts.out_of_reach == 0);
}

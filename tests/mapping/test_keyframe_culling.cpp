// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Culling of keyframes: counts by definition, removals in order, guards in time. Random edits in between are in
/// test_map_properties.cpp.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/keyframe_culling.hpp>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

#include "reference/culling_oracle.hpp"
#include "scenes/lying_map.hpp"
#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"

namespace {

using namespace turbomap_test;
using turbomap::culling_verdict;
using turbomap::keyframe_culling_options;

template <class Map>
struct culling {
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  Map map;
  std::vector<keyframe> k;
  std::vector<point> p;
  std::vector<turbomap::culling_record<keyframe>> records;
  std::vector<point> touched;

  void add(const std::vector<turbomap::keypoint>& keypoints, double time_s = 0) {
    k.push_back(insert_keyframe(map, keypoints, time_s, k.empty() ? keyframe{} : k.back()));
  }
  void run(std::size_t current, const std::vector<std::size_t>& candidates, const keyframe_culling_options& options) {
    std::vector<keyframe> names;
    for (const std::size_t i : candidates) names.push_back(k[i]);
    records.clear(), touched.clear();
    turbomap::cull_keyframes(map, k[current], turbomap::span<const keyframe>(names), options, records, &touched);
    CHECK(records.size() == candidates.size());
  }
  std::vector<culling_verdict> verdicts() const {
    std::vector<culling_verdict> all;
    for (const auto& r : records) all.push_back(r.verdict);
    return all;
  }
};

constexpr auto needed = culling_verdict::needed;
constexpr auto erased = culling_verdict::erased;
constexpr auto kept = culling_verdict::protected_;
using verdicts = std::vector<culling_verdict>;

TEST_CASE_TEMPLATE("redundant: more than three others, no coarser than one octave above its own", Map, flat_map,
                   pointer_map) {
  culling<Map> c;
  using traits = turbomap::map_traits<Map>;
  // Keyframe 0 sees the point at octave 2; 1 to 5 at 3, 3, 0, 3 and 4.
  for (const int octave : {2, 3, 3, 0, 3, 4}) c.add({make_keypoint(octave)});
  c.p.push_back(traits::add_point(c.map, {}, c.k[0]));
  std::vector<typename traits::keyframe> scratch;
  const keyframe_culling_options o;
  const auto count = [&](std::size_t i) { return turbomap::count_redundant(c.map, c.k[i], o, scratch); };
  CHECK(count(0).points == 0);
  for (std::size_t i = 0; i < 4; ++i) turbomap::observe(c.map, c.p[0], c.k[i], 0);
  turbomap::observe(c.map, c.p[0], c.k[5], 0);
  CHECK(count(0).points == 1);
  CHECK(count(0).redundant == 0);  // three others; the fourth is too coarse
  CHECK(count(1).redundant == 1);  // 0, 2, 3 and 5
  turbomap::observe(c.map, c.p[0], c.k[4], 0);
  CHECK(count(0).redundant == 1);
  CHECK(count(3).redundant == 0);  // nobody at octaves 0 and 1
  auto two = o;
  two.observers = 2;
  turbomap::forget(c.map, c.k[4], 0);
  CHECK(turbomap::count_redundant(c.map, c.k[0], two, scratch).redundant == 1);
}

TEST_CASE("only points in reach count, where the depth matters; NaN is not in reach") {
  culling<flat_map> c;
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> depths{-1, 0, 5, 5.001F, nan};
  std::vector<turbomap::keypoint> keypoints;
  for (const float depth : depths) keypoints.push_back(make_keypoint(0, 0, -1, depth));
  c.add(keypoints);
  for (std::size_t i = 0; i < depths.size(); ++i) {
    c.p.push_back(c.map.add_point({}));
    turbomap::observe(c.map, c.p[i], c.k[0], i);
  }
  std::vector<turbomap::map_keyframe_id> scratch;
  keyframe_culling_options o;
  CHECK(turbomap::count_redundant(c.map, c.k[0], o, scratch).points == 5);
  o.max_depth = 5;
  CHECK(turbomap::count_redundant(c.map, c.k[0], o, scratch).points == 2);
}

TEST_CASE("the share is a product in float, and must be passed") {
  keyframe_culling_options o;
  CHECK_FALSE(turbomap::is_redundant({0, 0}, o));
  CHECK_FALSE(turbomap::is_redundant({10, 9}, o));  // 0.9F * 10 is 9 in float, 8.9999998 in double
  CHECK(turbomap::is_redundant({10, 10}, o));
  CHECK(turbomap::is_redundant({100, 91}, o));
  CHECK_FALSE(turbomap::is_redundant({100, 90}, o));
  o.redundant_share = 0;
  CHECK_FALSE(turbomap::is_redundant({10, 0}, o));
  CHECK(turbomap::is_redundant({10, 1}, o));
}

TEST_CASE_TEMPLATE("each removal is seen by the next count; points die with it", Map, flat_map, pointer_map) {
  culling<Map> c;
  using traits = turbomap::map_traits<Map>;
  // Six keyframes see the same 100 points: two may go, then three others are left. Point 100 is of keyframes 1 and 5.
  for (int i = 0; i < 6; ++i) c.add(std::vector<turbomap::keypoint>(200, make_keypoint(1)));
  for (std::size_t j = 0; j < 100; ++j) {
    c.p.push_back(traits::add_point(c.map, {}, c.k[0]));
    for (const auto k : c.k) turbomap::observe(c.map, c.p[j], k, j);
  }
  c.p.push_back(traits::add_point(c.map, {}, c.k[1]));
  turbomap::observe(c.map, c.p[100], c.k[1], 150), turbomap::observe(c.map, c.p[100], c.k[5], 150);
  constexpr bool first_stays = turbomap::detail::map_has_v<Map, turbomap::detail::map_may_erase_member>;
  const keyframe_culling_options o;
  c.run(5, {5, 1, 1, 2, 3, 4}, o);
  CHECK(c.verdicts() == verdicts{kept, erased, kept, erased, needed, needed});
  CHECK(c.records[0].count.points == 0);  // not counted
  CHECK(c.records[1].id == 1);
  CHECK(c.records[1].count.points == 101);
  CHECK(c.records[1].count.redundant == 100);
  CHECK(c.records[3].count.points == 100);
  CHECK(c.records[4].count.redundant == 0);
  CHECK_FALSE(traits::alive(c.map, c.p[100]));
  CHECK(c.touched.size() == 200);  // once a removal
  CHECK(traits::alive(c.map, c.k[3]));
  c.run(5, {0}, o);  // three others see its points, and the first of a simple_map stays
  CHECK(c.verdicts() == verdicts{first_stays ? kept : needed});
  c.run(5, {}, o);
  CHECK(c.records.empty());
}

/// A chain of keyframes 0.1 s apart that all see the same points.
culling<flat_map> chain(int keyframes, double step = 0.1) {
  culling<flat_map> c;
  for (int i = 0; i < keyframes; ++i) c.add({make_keypoint(0)}, step * i);
  const auto p = c.map.add_point({}, c.k[0]);
  for (const auto k : c.k) turbomap::observe(c.map, p, k, 0);
  return c;
}

keyframe_culling_options inertial() {
  keyframe_culling_options o;
  o.redundant_share = 0.5F;
  o.temporal_guards = true;
  return o;
}

TEST_CASE_TEMPLATE("a counter that is used again counts as one look does", Map, flat_map, pointer_map) {
  std::mt19937 random(5);
  turbomap::redundancy_counter<Map> counter;
  std::vector<typename turbomap::map_traits<Map>::keyframe> scratch;
  for (int maps = 0; maps < 4; ++maps) {
    culling<Map> c;
    for (std::uint32_t i = 0; i < 12; ++i)
      c.add(random_keypoints(static_cast<std::uint32_t>(random()), 2, 5, 60 + 10 * static_cast<int>(random() % 3)));
    for (int i = 0; i < 60; ++i) {
      c.p.push_back(turbomap::map_traits<Map>::add_point(c.map, {}, c.k[0]));
      for (int n = 0; n < 12; ++n) turbomap::observe(c.map, c.p.back(), c.k[random() % 12], random() % 120);
    }
    for (int round = 0; round < 12; ++round) {
      keyframe_culling_options o;
      o.max_depth = round % 6 < 3 ? 5.F : 0.F;
      o.observers = round % 4;
      for (int edit = 0; edit < 20; ++edit) turbomap::forget(c.map, c.k[random() % 12], random() % 120);
      counter.clear();
      for (int n = 0; n < 30; ++n) {
        const auto k = c.k[random() % 12];
        if (n % 7 == 0) counter.forget(c.map, k);
        const auto a = counter(c.map, k, o), b = turbomap::count_redundant(c.map, k, o, scratch);
        CHECK(a.points == b.points);
        CHECK(a.redundant == b.redundant);
      }
    }
  }
}

/// Keyframes of different keypoints, in a store whose places are used again and again: the counter remembers keypoints by handles.
TEST_CASE("a counter that remembers keypoints counts as one look does") {
  std::mt19937 random(6);
  turbomap::redundancy_counter<flat_map> counter;
  std::vector<turbomap::map_keyframe_id> scratch;
  std::uint32_t generation = 0;
  for (int maps = 0; maps < 4; ++maps) {
    culling<flat_map> c;
    for (std::uint32_t i = 0; i < 12; ++i)
      c.add(random_keypoints(static_cast<std::uint32_t>(random()), 2, 5, 60 + 10 * static_cast<int>(random() % 3)));
    for (int i = 0; i < 60; ++i) {
      c.p.push_back(c.map.add_point({}, c.k[0]));
      for (int n = 0; n < 12; ++n) turbomap::observe(c.map, c.p.back(), c.k[random() % 12], random() % 120);
    }
    turbomap::handle_table stored;
    counter.clear();
    counter.remember_by(&stored);
    for (int n = 0; n < 600; ++n) {
      const auto k = c.k[random() % 12];
      const auto id = turbomap::map_traits<flat_map>::id(c.map, k);
      // It leaves the store, and comes again: at the place of another one, or at its own.
      if (n % 5 == 0) {
        if (random() % 2 == 0) counter.drop_keypoints(id);
        stored.erase(id);
      } else if (!stored.contains(id)) {
        stored.add(id, {static_cast<std::uint32_t>(random() % 4), ++generation});
      }
      keyframe_culling_options o;
      o.max_depth = n % 100 < 50 ? 5.F : n % 100 < 70 ? 3.F : 0.F;
      if (n % 50 == 0) turbomap::forget(c.map, c.k[random() % 12], random() % 120), counter.clear();
      const auto a = counter(c.map, k, o), b = turbomap::count_redundant(c.map, k, o, scratch);
      CHECK(a.points == b.points);
      CHECK(a.redundant == b.redundant);
    }
    counter.remember_by(nullptr);
  }
}

TEST_CASE("what a counter knows may keep a keyframe, but take none out") {
  culling<flat_map> c;
  for (int i = 0; i < 6; ++i) c.add({make_keypoint(0), make_keypoint(0)});
  const auto p = c.map.add_point({}, c.k[0]);
  for (std::size_t i = 0; i < 5; ++i) turbomap::observe(c.map, p, c.k[i], 0);
  const keyframe_culling_options o;
  turbomap::redundancy_counter<flat_map> counter;
  const auto run = [&] {
    c.records.clear();
    turbomap::cull_keyframes(c.map, c.k[5], turbomap::span<const turbomap::map_keyframe_id>(&c.k[1], 1), o, c.records,
                             nullptr, turbomap::ignore_keyframe(), {}, counter);
  };
  CHECK(counter(c.map, c.k[1], o).redundant == 1);
  turbomap::forget(c.map, c.k[4], 0);  // by somebody else
  CHECK(counter(c.map, c.k[1], o).redundant == 1);
  run();
  CHECK(c.verdicts() == verdicts{needed});
  CHECK(c.records[0].count.redundant == 0);

  turbomap::observe(c.map, p, c.k[4], 0);
  run();
  CHECK(c.verdicts() == verdicts{needed});
  counter.clear();
  run();
  CHECK(c.verdicts() == verdicts{erased});
}

TEST_CASE("guards in time: enough keyframes, not the last ones, no gap") {
  const auto o = inertial();
  {
    auto c = chain(22);
    c.run(21, {10, 11, 12}, o);  // one of 22 may go, then 21 are left
    CHECK(c.verdicts() == verdicts{erased, needed, needed});
  }
  {
    auto c = chain(21);
    c.run(20, {10}, o);
    CHECK(c.verdicts() == verdicts{needed});
    CHECK(c.records[0].count.redundant == 1);  // it was redundant
  }
  {
    auto c = chain(40);
    c.run(39, {38, 37, 36}, o);  // the current one and two before it stay
    CHECK(c.verdicts() == verdicts{needed, needed, erased});
  }
  {
    auto c = chain(60);
    c.run(30, {31, 59, 29, 28, 27}, o);  // newer ones than the current one stay
    CHECK(c.verdicts() == verdicts{needed, needed, needed, needed, erased});
  }
  {
    auto c = chain(40);
    // Gaps of 0.2, 0.3, 0.4 and 0.5 s: the last is too much.
    c.run(39, {30, 31, 32, 33}, o);
    CHECK(c.verdicts() == verdicts{erased, erased, erased, needed});
  }
  {
    auto c = chain(40);  // older than 21 keyframes: up to 3 s
    c.run(39, {5, 6, 7, 8, 9, 10, 11}, o);
    CHECK(c.verdicts() == verdicts(7, erased));
    auto young = inertial();
    young.inertial_initialised = false;
    auto d = chain(40);
    d.run(39, {5, 6, 7, 8, 9}, young);
    CHECK(d.verdicts() == verdicts{erased, erased, erased, needed, erased});
  }
  {
    auto c = chain(60, 1.6);
    c.run(59, {10, 30}, o);  // 3.2 s
    CHECK(c.verdicts() == verdicts{needed, needed});
    auto d = chain(60, 1.4);
    d.run(59, {10, 37, 38, 39}, o);  // 38 is the 21st predecessor: older ones may leave 2.8 s. After 37 goes, 36 is...
    CHECK(d.verdicts() == verdicts{erased, erased, needed, needed});
  }
  {
    auto c = chain(40);
    turbomap::rigid_transform<double> T;
    const auto alone = c.map.add_keyframe(std::vector<turbomap::keypoint>{make_keypoint(0)}, T, 9);  // no chain
    turbomap::observe(c.map, c.map.point_at(c.k[0], 0), alone, 0);
    c.k.push_back(alone);
    c.run(39, {40}, o);
    CHECK(c.verdicts() == verdicts{needed});
  }
}

TEST_CASE("the first and the last keyframe of an older chain stay: nothing would bridge the gap") {
  culling<flat_map> c;
  for (int i = 0; i < 3; ++i) c.add({make_keypoint(0)}, 0.1 * i);
  const std::vector<turbomap::keypoint> one{make_keypoint(0)};
  c.k.push_back(c.map.add_keyframe(one, {}, 10));  // a second chain
  for (int i = 1; i < 40; ++i) c.add(one, 10 + 0.1 * i);
  const auto p = c.map.add_point({}, c.k[0]);
  for (const auto k : c.k) turbomap::observe(c.map, p, k, 0);
  c.run(42, {2, 3, 1}, inertial());
  CHECK(c.verdicts() == verdicts{needed, needed, erased});
}

TEST_CASE("guards need a map that knows time") {
  culling<pointer_map> c;
  c.add({make_keypoint(0)});
  std::vector<turbomap::culling_record<pointer_keyframe*>> records;
  CHECK_THROWS_AS(turbomap::cull_keyframes(c.map, c.k[0], {}, inertial(), records), std::invalid_argument);
}

TEST_CASE("bad options are refused") {
  culling<flat_map> c = chain(9);
  const auto before = everything(c.map);
  const auto refuses = [&](auto change) {
    keyframe_culling_options o;
    change(o);
    std::vector<turbomap::culling_record<turbomap::map_keyframe_id>> records;
    CHECK_THROWS_AS(
        turbomap::cull_keyframes(c.map, c.k[8], turbomap::span<const turbomap::map_keyframe_id>(c.k), o, records),
        std::invalid_argument);
    CHECK(records.empty());
    CHECK(everything(c.map) == before);
  };
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  refuses([](auto& o) { o.redundant_share = -0.1F; });
  refuses([](auto& o) { o.redundant_share = 1.1F; });
  refuses([](auto& o) { o.redundant_share = nan; });
  refuses([](auto& o) { o.observers = -1; });
  refuses([](auto& o) { o.octave_slack = -1; });
  refuses([](auto& o) { o.octave_slack = std::numeric_limits<int>::max(); });
  refuses([](auto& o) { o.max_depth = -1; });
  refuses([](auto& o) { o.max_depth = nan; });
  refuses([](auto& o) { o.keep_keyframes = -1; });
  refuses([](auto& o) { o.keep_last = -1; });
  refuses([](auto& o) { o.max_gap = static_cast<double>(nan); });
  refuses([](auto& o) { o.max_old_gap = -1; });
}

/// Larger maps than those of the property test, more like real ones: keyframes in a row, points seen by runs of them.
template <class Map>
void check_random(std::uint32_t seed) {
  std::mt19937 random(seed);
  culling<Map> c;
  using traits = turbomap::map_traits<Map>;
  map_oracle oracle;
  const int cameras = 1 << (seed % 3);
  constexpr std::size_t keyframes = 30, points = 150;
  double time_s = 0;
  for (oracle_id i = 0; i < keyframes; ++i) {
    const auto keypoints = random_keypoints(static_cast<std::uint32_t>(random()), cameras, 5, 240 / cameras);
    time_s += 0.05 + 0.01 * static_cast<double>(random() % 20);
    c.add(keypoints, time_s);
    oracle.keyframes[i] = {keypoints, time_s};
  }
  for (oracle_id i = 0; i < points; ++i) {
    const std::size_t first = random() % keyframes, run = 1 + random() % 14;
    c.p.push_back(traits::add_point(c.map, {}, c.k[first]));
    oracle.points[i] = {first, {}};
    for (std::size_t n = 0; n < 2 * run; ++n) {
      const std::size_t at = std::min(first + random() % run, keyframes - 1),
                        which = random() % (240 / static_cast<unsigned>(cameras) * static_cast<unsigned>(cameras));
      CHECK(turbomap::observe(c.map, c.p[i], c.k[at], which) == oracle.observe(i, {at, which}));
    }
  }
  keyframe_culling_options o;
  o.redundant_share = 0.3F + 0.1F * static_cast<float>(random() % 5);
  o.max_depth = random() % 2 == 0 ? 0.F : 5.F;
  oracle_culling_rules rules;
  rules.share = o.redundant_share, rules.max_depth = o.max_depth;
  constexpr bool temporal = turbomap::detail::map_has_v<Map, turbomap::detail::map_temporal_member>;
  rules.first_stays = turbomap::detail::map_has_v<Map, turbomap::detail::map_may_erase_member>;
  if (temporal && seed % 2 == 0) {
    o.temporal_guards = rules.guards = true;
    o.keep_keyframes = rules.keep_keyframes = 12;
  }
  std::vector<std::size_t> candidates;
  for (std::size_t i = 0; i < keyframes; ++i) candidates.push_back(i);
  std::shuffle(candidates.begin(), candidates.end(), random);
  c.run(keyframes - 1, candidates, o);
  std::multiset<oracle_id> survivors;
  const auto expected =
      cull_keyframes_by_definition(oracle, keyframes - 1, {candidates.begin(), candidates.end()}, rules, survivors);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    CHECK(c.records[i].keyframe == c.k[expected[i].keyframe]);
    CHECK(c.records[i].id == expected[i].keyframe);
    CHECK(c.records[i].count.points == expected[i].points);
    CHECK(c.records[i].count.redundant == expected[i].redundant);
    CHECK(c.records[i].verdict == (!expected[i].looked_at ? kept : expected[i].erased ? erased : needed));
  }
  CHECK(c.touched.size() == survivors.size());
  for (oracle_id i = 0; i < points; ++i) CHECK(traits::alive(c.map, c.p[i]) == (oracle.points.count(i) != 0));
  if constexpr (temporal) CHECK(turbomap::validate(c.map).empty());
}

TEST_CASE("random maps against the definition") {
  for (std::uint32_t seed = 0; seed < 60; ++seed) check_random<flat_map>(seed);
  for (std::uint32_t seed = 0; seed < 12; ++seed) check_random<pointer_map>(seed);
}

}  // namespace

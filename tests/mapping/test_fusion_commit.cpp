// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Commits of duplicates: each rule by itself, entries that get in each other's way, random plans against the oracle.
/// Maps that contradict themselves are in test_validate.cpp.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/fusion_commit.hpp>

#include <array>
#include <cstdint>
#include <limits>
#include <random>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "reference/fusion_commit_oracle.hpp"
#include "scenes/failing_map.hpp"
#include "scenes/lying_map.hpp"
#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"

namespace {

using namespace turbomap_test;
using turbomap::fusion_action;
using turbomap::merge_rule;
using actions = std::vector<fusion_action>;
using entry = turbomap::duplicate<std::int32_t>;

constexpr auto added = fusion_action::observation_added;
constexpr auto candidate_replaced = fusion_action::candidate_replaced;
constexpr auto keypoint_replaced = fusion_action::keypoint_replaced;
constexpr auto stale = fusion_action::stale;
constexpr auto already = fusion_action::already_observed;
constexpr auto conflict = fusion_action::conflict;

/// Keyframes of two cameras with four keypoints each, points without observations, and plans by (keyframe, point,
/// keypoint).
template <class Map>
struct fusion {
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  Map map;
  std::vector<keyframe> k;
  std::vector<point> p;
  turbomap::fusion_commit<Map> commit;
  turbomap::fusion_summary summary;

  fusion(std::size_t keyframes, std::size_t points) {
    std::vector<turbomap::keypoint> rig;
    for (int i = 0; i < 8; ++i) rig.push_back(make_keypoint(i % 3, i / 4));
    for (std::size_t i = 0; i < keyframes; ++i) k.push_back(insert_keyframe(map, rig, 0, keyframe{}));
    for (std::size_t i = 0; i < points; ++i) p.push_back(traits::add_point(map, {}, k[0]));
  }
  void see(std::size_t point, std::size_t keyframe, std::size_t i) {
    REQUIRE(turbomap::observe(map, p[point], k[keyframe], i));
  }
  actions run(const std::vector<std::array<std::int32_t, 3>>& plan, merge_rule rule = merge_rule::refuse) {
    std::vector<entry> entries;
    for (const auto& e : plan) entries.push_back({e[0], e[2] / 4, e[1], e[2], 20});
    turbomap::fusion_commit_options o;
    o.merges = rule;
    summary = commit(map, turbomap::span<const entry>(entries), turbomap::span<const keyframe>(k),
                     turbomap::span<const point>(p), o);
    CHECK(summary.entries == plan.size());
    return commit.actions();
  }
  point at(std::size_t keyframe, std::size_t i) const { return traits::point_at(map, k[keyframe], i); }
};

TEST_CASE("who survives") {
  CHECK(turbomap::fusion_decision(0, -1) == added);
  CHECK(turbomap::fusion_decision(3, 3) == keypoint_replaced);
  CHECK(turbomap::fusion_decision(4, 3) == keypoint_replaced);
  CHECK(turbomap::fusion_decision(3, 4) == candidate_replaced);
  CHECK(turbomap::fusion_decision(0, 0) == keypoint_replaced);
  // The numbers of the recordings.
  CHECK(static_cast<int>(added) == 1);
  CHECK(static_cast<int>(candidate_replaced) == 2);
  CHECK(static_cast<int>(keypoint_replaced) == 3);
}

TEST_CASE_TEMPLATE("each rule by itself", Map, flat_map, pointer_map) {
  fusion<Map> f(4, 4);
  using traits = turbomap::map_traits<Map>;
  f.see(0, 0, 0), f.see(1, 1, 1), f.see(1, 2, 1), f.see(2, 3, 2), f.see(3, 3, 6);
  CHECK(f.run({}).empty());
  CHECK(f.run({{3, 0, 0}}) == actions{added});
  CHECK(f.at(3, 0) == f.p[0]);
  CHECK(f.run({{3, 0, 0}, {3, 0, 1}, {3, 0, 2}}) == actions{already, already, already});
  CHECK(f.commit.touched() == std::vector<typename traits::point>{f.p[0]});
  CHECK(f.commit.survivors().empty());
  CHECK(f.run({{3, 0, 4}}) == actions{added});               // the other camera
  CHECK(f.run({{1, 2, 1}}) == actions{candidate_replaced});  // 1 has two views, 2 has one
  CHECK(traits::replacement(f.map, f.p[2]) == f.p[1]);
  CHECK(f.at(3, 2) == f.p[1]);
  CHECK(f.summary.merged == 1);
  CHECK(f.run({{0, 1, 0}}) == actions{conflict});  // keyframe 3 sees 0 and 1 at keypoints 0 and 2
  CHECK(f.summary.conflicts == 1);
  CHECK(f.run({{3, 1, 6}}) == actions{keypoint_replaced});  // 3 goes
  CHECK(f.at(3, 6) == f.p[1]);
  CHECK(f.run({{0, 2, 3}}) == actions{added});  // 2 is 1 by now
  CHECK(f.at(0, 3) == f.p[1]);
  CHECK(f.commit.survivors() == std::vector<typename traits::point>{f.p[1], f.p[1]});
  f.commit.clear();
  CHECK(f.commit.touched().empty());
  turbomap::erase_point(f.map, f.p[1]);
  turbomap::erase_keyframe(f.map, f.k[2]);
  CHECK(f.run({{0, 1, 0}, {0, 2, 0}, {2, 0, 1}, {2, 0, 1000}}) == actions(4, stale));
  CHECK(f.summary.stale == 4);
  CHECK(f.commit.touched().empty());
}

TEST_CASE_TEMPLATE("equal measurements: the point that was searched for survives; a stereo view weighs two", Map,
                   flat_map, pointer_map) {
  fusion<Map> f(3, 4);
  f.see(0, 0, 0), f.see(1, 1, 1);
  CHECK(f.run({{1, 0, 1}}) == actions{keypoint_replaced});
  CHECK(f.at(1, 1) == f.p[0]);
  auto stereo = insert_keyframe(f.map, {make_keypoint(0, 0, 9.F)}, 0, typename fusion<Map>::keyframe{});
  f.k.push_back(stereo);
  f.see(2, 3, 0), f.see(3, 2, 2);
  CHECK(f.run({{3, 3, 0}}) == actions{candidate_replaced});
  CHECK(f.at(2, 2) == f.p[2]);
}

TEST_CASE_TEMPLATE("A into B while C claims the same keypoint: all are one, in any order of the plan", Map, flat_map,
                   pointer_map) {
  std::vector<std::array<std::int32_t, 3>> plan{{0, 0, 0}, {0, 2, 0}, {1, 0, 1}, {2, 2, 2}};
  std::sort(plan.begin(), plan.end());
  do {
    fusion<Map> f(6, 3);
    using traits = turbomap::map_traits<Map>;
    f.see(1, 0, 0), f.see(1, 1, 1), f.see(0, 3, 0), f.see(2, 4, 0), f.see(2, 5, 0);  // B is at the keypoint
    f.run(plan);
    int alive = 0;
    for (const auto p : f.p) alive += traits::alive(f.map, p) ? 1 : 0;
    CHECK(alive == 1);
    const auto one = turbomap::resolve(f.map, f.p[0]);
    CHECK(turbomap::resolve(f.map, f.p[1]) == one);
    CHECK(turbomap::resolve(f.map, f.p[2]) == one);
    for (const auto& [k, i] : {std::pair(0, 0), std::pair(1, 1), std::pair(3, 0), std::pair(4, 0), std::pair(5, 0)})
      CHECK(f.at(static_cast<std::size_t>(k), static_cast<std::size_t>(i)) == one);
  } while (std::next_permutation(plan.begin(), plan.end()));
}

TEST_CASE_TEMPLATE("a free keypoint that two points claim: the second is compared with the first", Map, flat_map,
                   pointer_map) {
  fusion<Map> f(4, 3);
  f.see(0, 1, 0), f.see(1, 2, 0), f.see(2, 1, 1);
  CHECK(f.run({{0, 0, 0}, {0, 1, 0}, {0, 2, 0}}) == actions{added, candidate_replaced, conflict});
  CHECK(f.at(0, 0) == f.p[0]);  // two measurements by then
  CHECK(f.at(2, 0) == f.p[0]);
  CHECK(f.at(1, 1) == f.p[2]);  // seen beside 0 by keyframe 1
  CHECK(f.summary.observations_added == 1);
  CHECK(f.summary.merged == 1);
  turbomap::fusion_summary sum = f.summary;
  sum += f.summary;
  CHECK(sum.entries == 6);
  CHECK(sum.conflicts == 2);
  CHECK(sum.observations_added == 2);
  CHECK(sum.merged == 2);
}

TEST_CASE_TEMPLATE("both cameras of a rig get the same treatment", Map, flat_map, pointer_map) {
  fusion<Map> f(3, 2);
  f.see(0, 1, 0), f.see(1, 0, 5), f.see(1, 2, 5);
  // Camera 1 holds 1; after the first entry 0 is 1, and camera 0 sees it by the second.
  CHECK(f.run({{0, 0, 5}, {0, 0, 2}, {0, 1, 3}, {0, 1, 6}}) == actions{candidate_replaced, added, already, already});
  CHECK(f.at(0, 2) == f.p[1]);
  CHECK(f.at(0, 5) == f.p[1]);
}

TEST_CASE_TEMPLATE("two points that a camera sees apart: refused, or the keypoint of the one that goes is left empty",
                   Map, flat_map, pointer_map) {
  for (const auto rule : {merge_rule::refuse, merge_rule::drop}) {
    fusion<Map> f(4, 2);
    using traits = turbomap::map_traits<Map>;
    f.see(0, 0, 0), f.see(0, 1, 0), f.see(0, 2, 0), f.see(1, 0, 1), f.see(1, 3, 1);
    const auto done = f.run({{3, 0, 1}}, rule);
    if (rule == merge_rule::refuse) {
      CHECK(done == actions{conflict});
      CHECK(f.at(0, 1) == f.p[1]);
      CHECK(f.at(3, 1) == f.p[1]);
    } else {
      CHECK(done == actions{keypoint_replaced});
      CHECK(f.at(0, 1) == typename traits::point{});
      CHECK(f.at(0, 0) == f.p[0]);
      CHECK(f.at(3, 1) == f.p[0]);
    }
  }
}

TEST_CASE("keypoints that are as near as their noise may be one") {
  // Octaves 0 and 2: 5.991 (1 + 1.2^4) = 18.41 px^2.
  for (const float distance : {4.2F, 4.4F, std::numeric_limits<float>::quiet_NaN()}) {
    fusion<flat_map> f(1, 2);
    std::vector<turbomap::keypoint> near{make_keypoint(0), make_keypoint(2)};
    near[1].y = distance;
    for (int i = 0; i < 2; ++i) f.k.push_back(f.map.add_keyframe(near, {}));
    f.see(0, 1, 0), f.see(1, 1, 1), f.see(1, 2, 1);
    CHECK(turbomap::seen_apart(f.map, f.p[0], f.p[1]));
    CHECK(f.run({{2, 0, 1}}, merge_rule::refuse) == actions{conflict});
    const bool one = distance < 4.3F;
    CHECK(f.run({{2, 0, 1}}, merge_rule::refuse_apart) == actions{one ? candidate_replaced : conflict});
    CHECK(f.map.alive(f.p[0]) == !one);
    CHECK(f.at(1, 0) == (one ? turbomap::map_point_id{} : f.p[0]));
  }
}

TEST_CASE("points that are known to lie apart are not one") {
  using traits = turbomap::map_traits<flat_map>;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  // 0.1 m apart along x, 1 m along z, where a variance is 100 times as large.
  const auto fuse = [&](float sigma_a, float sigma_b, merge_rule rule, double chi2 = 16.27) {
    fusion<flat_map> f(3, 2);
    f.see(0, 0, 0), f.see(0, 1, 0), f.see(1, 2, 0);
    traits::set_position(f.map, f.p[0], {1, 2, 5}), traits::set_position(f.map, f.p[1], {1.1, 2, 6});
    const auto known = [](float s) { return turbomap::point_covariance{s * s, 0, s * s, 0, 0, s * 100 * s}; };
    traits::set_covariance(f.map, f.p[0], known(sigma_a)), traits::set_covariance(f.map, f.p[1], known(sigma_b));
    turbomap::merge_tolerance tolerance;
    tolerance.position_chi2 = chi2;
    std::vector<std::pair<turbomap::map_keyframe_id, std::size_t>> scratch;
    return turbomap::merge_points(f.map, f.p[1], f.p[0], rule, scratch, tolerance);
  };
  const auto apart = merge_rule::refuse_apart;
  // (0.01 + 1 / 100) / (2 sigma^2) is 16.27 at sigma = 0.02479.
  CHECK(fuse(0.0249F, 0.0249F, apart));
  CHECK_FALSE(fuse(0.0247F, 0.0247F, apart));
  CHECK(fuse(0.05F, 0.001F, apart));  // one that is known badly may be the other
  CHECK_FALSE(fuse(0.03F, 0.001F, apart));
  CHECK(fuse(0.001F, 0.001F, apart, 0));
  CHECK(fuse(0.001F, 0.001F, merge_rule::drop));
  CHECK(fuse(0.001F, 0.001F, merge_rule::refuse));  // of keypoints only
  CHECK(fuse(0, 0.001F, apart));                    // nobody knows
  CHECK(fuse(nan, 0.001F, apart));
}

TEST_CASE("bad plans and options are refused with the map as it was") {
  fusion<flat_map> f(2, 2);
  f.see(0, 0, 0);
  const auto before = everything(f.map);
  constexpr std::int32_t most = std::numeric_limits<std::int32_t>::max();
  for (const std::array<std::int32_t, 3> bad :
       {std::array{-1, 0, 0}, std::array{2, 0, 0}, std::array{most, 0, 0}, std::array{0, -1, 0}, std::array{0, 2, 0},
        std::array{0, 0, -1}, std::array{0, 0, 8}, std::array{1, 1, most}})
    CHECK_THROWS_AS(f.run({{1, 0, 1}, {1, 1, 2}, bad}), std::invalid_argument);  // the first two are sound
  turbomap::fusion_commit_options o;
  const auto refuses = [&] {
    CHECK_THROWS_AS(f.commit(f.map, turbomap::span<const entry>(), turbomap::span<const turbomap::map_keyframe_id>(),
                             turbomap::span<const turbomap::map_point_id>(), o),
                    std::invalid_argument);
    o = {};
  };
  o.tolerance.chi2 = -1, refuses();
  o.tolerance.chi2 = std::numeric_limits<double>::quiet_NaN(), refuses();
  o.tolerance.scale_factor = 0.9F, refuses();
  o.tolerance.position_chi2 = -1, refuses();
  CHECK(everything(f.map) == before);
  CHECK(f.commit.touched().empty());
  CHECK_THROWS_WITH_AS(f.run({{0, 0, 8}}), "turbomap: plan[].keypoint = 8: is not a keypoint of the target",
                       std::invalid_argument);
  CHECK(f.run({{1, 0, 1}}) == actions{added});  // as good as new
}

TEST_CASE("what was applied before the traits threw is counted, of that call only") {
  fusion<failing_map> f(3, 3);
  f.see(0, 0, 0);
  f.map.adds_left = 2;
  const std::vector<std::array<std::int32_t, 3>> plan{{0, 0, 1}, {1, 0, 1}, {2, 1, 1}, {1, 2, 2}};  // seen, then added
  CHECK_THROWS_AS(f.run(plan), broken_write);
  CHECK(f.commit.done().entries == 3);
  CHECK(f.commit.done().already_observed == 1);
  CHECK(f.commit.done().observations_added == 2);
  CHECK(f.commit.touched().size() == 2);
  CHECK_THROWS_AS(f.run({{3, 0, 0}}), std::invalid_argument);
  CHECK(f.commit.done().entries == 0);
  f.map.adds_left = 1;
  CHECK(f.run(plan) == actions{already, already, already, added});
  CHECK(f.commit.done().entries == f.summary.entries);
  CHECK(f.commit.done().observations_added == 1);
}

/// Large plans on full maps: `points` x `keyframes`, rigs of 1, 2 and 4 cameras.
template <class Map>
void check_random(std::uint32_t seed) {
  std::mt19937 random(seed);
  using traits = turbomap::map_traits<Map>;
  Map map;
  map_oracle oracle;
  std::vector<typename traits::keyframe> k;
  std::vector<typename traits::point> p;
  const int cameras = 1 << (seed % 3);
  constexpr oracle_id keyframes = 8, points = 60;
  for (oracle_id i = 0; i < keyframes; ++i) {
    const auto keypoints = random_keypoints(static_cast<std::uint32_t>(random()), cameras, 8, 40);
    k.push_back(insert_keyframe(map, keypoints, 0, typename traits::keyframe{}));
    oracle.keyframes[i] = {keypoints, 0};
  }
  for (oracle_id i = 0; i < points; ++i) {
    p.push_back(traits::add_point(map, {}, k[0]));
    oracle.points[i] = {oracle_id{0}, {}};
    for (int n = static_cast<int>(random() % 4); n > 0; --n) {
      const oracle_view v{random() % keyframes, random() % (40U * static_cast<unsigned>(cameras))};
      CHECK(turbomap::observe(map, p[i], k[v.first], v.second) == oracle.observe(i, v));
    }
  }
  std::vector<std::pair<typename traits::keyframe, std::size_t>> scratch;
  for (const oracle_id dead : {3U, 17U, 29U}) turbomap::erase_point(map, p[dead]), oracle.erase_point(dead);
  for (oracle_id i = 40; i < 44; ++i)
    CHECK(turbomap::merge_points(map, p[i], p[i + 1], merge_rule::drop, scratch) == oracle.merge(i, i + 1, {true}));
  turbomap::erase_keyframe(map, k[5]), oracle.erase_keyframe(5, 2);
  const merge_rule all_rules[] = {merge_rule::refuse, merge_rule::drop, merge_rule::refuse_apart};
  turbomap::fusion_commit_options o;
  o.merges = all_rules[seed / 3 % 3];
  const bool drop = o.merges == merge_rule::drop, refuse = o.merges == merge_rule::refuse;
  const oracle_merge_rule rule{drop, !drop && !refuse};
  turbomap::fusion_commit<Map> commit;
  std::set<int> kinds;
  for (int round = 0; round < 3; ++round) {
    std::vector<entry> plan;
    std::vector<oracle_entry> expected_plan;
    for (int n = 0; n < 150; ++n) {
      const oracle_id point = random() % points;
      const oracle_view v{random() % keyframes,
                          random() % (random() % 2 == 0 ? 6U : 40U * static_cast<unsigned>(cameras))};
      plan.push_back({static_cast<std::int32_t>(v.first), 0, static_cast<std::int32_t>(point),
                      static_cast<std::int32_t>(v.second), 1});
      expected_plan.push_back({point, v});
    }
    const auto held = oracle.holder;
    commit.clear();
    const auto summary =
        commit(map, turbomap::span<const entry>(plan), turbomap::span<const typename traits::keyframe>(k),
               turbomap::span<const typename traits::point>(p), o);
    const auto expected = commit_duplicates(oracle, expected_plan, rule);
    std::size_t merged = 0, stale_entries = 0, conflicts = 0, seen = 0, new_views = 0;
    for (std::size_t i = 0; i < plan.size(); ++i) {
      const int action = expected.actions[i];
      kinds.insert(action);
      CHECK(static_cast<int>(commit.actions()[i]) == action);
      merged += action == 2 || action == 3 ? 1 : 0, stale_entries += action == 5 ? 1 : 0;
      seen += action == 6 ? 1 : 0, conflicts += action == 7 ? 1 : 0, new_views += action == 1 ? 1 : 0;
    }
    CHECK(summary.merged == merged);
    CHECK(summary.stale == stale_entries);
    CHECK(summary.already_observed == seen);
    CHECK(summary.conflicts == conflicts);
    CHECK(summary.observations_added == new_views);
    for (oracle_id i = 0; i < points; ++i) {
      const auto survivor = oracle.resolve(i);
      CHECK(turbomap::resolve(map, p[i]) == (survivor ? p[*survivor] : typename traits::point{}));
      if (oracle.points.count(i) == 0) continue;
      std::set<oracle_view> views;
      traits::for_each_observation(map, p[i], [&](typename traits::keyframe at, std::size_t which) {
        views.insert({traits::id(map, at), which});
      });
      CHECK(views == oracle.points.at(i).views);
    }
    // No observation is lost: what held a live point holds one.
    for (const auto& [view, unused] : held) {
      const auto now = traits::point_at(map, k[view.first], view.second);
      const bool there = !(now == typename traits::point{}) && traits::alive(map, now);
      if (refuse) CHECK(there);
      CHECK(there == (oracle.holder.count(view) != 0));
    }
  }
  for (const int kind : {1, 2, 3, 5, 6}) CHECK(kinds.count(kind) == 1);
  CHECK((kinds.count(7) == 1) == !drop);
  if constexpr (turbomap::detail::map_has_v<Map, turbomap::detail::map_all_member>)
    CHECK(turbomap::validate(map).empty());
}

TEST_CASE("random plans against the oracle; no observation is lost where merges may be refused") {
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    CAPTURE(seed);
    check_random<flat_map>(seed);
    check_random<pointer_map>(seed);
  }
}

}  // namespace

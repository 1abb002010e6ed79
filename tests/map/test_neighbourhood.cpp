// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Neighbours, fusion targets and covisible keyframes, by hand and on random maps against their definition.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/neighbourhood.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include "reference/map_oracle.hpp"
#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"

namespace turbomap_test {

/// A flat_map whose traits say that the keyframe before the first is another.
struct circular_map : flat_map {
  turbomap::map_keyframe_id before_first;
  mutable int steps_left = 100;  ///< through the circle: who goes on for ever is stopped
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::circular_map> : turbomap::map_traits<turbomap_test::flat_map> {
  static keyframe previous(const turbomap_test::circular_map& m, keyframe k) {
    const auto before = turbomap::map_traits<turbomap_test::flat_map>::previous(m, k);
    if (--m.steps_left < 0) throw std::logic_error("round and round");
    return before == keyframe{} ? m.before_first : before;
  }
};

namespace {

using namespace turbomap_test;
using ids = std::vector<oracle_id>;

/// The covisible keyframes of one, by definition: most shared points first.
ids covisible_by_definition(const map_oracle& map, oracle_id k, int least, std::size_t limit) {
  std::vector<std::pair<int, oracle_id>> all, enough;
  for (const auto& [other, shared] : map.shared(k)) all.push_back({-shared, other});
  std::sort(all.begin(), all.end());
  for (const auto& c : all)
    if (-c.first >= least) enough.push_back(c);
  if (enough.empty() && !all.empty()) enough.push_back(all[0]);
  ids result;
  for (const auto& c : enough)
    if (result.size() < limit) result.push_back(c.second);
  return result;
}
bool contains(const ids& list, oracle_id k) { return std::find(list.begin(), list.end(), k) != list.end(); }
/// Predecessors are the ids below, as far as they live.
void add_predecessors(const map_oracle& map, oracle_id query, int wanted, ids& list) {
  for (auto at = map.keyframes.lower_bound(query); at != map.keyframes.begin();) {
    --at;
    if (list.size() >= static_cast<std::size_t>(wanted)) return;
    if (!contains(list, at->first)) list.push_back(at->first);
  }
}

/// The same keyframes and points in a map and in the oracle. Keyframe i follows keyframe i - 1.
template <class Map>
struct world {
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  Map map;
  map_oracle oracle;
  std::vector<keyframe> k;
  std::vector<typename traits::point> p;

  world(std::size_t keyframes, std::size_t points, int cameras) {
    for (std::size_t i = 0; i < keyframes; ++i) {
      const auto keypoints = random_keypoints(static_cast<std::uint32_t>(i), cameras, 8, 30);
      k.push_back(insert_keyframe(map, keypoints, static_cast<double>(i), i == 0 ? keyframe{} : k.back()));
      oracle.keyframes[i] = {keypoints, static_cast<double>(i)};
    }
    for (std::size_t i = 0; i < points; ++i) {
      p.push_back(traits::add_point(map, {}, k[0]));
      oracle.points[i] = {oracle_id{0}, {}};
    }
  }
  void see(oracle_id point, oracle_id keyframe_id, std::size_t i) {
    CHECK(turbomap::observe(map, p[point], k[keyframe_id], i) == oracle.observe(point, {keyframe_id, i}));
  }
  void erase(oracle_id keyframe_id) {
    turbomap::erase_keyframe(map, k[keyframe_id], 0), oracle.erase_keyframe(keyframe_id, 0);
  }
  ids named(turbomap::span<const keyframe> list) const {
    ids all;
    for (const auto one : list) all.push_back(traits::id(map, one));
    return all;
  }
};

TEST_CASE("by hand: a chain of keyframes that share points with the next one only") {
  world<flat_map> w(6, 20, 1);
  for (std::size_t i = 0; i + 1 < 6; ++i)
    for (std::size_t j = 0; j < 3; ++j) w.see(3 * i + j, i, j), w.see(3 * i + j, i + 1, 10 + j);
  turbomap::neighbourhood<flat_map> around;
  turbomap::neighbourhood_options o;
  o.min_shared_points = 2;
  CHECK(w.named(around.neighbours(w.map, w.k[3], o)) == ids{2, 4});
  CHECK(w.named(around.targets(w.map, w.k[3], o)) == ids{2, 4, 1, 5});
  CHECK(w.named(around.covisible_keyframes(w.map, w.k[3], o)) == ids{2, 4});
  o.neighbours = 1;
  CHECK(w.named(around.neighbours(w.map, w.k[3], o)) == ids{2});
  CHECK(w.named(around.targets(w.map, w.k[3], o)) == ids{2, 1});
  CHECK(w.named(around.covisible_keyframes(w.map, w.k[3], o)) == ids{2, 4});  // all of them
  o.second_neighbours = 1;
  o.neighbours = 10;
  CHECK(w.named(around.targets(w.map, w.k[3], o)) == ids{2, 4, 1});  // 4 shares most with 3, of the lower id
  o.temporal_neighbours = 4, o.temporal_targets = 2;
  CHECK(w.named(around.neighbours(w.map, w.k[3], o)) == ids{2, 4, 1, 0});
  CHECK(w.named(around.targets(w.map, w.k[3], o)) == ids{2, 4, 1});  // temporal neighbours are no targets
  o.temporal_targets = 10;
  CHECK(w.named(around.targets(w.map, w.k[3], o)) == ids{2, 4, 1, 0});  // no more are there
  o.min_shared_points = 15;
  o.temporal_neighbours = 0;
  CHECK(w.named(around.neighbours(w.map, w.k[3], o)) == ids{2});  // the best one, though it shares too little
}

TEST_CASE("0 means none") {
  world<flat_map> w(6, 20, 1);
  for (std::size_t i = 0; i + 1 < 6; ++i)
    for (std::size_t j = 0; j < 3; ++j) w.see(3 * i + j, i, j), w.see(3 * i + j, i + 1, 10 + j);
  turbomap::neighbourhood<flat_map> around;
  turbomap::neighbourhood_options o;
  o.min_shared_points = 2;
  o.second_neighbours = 0;
  CHECK(w.named(around.targets(w.map, w.k[3], o)) == ids{2, 4});
  o.neighbours = 0;
  CHECK(around.neighbours(w.map, w.k[3], o).empty());
  CHECK(around.targets(w.map, w.k[3], o).empty());
  for (int turbomap::neighbourhood_options::*member :
       {&turbomap::neighbourhood_options::neighbours, &turbomap::neighbourhood_options::second_neighbours,
        &turbomap::neighbourhood_options::temporal_targets, &turbomap::neighbourhood_options::min_shared_points}) {
    turbomap::neighbourhood_options bad;
    bad.*member = -1;
    CHECK_THROWS_AS(around.targets(w.map, w.k[3], bad), std::invalid_argument);
  }
}

TEST_CASE("keyframes that are not accepted do not use up the limits") {
  world<flat_map> w(8, 20, 1);  // all share a point with keyframe 7, those of higher id more
  for (std::size_t i = 0; i < 7; ++i)
    for (std::size_t j = 0; j <= i; ++j) w.see(j, i, j);
  for (std::size_t j = 0; j < 7; ++j) w.see(j, 7, j);
  turbomap::neighbourhood<flat_map> around;
  turbomap::neighbourhood_options o;
  o.min_shared_points = 1, o.neighbours = 2, o.second_neighbours = 1;
  CHECK(w.named(around.neighbours(w.map, w.k[7], o)) == ids{6, 5});
  const auto old = [&](turbomap::map_keyframe_id k) { return turbomap::map_traits<flat_map>::id(w.map, k) < 4; };
  CHECK(w.named(around.neighbours(w.map, w.k[7], o, old)) == ids{3, 2});
  CHECK(w.named(around.targets(w.map, w.k[7], o, old)) == ids{3, 2});
  CHECK(w.named(around.covisible_keyframes(w.map, w.k[7], o, old)) == ids{3, 2, 1, 0});
  o.temporal_neighbours = 4;
  CHECK(w.named(around.neighbours(w.map, w.k[7], o, old)) == ids{3, 2, 1, 0});
  o.min_shared_points = 7;  // none of the accepted ones shares so many: the best of them is left
  o.temporal_neighbours = 0;
  CHECK(w.named(around.neighbours(w.map, w.k[7], o, old)) == ids{3});
}

TEST_CASE("a keyframe that shares nothing has its predecessors only") {
  world<flat_map> w(4, 1, 1);
  turbomap::neighbourhood<flat_map> around;
  turbomap::neighbourhood_options o;
  CHECK(around.neighbours(w.map, w.k[3], o).empty());
  CHECK(around.targets(w.map, w.k[3], o).empty());
  CHECK(around.covisible_keyframes(w.map, w.k[3], o).empty());
  o.temporal_neighbours = 2, o.temporal_targets = 3;
  CHECK(w.named(around.neighbours(w.map, w.k[3], o)) == ids{2, 1});
  CHECK(w.named(around.targets(w.map, w.k[3], o)) == ids{2, 1, 0});
  CHECK(around.neighbours(w.map, w.k[0], o).empty());
}

TEST_CASE("predecessors that run in a circle end") {
  for (std::size_t size = 1; size <= 7; ++size)
    for (std::size_t into = 0; into < size; ++into)
      for (std::size_t query = 0; query < size; ++query) {
        world<circular_map> w(size, 1, 1);
        w.map.before_first = w.k[into];
        turbomap::neighbourhood<circular_map> around;
        turbomap::neighbourhood_options o;
        o.temporal_neighbours = o.temporal_targets = 100;
        const std::size_t expected = std::max(query, into);  // all up to there, but for the query
        CHECK(around.neighbours(w.map, w.k[query], o).size() == expected);
        CHECK(around.targets(w.map, w.k[query], o).size() == expected);
      }
}

TEST_CASE_TEMPLATE("random maps", Map, flat_map, pointer_map) {
  constexpr bool has_time = turbomap::detail::map_has_v<Map, turbomap::detail::map_temporal_member>;
  for (std::uint32_t seed = 1; seed <= 12; ++seed) {
    std::mt19937 random(seed);
    const int cameras = 1 + static_cast<int>(seed % 2);
    world<Map> w(14, 120, cameras);
    for (int n = 0; n < 900; ++n) {
      const auto keyframe = random() % 14;
      const auto point = (keyframe * 6 + random() % 50) % 120;  // keyframes side by side share more
      w.see(point, keyframe, random() % (30U * static_cast<unsigned>(cameras)));
    }
    w.erase(3), w.erase(9);
    turbomap::neighbourhood<Map> around;
    for (const auto& [query, unused] : w.oracle.keyframes) {
      turbomap::neighbourhood_options o;
      o.min_shared_points = 1 + static_cast<int>(random() % 8);
      o.neighbours = static_cast<int>(random() % 5), o.second_neighbours = static_cast<int>(random() % 4);
      o.temporal_neighbours = static_cast<int>(random() % 12), o.temporal_targets = static_cast<int>(random() % 16);
      ids near = covisible_by_definition(w.oracle, query, o.min_shared_points, static_cast<std::size_t>(o.neighbours));
      ids targets;
      for (const oracle_id n : near) targets.push_back(n);
      for (const oracle_id n : near)
        for (const oracle_id m :
             covisible_by_definition(w.oracle, n, o.min_shared_points, static_cast<std::size_t>(o.second_neighbours)))
          if (m != query && !contains(targets, m)) targets.push_back(m);
      if (has_time) {
        add_predecessors(w.oracle, query, o.temporal_neighbours, near);
        add_predecessors(w.oracle, query, o.temporal_targets, targets);
      }
      const auto k = w.k[query];
      CHECK(w.named(around.neighbours(w.map, k, o)) == near);
      CHECK(w.named(around.targets(w.map, k, o)) == targets);
      CHECK(w.named(around.covisible_keyframes(w.map, k, o)) ==
            covisible_by_definition(w.oracle, query, o.min_shared_points, turbomap::no_limit));
    }
  }
}

}  // namespace

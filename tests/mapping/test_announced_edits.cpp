// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// created, merged and erased of map_traits: what a system keeps by them is right at every moment, mirrored or not. And traits whose
/// descriptors come by value.

#include <doctest/doctest.h>

#include <cstdint>
#include <set>
#include <stdexcept>
#include <vector>

#include "local_mapper_cases.hpp"
#include "scenes/map_scene.hpp"
#include "support/policies.hpp"

namespace turbomap_test {

/// Keeps the ids of what is announced, and counts what was not as it should be at that moment.
template <bool Mirrored>
struct announcing_map : flat_map {
  using flat_map::flat_map;
  std::set<std::uint64_t> created, merged, erased;
  int wrong = 0;
  std::size_t descriptor_bytes = 32;
};

}  // namespace turbomap_test

template <bool Mirrored>
struct turbomap::map_traits<turbomap_test::announcing_map<Mirrored>> : turbomap::map_traits<turbomap_test::flat_map> {
  using base = turbomap::map_traits<turbomap_test::flat_map>;
  using map = turbomap_test::announcing_map<Mirrored>;
  using point = base::point;
  static constexpr bool mirrored = Mirrored;

  static std::vector<std::uint8_t> descriptor_data(const map& m, point p) {
    const auto* d = base::descriptor_data(m, p);
    return {d, d + m.descriptor_bytes};
  }
  static void created(map& m, point p) {
    int views = 0;
    base::for_each_observation(m, p, [&](base::keyframe, std::size_t) { ++views; });
    m.wrong += base::alive(m, p) && views >= 2 && base::max_distance(m, p) > 0 ? 0 : 1;
    m.wrong += m.created.insert(base::id(m, p)).second ? 0 : 1;
  }
  static void merged(map& m, point from, point into) {
    m.wrong += !base::alive(m, from) && base::alive(m, into) && turbomap::resolve<flat_map>(m, from) == into ? 0 : 1;
    m.wrong += m.merged.insert(base::id(m, from)).second ? 0 : 1;
  }
  static void erased(map& m, point p) {
    m.wrong += !base::alive(m, p) ? 0 : 1;
    m.wrong += m.erased.insert(base::id(m, p)).second ? 0 : 1;
  }

 private:
  using flat_map = turbomap_test::flat_map;
};

namespace {

using namespace turbomap_test;

template <class Map>
struct stereo_run {
  mapping_case<pinhole_camera> c = stereo_case(noisy(3));
  mapping_scene<pinhole_camera> scene{c.rig, noisy(3)};
  mapping_run<Map, sequential> run;

  explicit stereo_run(bool strict = false) : run(scene, with(c.options, strict)) {}
  static turbomap::local_mapper_options with(turbomap::local_mapper_options options, bool strict) {
    options.strict = strict;
    return options;
  }
};

template <bool Mirrored>
void check_announced() {
  stereo_run<announcing_map<Mirrored>> r;
  stereo_run<flat_map> silent;
  std::size_t created = 0, merged = 0, culled = 0;
  for (int n = 0; n < 14; ++n) {
    const auto& report = r.run.step();
    silent.run.step();
    created += report.points_created, merged += report.fused.merged, culled += report.points_culled;
  }
  auto& map = r.run.map;
  CHECK(map.wrong == 0);
  CHECK(created > 0);
  CHECK(merged > 0);
  CHECK(map.created.size() == created);
  CHECK(map.merged.size() == merged);
  CHECK(map.erased.size() >= culled);
  CHECK(!map.erased.empty());
  std::set<std::uint64_t> alive;
  turbomap::map_traits<flat_map>::for_each_point(
      map, [&](turbomap::map_point_id p) { alive.insert(turbomap::map_traits<flat_map>::id(map, p)); });
  for (const std::uint64_t id : map.created)
    CHECK((alive.count(id) == 1) == (map.merged.count(id) == 0 && map.erased.count(id) == 0));
  for (const std::uint64_t id : map.merged) CHECK(alive.count(id) == 0);
  for (const std::uint64_t id : map.erased) CHECK(alive.count(id) == 0);
  CHECK(content<flat_map>(map) == content(silent.run.map));  // descriptors by value give the same map, too
}

TEST_CASE("what is announced under the guard has happened, and all of it is") { check_announced<false>(); }
TEST_CASE("the same of a map that is mirrored") { check_announced<true>(); }

template <bool Mirrored>
void check_short_descriptors(bool strict) {
  stereo_run<announcing_map<Mirrored>> r(strict);
  for (int n = 0; n < 4; ++n) r.run.step();
  for (const std::size_t bytes : {0, 31}) {
    r.run.map.descriptor_bytes = bytes;
    r.run.mapper.refresh();
    if (strict)
      CHECK_THROWS_AS(r.run.mapper.fuse_around(r.run.keyframes().back()), turbomap::inconsistent_map);
    else
      CHECK(r.run.mapper.fuse_around(r.run.keyframes().back()).merged == 0);
    std::vector<turbomap::map_point_id> points;
    turbomap::map_traits<flat_map>::for_each_point(r.run.map, [&](turbomap::map_point_id p) { points.push_back(p); });
    if (strict)
      CHECK_THROWS_AS(r.run.mapper.update_geometry(points), turbomap::inconsistent_map);
    else
      CHECK_NOTHROW(r.run.mapper.update_geometry(points));
    std::size_t told = 0;
    for (const auto& v : r.run.mapper.report().refused) told += v.fault == turbomap::map_fault::no_descriptor ? 1 : 0;
    CHECK(told == (strict ? 0 : points.size()));
    CHECK(turbomap::validate(r.run.map).empty());
  }
  r.run.map.descriptor_bytes = 32;
  r.run.mapper.refresh();
  r.run.step();
  CHECK(turbomap::validate(r.run.map).empty());
}

TEST_CASE(
    "points whose descriptor is missing or too short are passed over and reported, or thrown where that is asked for") {
  for (const bool strict : {false, true}) {
    check_short_descriptors<false>(strict);
    check_short_descriptors<true>(strict);
  }
}

template <class Map>
void check_restarted() {
  stereo_run<Map> fresh, again;
  for (int n = 0; n < 6; ++n) again.run.step();
  CHECK(again.run.store.size() > 0);
  again.run.restart();
  CHECK(again.run.store.size() == 0);
  CHECK(again.run.mapper.stored().size() == 0);
  CHECK(again.run.mapper.iterations() == 0);
  for (int n = 0; n < 10; ++n) fresh.run.step(), again.run.step();
  CHECK(content<flat_map>(again.run.map) == content<flat_map>(fresh.run.map));
  again.run.store.clear();  // in either order
  again.run.restart();
  again.run.step();
  CHECK(again.run.store.size() == 1);
}

TEST_CASE("a mapper that was reset maps as a new one") { check_restarted<flat_map>(); }
TEST_CASE("the same of a map that is mirrored, whose ids begin again") { check_restarted<announcing_map<true>>(); }

}  // namespace

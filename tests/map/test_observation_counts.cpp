// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Counts of observations by octave: a keyframe counts once, at its finest octave, on any rig.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/observation_counts.hpp>
#include <turbomap/mapping/keyframe_culling.hpp>

#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "scenes/lying_map.hpp"
#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"

namespace turbomap_test {

/// A map that keeps no counts, and knows how often the views of a point were walked over.
struct walked_map : pointer_map {
  mutable int walks = 0;
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::walked_map> : turbomap::map_traits<turbomap_test::pointer_map> {
  using map = turbomap_test::walked_map;

  template <class F>
  static void for_each_observation(const map& m, point p, F f) {
    ++m.walks;
    turbomap::map_traits<turbomap_test::pointer_map>::for_each_observation(m, p, f);
  }
};

namespace {

using namespace turbomap_test;
using counts = std::vector<std::uint32_t>;

template <class Map>
counts recounted(const Map& map, typename turbomap::map_traits<Map>::point p, std::size_t octaves) {
  counts c{9, 9};
  turbomap::recount(map, p, c, octaves);
  return c;
}

counts kept(const flat_map& map, turbomap::map_point_id p) {
  const auto c = turbomap::map_traits<flat_map>::octave_counts(map, p);
  return {c.begin(), c.end()};
}

TEST_CASE_TEMPLATE("a rig counts once, at its finest octave", Map, flat_map, pointer_map) {
  Map map;
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  // Four cameras with octaves 3, 1, 1, 5.
  const std::vector<turbomap::keypoint> rig{make_keypoint(3, 0), make_keypoint(1, 1), make_keypoint(1, 2),
                                            make_keypoint(5, 3)};
  const auto k = insert_keyframe(map, rig, 0, keyframe{}), l = insert_keyframe(map, rig, 0, keyframe{});
  const auto p = traits::add_point(map, {}, k);
  CHECK(recounted(map, p, 0) == counts{});
  CHECK(recounted(map, p, 3) == counts{0, 0, 0});
  CHECK(turbomap::finest_octave(map, p, k) == -1);
  CHECK(turbomap::observed_at(map, p, k, 0) == -1);
  CHECK(turbomap::observe(map, p, k, 3));
  CHECK(recounted(map, p, 0) == counts{0, 0, 0, 0, 0, 1});
  CHECK(turbomap::observe(map, p, k, 0));
  CHECK(recounted(map, p, 6) == counts{0, 0, 0, 1, 0, 0});
  CHECK(turbomap::observe(map, p, k, 2));
  CHECK(turbomap::observe(map, p, k, 1));
  CHECK(turbomap::observe(map, p, l, 0));
  CHECK(recounted(map, p, 6) == counts{0, 1, 0, 1, 0, 0});
  CHECK(turbomap::finest_octave(map, p, k) == 1);
  CHECK(turbomap::finest_octave(map, p, k, 1) == 1);  // without one of the two
  CHECK(turbomap::finest_octave(map, p, l, 0) == -1);
  CHECK(turbomap::observed_at(map, p, k, 2) == 2);
  CHECK(turbomap::observed_at(map, p, l, 2) == -1);
  turbomap::forget(map, k, 1);
  CHECK(recounted(map, p, 6) == counts{0, 1, 0, 1, 0, 0});
  turbomap::forget(map, k, 2);
  CHECK(recounted(map, p, 6) == counts{0, 0, 0, 2, 0, 0});
  turbomap::forget(map, k, 0);
  CHECK(recounted(map, p, 6) == counts{0, 0, 0, 1, 0, 1});
  if constexpr (turbomap::counts_octaves_v<Map>) CHECK(kept(map, p) == recounted(map, p, 8));

  std::vector<keyframe> scratch;
  CHECK(turbomap::observers_up_to(map, p, 2, 5, scratch) == 0);
  CHECK(turbomap::observers_up_to(map, p, 3, 5, scratch) == 1);
  CHECK(turbomap::observers_up_to(map, p, 5, 5, scratch) == 2);
  CHECK(turbomap::observers_up_to(map, p, 300, 5, scratch) == 2);
  CHECK(turbomap::observers_up_to(map, p, 300, 1, scratch) == 1);  // counting ends there
  CHECK(turbomap::observers_up_to(map, p, 300, 0, scratch) == 0);
  const int measurements = turbomap::measurement_count(map, p);
  for (int fewest = -1; fewest < 5; ++fewest)
    CHECK(turbomap::has_more_measurements(map, p, fewest) == (measurements > fewest));
}

TEST_CASE("the observers of a point are counted by one walk over its views") {
  walked_map map;
  using traits = turbomap::map_traits<walked_map>;
  const auto p = traits::add_point(map, {}, nullptr);
  const std::vector<turbomap::keypoint> rig{make_keypoint(2, 0), make_keypoint(1, 1)};
  for (int k = 0; k < 10; ++k) {
    auto* const keyframe = insert_keyframe(map, rig, 0, nullptr);
    CHECK(turbomap::observe(map, p, keyframe, 0));
    CHECK(turbomap::observe(map, p, keyframe, 1));
  }
  std::vector<pointer_keyframe*> scratch;
  for (const std::uint32_t enough : {5U, 10U, 30U}) {
    map.walks = 0;
    CHECK(turbomap::observers_up_to(map, p, 2, enough, scratch) == (enough < 10 ? enough : 10U));
    CHECK(map.walks == 1);
  }
  CHECK(turbomap::observers_up_to(map, p, 0, 5, scratch) == 0);
}

TEST_CASE("counts of any length reach what their sum reaches") {
  std::mt19937 random(3);
  for (std::size_t levels = 1; levels <= 12; ++levels)
    for (int round = 0; round < 200; ++round) {
      counts c(levels);
      for (auto& n : c) n = random() % 3;
      const auto octave = static_cast<int>(random() % 14);
      const auto enough = static_cast<std::uint32_t>(random() % 9);
      std::uint32_t sum = 0;
      for (std::size_t o = 0; o < levels && static_cast<int>(o) <= octave; ++o) sum += c[o];
      CHECK((octave >= turbomap::enough_from({c.data(), c.size()}, enough)) == (sum >= enough));
    }
}

TEST_CASE("a stereo keypoint is two measurements, NaN is no stereo") {
  flat_map map;
  const std::vector<turbomap::keypoint> rig{make_keypoint(0, 0, 0.F), make_keypoint(0, 1, -1.F),
                                            make_keypoint(0, 2, std::numeric_limits<float>::quiet_NaN())};
  const auto k = map.add_keyframe(rig, {});
  const auto p = map.add_point({});
  CHECK(turbomap::measurement_count(map, p) == 0);
  turbomap::observe(map, p, k, 0);
  CHECK(turbomap::measurement_count(map, p) == 2);
  turbomap::observe(map, p, k, 1);
  CHECK(turbomap::measurement_count(map, p) == 3);
  turbomap::observe(map, p, k, 2);
  CHECK(turbomap::measurement_count(map, p) == 4);
}

}  // namespace

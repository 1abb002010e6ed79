// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Local mapping on a map of objects: the map that it makes on flat arrays, to the last bit.

#include <doctest/doctest.h>
#include <thrust/detail/seq.h>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/validate.hpp>
#include <type_traits>

#include "objects_map/objects_map.hpp"
#include "replay/map_digest.hpp"
#include "scenes/mapping_scene.hpp"

namespace {

using namespace turbomap_test;

using sequential = std::decay_t<decltype(thrust::seq)>;
using descriptor = turbomap::binary_descriptor<256>;

template <class Map>
using run_on = mapping_run<Map, sequential, turbomap::local_adjustment<Map, sequential>>;

template <class Camera>
void check_same_map(const mapping_scene<Camera>& scene, const turbomap::local_mapper_options& options, int keyframes) {
  run_on<turbomap::simple_map<descriptor, Camera>> flat(scene, options);
  run_on<turbomap_program::objects_map<Camera>> objects(scene, options);
  std::size_t merged = 0, culled = 0;
  for (int n = 0; n < keyframes; ++n) {
    CAPTURE(n);
    const auto& report = flat.step();
    merged += report.fused.merged, culled += report.keyframes_culled.size() + report.points_culled;
    objects.step();
    REQUIRE(objects.map.point_count() == flat.map.point_count());
    REQUIRE(objects.map.observation_count() == flat.map.observation_count());
    REQUIRE(turbomap_replay::map_digest(objects.map) == turbomap_replay::map_digest(flat.map));
    REQUIRE(turbomap::validate(objects.map).empty());
  }
  for (int n = 0; n < 2; ++n) {  // also after the mirror has let go of what died
    turbomap::global_adjustment_options all;
    all.scales = options.adjustment.scales;
    CHECK(flat.mapper.adjust_globally(flat.keyframes().back(), all).solve.accepted > 0);
    objects.mapper.adjust_globally(objects.keyframes().back(), all);
    REQUIRE(turbomap_replay::map_digest(objects.map) == turbomap_replay::map_digest(flat.map));
    REQUIRE(turbomap::validate(objects.map).empty());
    flat.step(), objects.step();
  }
  CHECK(merged > 20);
  CHECK(culled > 0);
}

TEST_CASE("a map of objects and one of arrays become the same to the last bit") {
  mapping_recipe recipe;
  recipe.seed = 5, recipe.pixel_noise = 0.4, recipe.noisy_bits = 20, recipe.turn_back = 6;
  const auto options = turbomap::local_mapper_options::stereo(0.11, 6, recipe.scales);
  SUBCASE("a rectified pair") { check_same_map(mapping_scene<pinhole_camera>(pinhole_rig(50), recipe), options, 12); }
  SUBCASE("a rig of two fisheyes") {
    check_same_map(mapping_scene<fisheye_camera>(fisheye_rig(2), recipe), options, 9);
  }
}

TEST_CASE("a mapper on a mirror sees what is reported at once, and heals what is not") {
  mapping_recipe recipe;
  recipe.seed = 5, recipe.pixel_noise = 0.4, recipe.noisy_bits = 20;
  auto options = turbomap::local_mapper_options::stereo(0.11, 6, recipe.scales);
  options.checked_share = 1;  // what is not healed was known
  const mapping_scene<pinhole_camera> scene(pinhole_rig(50), recipe);
  run_on<turbomap_program::objects_map<pinhole_camera>> run(scene, options);
  using traits = turbomap::map_traits<turbomap_program::objects_map<pinhole_camera>>;
  for (int n = 0; n < 6; ++n) CHECK(run.step().healed == 0);
  turbomap_program::point_ptr p;
  traits::for_each_point(run.map, [&](const auto& each) {
    if (traits::alive(run.map, each)) p = each;
  });
  REQUIRE(p);
  const auto move = [&] {
    auto x = p->position();
    x.x += 1e-9;
    traits::set_position(run.map, p, x);
  };
  move();
  CHECK(run.step().healed == 1);
  CHECK(run.step().healed == 0);
  move();
  run.mapper.changed(p);
  CHECK(run.step().healed == 0);
  move();
  run.mapper.refresh();
  CHECK(run.step().healed == 0);
}

}  // namespace

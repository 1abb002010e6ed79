// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Local mapping on a map of objects: the map that it makes on flat arrays, to the last bit; with an IMU too.

#include <doctest/doctest.h>
#include <thrust/detail/seq.h>
#include <cmath>
#include <memory>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/simple_map/simple_inertial_map.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/inertial_adjustment.hpp>
#include <type_traits>
#include <vector>

#include "objects_map/inertial_objects_map.hpp"
#include "objects_map/objects_map.hpp"
#include "replay/map_digest.hpp"
#include "scenes/inertial_motion.hpp"
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

/// Velocities, biases and motions of the keyframes, one after the other.
template <class Map>
std::vector<double> inertial_numbers(const Map& map) {
  std::vector<double> all;
  const auto add = [&](const turbomap::vec3<double>& v) { all.insert(all.end(), {v.x, v.y, v.z}); };
  turbomap::map_traits<Map>::for_each_keyframe(map, [&](const auto& k) {
    add(map.velocity(k)), add(map.bias(k).gyro), add(map.bias(k).acceleration);
    const auto p = map.motion(k);
    if (p) all.push_back(p->dt), add(p->dP), add(p->dV), add(p->bias.gyro), all.push_back(p->covariance(0, 0));
  });
  return all;
}

TEST_CASE("a map of objects with an IMU and one of arrays become the same to the last bit") {
  twin_inertial_mapping<turbomap::simple_inertial_map<descriptor, pinhole_camera>,
                        turbomap_program::inertial_objects_map<pinhole_camera>, sequential>
      twins;
  for (int n = 0; n < 20; ++n) {
    CAPTURE(n);
    twins.step();
    CHECK(twins.healed == 0);
    REQUIRE(turbomap_replay::map_digest(twins.second()) == turbomap_replay::map_digest(twins.first()));
    REQUIRE(inertial_numbers(twins.second()) == inertial_numbers(twins.first()));
    REQUIRE(turbomap::validate(twins.second()).empty());
  }
  CHECK(twins.culled > 4);
  CHECK(twins.adjusted > 20);
}

/// Half a second at 200 Hz from `from_ms` on, pushed and turned evenly.
turbomap::imu_history half_second(int from_ms) {
  turbomap::imu_history h;
  for (int ms = from_ms; ms <= from_ms + 500; ms += 5)
    h.t_ns.push_back(ms * 1'000'000LL), h.sample.push_back({{0, 0, 0.5}, {1, 0, 9.81}});
  h.pieces.push_back(turbomap::find_interval({h.t_ns, h.sample}, h.t_ns.front(), h.t_ns.back()));
  return h;
}

TEST_CASE("the samples of objects are joined and integrated again as those of a simple_inertial_map") {
  const turbomap::preintegration_options imu;
  const turbomap::imu_bias<double> none{}, far{{0.3, 0, 0}, {0, 2, 0}};  // too far for the first order
  const turbomap::keypoint keypoint{10, 10};
  const auto run = [&](auto map) {
    using map_type = std::decay_t<decltype(*map)>;
    using traits = turbomap::inertial_traits<map_type>;
    map->set_imu({}, imu);
    const turbomap::span<const turbomap::keypoint> one(&keypoint, 1);
    const auto a = map->add_keyframe(one, {}, 0);
    const auto b = map->add_keyframe(one, {}, 0.5, a);
    const auto c = map->add_keyframe(one, {}, 1, b);
    map->set_motion(b, turbomap::preintegrate(half_second(0), none, imu), half_second(0));
    map->set_motion(c, turbomap::preintegrate(half_second(500), none, imu), half_second(500));
    auto numbers = inertial_numbers(*map);
    const auto note = [&] {
      const auto more = inertial_numbers(*map);
      numbers.insert(numbers.end(), more.begin(), more.end());
    };
    turbomap::bridge_motion(*map, b), turbomap::map_traits<map_type>::erase_keyframe(*map, b);
    note();
    CHECK(std::abs(map->motion(c)->dt - 1) < 1e-9);
    traits::bias_changed(*map, c, far);
    CHECK(map->motion(c)->bias.acceleration.y == 2);  // of the samples of both
    CHECK(std::abs(map->motion(c)->dt - 1) < 1e-9);
    note();
    traits::clear_motion(*map, c);
    CHECK(!map->motion(c));
    note();
    map->set_motion(c, turbomap::preintegrate(half_second(500), none, imu));
    traits::bias_changed(*map, c, far);
    CHECK(map->motion(c)->bias.acceleration.y == 0);  // without samples it stays
    note();
    return numbers;
  };
  const auto flat = run(std::make_unique<turbomap::simple_inertial_map<descriptor, pinhole_camera>>());
  const auto objects = run(std::make_unique<turbomap_program::inertial_objects_map<pinhole_camera>>());
  CHECK(flat == objects);
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

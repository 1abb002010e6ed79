// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

#include <doctest/doctest.h>

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/store/cell_index.hpp>
#include <turbomap/store/keyframe_packing.hpp>

#include <cmath>
#include <cstring>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "scenes/keyframe_samples.hpp"

namespace {

using namespace turbomap_test;

/// A packed keyframe and its view.
template <class Camera = sample_camera>
struct packed_keyframe {
  turbomap::keyframe_layout layout;
  std::vector<std::byte> block;
  turbomap::keyframe_view<sample_descriptor, Camera> view;

  explicit packed_keyframe(const turbomap::keyframe_data<sample_descriptor, Camera>& data,
                           const turbomap::keyframe_packing_options& options = {}) {
    turbomap::keyframe_packing_scratch scratch;
    layout = turbomap::plan_packing(data, options, scratch);
    block.resize(layout.bytes);
    turbomap::pack_keyframe(data, layout, scratch, block.data());
    view = turbomap::view_at<sample_descriptor, Camera>(layout, block.data());
  }
};

using lists = std::map<std::uint32_t, std::vector<std::uint32_t>>;

lists cells_of(const turbomap::cell_index_view& cells, int count) {
  lists result;
  CHECK(cells.offsets[0] == 0);
  for (int c = 0; c < count; ++c)
    for (std::uint32_t at = cells.offsets[c]; at < cells.offsets[c + 1]; ++at)
      result[static_cast<std::uint32_t>(c)].push_back(cells.keypoints[at]);
  return result;
}
lists groups_of(const turbomap::group_index_view& groups) {
  lists result;
  for (int g = 0; g < groups.group_count; ++g) {
    if (g > 0) CHECK(groups.ids[g - 1] < groups.ids[g]);
    for (std::uint32_t at = groups.offsets[g]; at < groups.offsets[g + 1]; ++at)
      result[groups.ids[g]].push_back(groups.keypoints[at]);
  }
  return result;
}

/// The documented rule, written down another way: std::round of float arithmetic.
lists expected_cells(const sample_keyframe& k, int columns, int rows) {
  lists result;
  const float inverse_width = static_cast<float>(columns) / (k.bounds.max_x - k.bounds.min_x);
  const float inverse_height = static_cast<float>(rows) / (k.bounds.max_y - k.bounds.min_y);
  for (std::size_t i = 0; i < k.keypoints.size(); ++i) {
    const volatile float dx = k.keypoints[i].x - k.bounds.min_x, dy = k.keypoints[i].y - k.bounds.min_y;
    const volatile float sx = dx * inverse_width, sy = dy * inverse_height;
    const float column = std::round(sx), row = std::round(sy);
    if (column < 0 || row < 0 || column >= static_cast<float>(columns) || row >= static_cast<float>(rows)) continue;
    const auto cell = (k.keypoints[i].camera * columns + static_cast<int>(column)) * rows + static_cast<int>(row);
    result[static_cast<std::uint32_t>(cell)].push_back(static_cast<std::uint32_t>(i));
  }
  return result;
}
lists expected_groups(const sample_keyframe& k) {
  lists result;
  for (std::size_t i = 0; i < k.keypoints.size(); ++i)
    if (k.keypoints[i].group != turbomap::keypoint::no_group)
      result[k.keypoints[i].group].push_back(static_cast<std::uint32_t>(i));
  return result;
}

void check_against_input(const sample_keyframe& k, const turbomap::keyframe_packing_options& options = {}) {
  const packed_keyframe<> p(k.data(), options);
  const auto& v = p.view;
  REQUIRE(v.keypoint_count == static_cast<int>(k.keypoints.size()));
  CHECK(v.camera_count == static_cast<int>(k.cameras.size()));
  CHECK((v.camera == nullptr) == (k.cameras.size() == 1));
  for (int i = 0; i < v.keypoint_count; ++i) {
    const auto& in = k.keypoints[static_cast<std::size_t>(i)];
    REQUIRE(v.pixel[i].x == in.x);
    REQUIRE(v.pixel[i].y == in.y);
    REQUIRE(v.octave[i] == in.octave);
    REQUIRE(v.camera_of(i) == in.camera);
    REQUIRE(v.angle[i] == in.angle);
    REQUIRE((v.u_right != nullptr ? v.u_right[i] : -1) == in.u_right);
    REQUIRE((v.depth != nullptr ? v.depth[i] : -1) == in.depth);
    REQUIRE(std::memcmp(v.descriptor_of(i), k.descriptors.data() + i * 32, 32) == 0);
    const auto& camera = k.cameras[in.camera].camera;
    const long double x = (static_cast<long double>(in.x) - camera.cx) / camera.fx;
    const long double y = (static_cast<long double>(in.y) - camera.cy) / camera.fy;
    const long double length = std::sqrt(x * x + y * y + 1);
    REQUIRE(v.bearing[i].x == doctest::Approx(static_cast<double>(x / length)).epsilon(1e-7));
    REQUIRE(v.bearing[i].y == doctest::Approx(static_cast<double>(y / length)).epsilon(1e-7));
    REQUIRE(v.bearing[i].z == doctest::Approx(static_cast<double>(1 / length)).epsilon(1e-7));
  }
  const int cells = v.camera_count * v.cells.columns * v.cells.rows;
  CHECK(cells_of(v.cells, cells) == expected_cells(k, options.grid_columns, options.grid_rows));
  CHECK(groups_of(v.groups) == expected_groups(k));
  CHECK(v.cameras[0].camera.fx == k.cameras[0].camera.fx);
  CHECK(v.cameras[0].resolution.known());
}

TEST_CASE("a packed keyframe holds what went in") {
  check_against_input(make_keyframe(1, 1200));
  check_against_input(make_keyframe(2, 500, 2, false));
  check_against_input(make_keyframe(3, 333, 5, true, 0));
  check_against_input(make_keyframe(4, 1));
  turbomap::keyframe_packing_options options;
  options.grid_columns = 7, options.grid_rows = 3;
  check_against_input(make_keyframe(5, 100, 3), options);
}

TEST_CASE("arrays that say nothing are left out") {
  const auto mono = make_keyframe(1, 100, 1, false, 0);
  const packed_keyframe<> p(mono.data());
  CHECK(p.view.camera == nullptr);
  CHECK(p.view.u_right == nullptr);
  CHECK(p.view.depth == nullptr);
  CHECK(p.view.groups.group_count == 0);
  CHECK(p.view.groups.ids == nullptr);
  turbomap::keyframe_packing_options options;
  options.grid_columns = options.grid_rows = 0;
  const packed_keyframe<> no_grid(mono.data(), options);
  CHECK(no_grid.view.cells.columns == 0);
  CHECK(no_grid.layout.cell_offsets == turbomap::keyframe_layout::absent);
}

TEST_CASE("group ids of any size, and one group for all") {
  auto k = make_keyframe(1, 1000, 1, false, 0);
  std::mt19937 random(3);
  for (auto& p : k.keypoints) p.group = static_cast<std::uint32_t>(random()) >> (8 * (random() % 4));
  for (std::size_t i = 0; i < 300; ++i) k.keypoints[i + 500].group = k.keypoints[i].group;
  check_against_input(k);
  for (auto& p : k.keypoints) p.group = p.group & 0xFF000000u;
  check_against_input(k);
  for (auto& p : k.keypoints) p.group = 7;
  check_against_input(k);
}

TEST_CASE("no keypoints at all") {
  const packed_keyframe<> p(make_keyframe(1, 0).data());
  CHECK(p.view.keypoint_count == 0);
  CHECK(p.view.camera_count == 1);
  CHECK(p.view.cells.columns == 0);
  CHECK(p.view.groups.group_count == 0);
}

TEST_CASE("all keypoints in one cell, and none in any") {
  auto k = make_keyframe(1, 500);
  for (auto& p : k.keypoints) p.x = 100, p.y = 50;
  check_against_input(k);
  const packed_keyframe<> p(k.data());
  CHECK(cells_of(p.view.cells, 64 * 48).size() == 1);
  for (auto& one : k.keypoints) one.x = -300;
  check_against_input(k);
}

TEST_CASE("65,535 keypoints take 16 bits per index, 65,536 take 32") {
  for (int n : {65535, 65536, 70000}) {
    auto k = make_keyframe(1, n, 1, false, 50);
    for (auto& p : k.keypoints) p.x = 100 + static_cast<float>(&p - k.keypoints.data() > n - 3), p.y = 50;
    const packed_keyframe<> p(k.data());
    CHECK(p.view.cells.offsets.wide == (n > 65535));
    const auto cells = cells_of(p.view.cells, 64 * 48);
    CHECK(cells == expected_cells(k, 64, 48));
    CHECK(groups_of(p.view.groups) == expected_groups(k));
  }
}

TEST_CASE("bearings of a fisheye camera; a pixel without a ray has none") {
  const turbomap::kannala_brandt<float> camera{190, 190, 254, 256, 0.003F, 0.0007F, -0.002F, 0.0002F};
  auto k = make_keyframe(1, 400, 1, false);
  for (auto& p : k.keypoints) p.x = p.x * 512 / 752;
  k.keypoints[7].x = 1e7F;
  turbomap::rig_camera<turbomap::kannala_brandt<float>> one{};
  one.camera = camera;
  const turbomap::keyframe_data<sample_descriptor, turbomap::kannala_brandt<float>> data{
      400, k.keypoints.data(), k.descriptors.data(), &one, 1, {0, 0, 512, 512}};
  const packed_keyframe<turbomap::kannala_brandt<float>> p(data);
  for (int i = 0; i < 400; ++i) {
    const auto& in = k.keypoints[static_cast<std::size_t>(i)];
    turbomap::vec3<double> ray{0, 0, 0};
    const bool seen = camera.unproject(turbomap::vec2<double>{in.x, in.y}, ray);
    CHECK(seen == (i != 7));
    CHECK(p.view.bearing[i].x == doctest::Approx(ray.x).epsilon(1e-7));
    CHECK(p.view.bearing[i].y == doctest::Approx(ray.y).epsilon(1e-7));
    CHECK(p.view.bearing[i].z == doctest::Approx(ray.z).epsilon(1e-7));
  }
}

/// Counts how often it is measured.
struct counted_camera : turbomap::pinhole<float> {
  static int measured;
  double min_pixels_per_radian(const turbomap::image_bounds& bounds) const {
    ++measured;
    return bounds.max_x > 1e6F ? 0 : turbomap::pinhole<float>::min_pixels_per_radian(bounds);
  }
};
int counted_camera::measured = 0;

TEST_CASE("images that their keypoints span are measured a few times, not one by one") {
  turbomap::measured_cameras cameras;
  const counted_camera camera{{400, 400, 320, 240}};
  const auto at = [](const turbomap::resolution_profile& p) { return p.pixels_per_radian[0]; };
  std::mt19937 random(1);
  counted_camera::measured = 0;
  for (int i = 0; i < 1000; ++i) {
    const auto edge = [&random] { return static_cast<float>(random() % 30); };
    const turbomap::image_bounds image{edge(), edge(), 640 - edge(), 480 - edge()};
    const auto& profile = cameras.of(0, camera, image);
    const auto exact = turbomap::measure_resolution(static_cast<const turbomap::pinhole<float>&>(camera), image);
    for (int k = 0; k < turbomap::resolution_profile::entries; ++k)
      if (exact.pixels_per_radian[k] > 401)  // where there is image; elsewhere it is the least of all
        REQUIRE(profile.pixels_per_radian[k] <= 1.02F * exact.pixels_per_radian[k]);
  }
  CHECK(counted_camera::measured <= 5);

  // One keyframe that reaches to where the model says nothing is unknown; those before and after it are not.
  const turbomap::image_bounds image{0, 0, 640, 480}, outlier{0, 0, 2e6F, 480};
  cameras.of(0, camera, image);
  CHECK(at(cameras.of(0, camera, outlier)) == 0);
  counted_camera::measured = 0;
  CHECK(at(cameras.of(0, camera, image)) > 300);
  CHECK(counted_camera::measured == 0);
  CHECK(at(cameras.of(1, camera, outlier)) == 0);
  CHECK(at(cameras.of(1, camera, image)) > 300);
  counted_camera::measured = 0;
  CHECK(at(cameras.of(2, camera, outlier)) == 0);
  CHECK(at(cameras.of(2, camera, outlier)) == 0);
  CHECK(counted_camera::measured == 1);
}

TEST_CASE("cameras are measured once, and again when camera or image change") {
  turbomap::measured_cameras measured;
  const turbomap::pinhole<float> camera{400, 400, 320, 240};
  const auto first = measured.of(1, camera, {0, 0, 640, 480});
  CHECK(std::memcmp(&first, &measured.of(1, camera, {0, 0, 640, 480}), sizeof first) == 0);
  const turbomap::pinhole<float> other{200, 200, 320, 240};
  CHECK(measured.of(1, other, {0, 0, 640, 480}).pixels_per_radian[0] < first.pixels_per_radian[0]);
  CHECK(measured.of(1, camera, {0, 0, 640, 480}).pixels_per_radian[0] == first.pixels_per_radian[0]);
  // What users have measured themselves is kept.
  auto k = make_keyframe(1, 3);
  k.cameras[0].resolution.pixels_per_radian[0] = 12.5F;
  CHECK(packed_keyframe<>(k.data()).view.cameras[0].resolution.pixels_per_radian[0] == 12.5F);
}

TEST_CASE("bytes of 1200 ORB keypoints: the table in the documentation") {
  auto k = make_keyframe(1, 1200);
  for (std::size_t i = 0; i < 1200; ++i) k.keypoints[i].group = static_cast<std::uint32_t>(i % 100);
  const packed_keyframe<> p(k.data());
  const auto& l = p.layout;
  const std::vector<std::pair<std::string, std::size_t>> starts{{"pixel", l.pixel},
                                                                {"bearing", l.bearing},
                                                                {"octave", l.octave},
                                                                {"angle", l.angle},
                                                                {"u_right", l.u_right},
                                                                {"depth", l.depth},
                                                                {"descriptor", l.descriptor},
                                                                {"cell_offsets", l.cell_offsets},
                                                                {"cell_keypoints", l.cell_keypoints},
                                                                {"group_ids", l.group_ids},
                                                                {"group_offsets", l.group_offsets},
                                                                {"group_keypoints", l.group_keypoints},
                                                                {"cameras", l.cameras},
                                                                {"end", l.bytes}};
  std::map<std::string, std::size_t> bytes;
  for (std::size_t i = 0; i + 1 < starts.size(); ++i) {
    CHECK(starts[i].second % turbomap::block_alignment == 0);
    bytes[starts[i].first] = starts[i + 1].second - starts[i].second;
  }
  CHECK(bytes["pixel"] == 9600);
  CHECK(bytes["bearing"] == 14400);
  CHECK(bytes["octave"] == 1216);
  CHECK(bytes["angle"] == 4800);
  CHECK(bytes["u_right"] == 4800);
  CHECK(bytes["depth"] == 4800);
  CHECK(bytes["descriptor"] == 38400);
  CHECK(bytes["cell_offsets"] == 6208);
  CHECK(bytes["cell_keypoints"] == 2432);
  CHECK(bytes["group_ids"] == 448);
  CHECK(bytes["group_offsets"] == 256);
  CHECK(bytes["group_keypoints"] == 2432);
  CHECK(bytes["cameras"] == 256);
  CHECK(l.bytes == 90048);
  CHECK(l.bytes <= 96 * 1024);
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

#include <doctest/doctest.h>

#include <turbomap/store/keyframe_validation.hpp>

#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "scenes/keyframe_samples.hpp"

namespace {

using namespace turbomap_test;

/// The message of what a changed keyframe throws; empty when nothing does.
template <class Change>
std::string refusal(Change change) {
  auto k = make_keyframe(1, 20, 2);
  auto data = k.data();
  change(k, data);
  try {
    turbomap::validate(data, turbomap::keyframe_packing_options{});
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

TEST_CASE("bad input is named: argument, index, value") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  using K = sample_keyframe;
  using D = sample_data;
  CHECK(refusal([](K&, D&) {}).empty());
  CHECK(refusal([&](K& k, D&) { k.keypoints[3].x = nan; }) == "turbomap: keypoints[3].x = nan: must be finite");
  CHECK(refusal([&](K& k, D&) { k.keypoints[19].y = inf; }).find("keypoints[19].y = inf") != std::string::npos);
  CHECK(refusal([&](K& k, D&) { k.keypoints[0].angle = nan; }).find("keypoints[0].angle = nan") != std::string::npos);
  CHECK(refusal([&](K& k, D&) { k.keypoints[1].u_right = nan; }).find("keypoints[1].u_right") != std::string::npos);
  CHECK(refusal([&](K& k, D&) { k.keypoints[1].depth = nan; }).find("keypoints[1].depth") != std::string::npos);
  CHECK(refusal([&](K& k, D&) { k.keypoints[5].octave = 8; }).find("keypoints[5].octave = 8") != std::string::npos);
  CHECK(refusal([&](K& k, D&) { k.keypoints[5].camera = 2; }).find("keypoints[5].camera = 2") != std::string::npos);
  CHECK(refusal([&](K&, D& d) { d.keypoint_count = -1; }).find("keypoint_count = -1") != std::string::npos);
  CHECK(refusal([&](K&, D& d) { d.keypoints = nullptr; }).find("keypoints = null") != std::string::npos);
  CHECK(refusal([&](K&, D& d) { d.descriptors = nullptr; }).find("descriptors = null") != std::string::npos);
  CHECK(refusal([&](K&, D& d) { d.cameras = nullptr; }).find("cameras = null") != std::string::npos);
  CHECK(refusal([&](K&, D& d) { d.camera_count = 0; }).find("camera_count = 0") != std::string::npos);
  CHECK(refusal([&](K& k, D&) { k.cameras[1].T_camera_body.tx = nan; }).find("T_camera_body") != std::string::npos);
  CHECK(refusal([&](K& k, D&) { k.cameras[1].T_camera_body.tx = k.cameras[1].T_camera_body.ty = 1e308; }).empty());
  CHECK(refusal([&](K& k, D&) { k.cameras[0].camera.fx = 0; }).find("fx = 0") != std::string::npos);
}

TEST_CASE("bounds of an image are finite, not empty, and can be divided into cells") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  using turbomap::image_bounds;
  const auto refused = [](const image_bounds& bounds) {
    return refusal([&](sample_keyframe&, sample_data& d) { d.bounds = bounds; });
  };
  CHECK(refused({-5, -7, 640, 480}).empty());
  for (const float bad : {nan, -inf}) {
    CHECK(refused({bad, 0, 640, 480}).find("bounds.min_x = ") != std::string::npos);
    CHECK(refused({0, bad, 640, 480}).find("bounds.min_y = ") != std::string::npos);
  }
  for (const float bad : {nan, inf, 3.0F, 2.0F}) {
    CHECK(refused({3, 0, bad, 480}).find("bounds.max_x = ") != std::string::npos);
    CHECK(refused({0, 3, 640, bad}).find("bounds.max_y = ") != std::string::npos);
  }
  CHECK(refused({-3e38F, 0, 3e38F, 480}).find("bounds.max_x - bounds.min_x = inf") != std::string::npos);
  CHECK(refused({0, -3e38F, 640, 3e38F}).find("bounds.max_y - bounds.min_y = inf") != std::string::npos);
  CHECK(refused({0, 0, 1e-38F, 480}).find("bounds.max_x - bounds.min_x = ") != std::string::npos);
  CHECK(refused({0, 0, 640, 1e-38F}).find("bounds.max_y - bounds.min_y = ") != std::string::npos);
  CHECK(refusal([&](sample_keyframe&, sample_data& d) { d.keypoint_count = 0, d.bounds = {nan, 3, 2, inf}; }).empty());
}

/// The message of what packing options throw; empty when nothing does.
std::string options_refusal(int columns, int rows, int levels = 8, float scale_factor = 1.2F) {
  turbomap::keyframe_packing_options options;
  options.grid_columns = columns, options.grid_rows = rows;
  options.pyramid.levels = levels, options.pyramid.scale_factor = scale_factor;
  try {
    turbomap::validate(options);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

TEST_CASE("a grid has columns and rows, or neither, and not too many; a pyramid has levels") {
  for (const auto& [columns, rows] : {std::pair{0, 0}, {1, 1}, {0xFFFF, 0x7FFF}})
    CHECK(options_refusal(columns, rows).empty());
  for (const int columns : {-1, 0x10000})
    CHECK(options_refusal(columns, 1).find("grid_columns = " + std::to_string(columns)) != std::string::npos);
  for (const int rows : {-1, 0, 0x8000})
    CHECK(options_refusal(1, rows).find("grid_rows = " + std::to_string(rows)) != std::string::npos);
  CHECK(options_refusal(0, 1).find("grid_rows = 1") != std::string::npos);
  CHECK(options_refusal(1, 1, 0).find("pyramid.levels = 0") != std::string::npos);
  CHECK(options_refusal(1, 1, 8, 0).find("pyramid.scale_factor = 0") != std::string::npos);

  turbomap::keyframe_packing_options most;
  most.grid_columns = 0xFFFF, most.grid_rows = 0x7FFF;
  auto k = make_keyframe(1, 20, 1);
  turbomap::validate(k.data(), most);  // 65535 * 32767 cells, below 2^31 - 1
  k = make_keyframe(1, 20, 2);
  CHECK_THROWS_AS(turbomap::validate(k.data(), most), std::invalid_argument);
}

TEST_CASE("a view of one's own that names a camera which is not there") {
  std::vector<std::uint8_t> cameras{0, 1, 0, 1, 1};
  sample_view view;
  view.keypoint_count = 5, view.camera_count = 2;
  turbomap::require_cameras(view, "query.view");  // all in camera 0
  view.camera = cameras.data();
  turbomap::require_cameras(view, "query.view");
  for (const std::size_t i : {std::size_t{0}, std::size_t{4}}) {  // the first, the last
    const std::uint8_t then = std::exchange(cameras[i], std::uint8_t{2});
    CHECK_THROWS_WITH_AS(turbomap::require_cameras(view, "query.view"),
                         "turbomap: query.view.camera = 2: must be below the number of cameras", std::invalid_argument);
    if (i == 0) cameras[i] = then;
  }
  view.keypoint_count = 4;
  turbomap::require_cameras(view, "query.view");
  view.keypoint_count = 0, view.camera_count = 0;
  turbomap::require_cameras(view, "query.view");
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

#include <doctest/doctest.h>

#include <turbomap/store/keyframe_validation.hpp>

#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
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
  CHECK(refusal([&](K&, D& d) { d.bounds.max_x = nan; }).find("bounds.max_x = nan") != std::string::npos);
  CHECK(refusal([&](K&, D& d) { d.bounds.max_y = 0; }).find("bounds.max_y = 0") != std::string::npos);
}

TEST_CASE("a view of one's own that names a camera which is not there") {
  std::vector<std::uint8_t> cameras{0, 1, 0, 1, 1};
  sample_view view;
  view.keypoint_count = 5, view.camera_count = 2;
  turbomap::require_cameras(view, "query.view");  // all in camera 0
  view.camera = cameras.data();
  turbomap::require_cameras(view, "query.view");
  cameras[4] = 2;
  std::string message;
  try {
    turbomap::require_cameras(view, "query.view");
  } catch (const std::invalid_argument& error) {
    message = error.what();
  }
  CHECK(message == "turbomap: query.view.camera = 2: must be below the number of cameras");
  view.keypoint_count = 4;
  turbomap::require_cameras(view, "query.view");
  view.keypoint_count = 0, view.camera_count = 0;
  turbomap::require_cameras(view, "query.view");
}

}  // namespace

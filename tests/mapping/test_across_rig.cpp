// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Landmarks that only the two cameras of one keyframe show: the mapper makes points of them where neighbours.across_rig says so,
/// and points are made from tracks.

#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace {

using orb = turbomap::binary_descriptor<256>;
using camera = turbomap::pinhole<float>;
using map_type = turbomap::simple_map<orb, camera>;

constexpr int known = 30, fresh = 20, bytes = 32;

/// Two keyframes see known points with their first camera; the newer one sees fresh landmarks with both. How many points are made?
/// \param ratio   creation_options::lookalike_ratio
/// \param copies  the second camera sees each fresh landmark's copy beside it
/// \param shared  so many of the fresh landmarks are seen by the older keyframe, too
/// \param search  search_options::across_rig, whatever the rule is
std::size_t points_made(bool across_rig, turbomap::creation_rule rule, double ratio = 0.8, bool copies = false,
                        int shared = 0, bool search = false) {
  auto options = turbomap::local_mapper_options::monocular();
  for (const auto stage : {turbomap::mapping_stage::point_culling, turbomap::mapping_stage::fusion,
                           turbomap::mapping_stage::adjustment, turbomap::mapping_stage::keyframe_culling})
    options.enabled[stage] = false;
  options.neighbours.across_rig = across_rig, options.creation.rule = rule;
  options.creation.lookalike_ratio = ratio, options.search.across_rig = search;
  turbomap::context ctx;
  map_type map;
  turbomap::keyframe_store<orb, camera> store;
  turbomap::local_mapper mapper(ctx, map, store, options);
  std::array<turbomap::rig_camera<camera>, 2> rig{};
  for (auto& c : rig) c.camera = camera{400, 400, 320, 240};
  rig[1].T_camera_body.tx = -0.3;
  std::mt19937 random(5);
  std::vector<std::uint8_t> looks((known + fresh) * bytes);
  for (auto& d : looks) d = static_cast<std::uint8_t>(random());
  std::vector<turbomap::map_point_id> points;
  turbomap::map_keyframe_id before;
  for (const double x : {0.0, 0.4}) {
    std::vector<turbomap::keypoint> keypoints;
    std::vector<std::uint8_t> descriptors;
    const auto see = [&](int landmark, int in, double aside = 0) {
      const double X = 0.4 * (landmark % 10 - 4.5), Y = 0.4 * (landmark / 10 - 2);  // 4 m away
      turbomap::keypoint k;
      k.x = static_cast<float>(320 + 100 * (X + aside - x - 0.3 * in)), k.y = static_cast<float>(240 + 100 * Y);
      k.camera = static_cast<std::uint8_t>(in);
      keypoints.push_back(k);
      const auto look = looks.begin() + landmark * bytes;
      descriptors.insert(descriptors.end(), look, look + bytes);
    };
    for (int l = 0; l < known; ++l) see(l, 0);
    if (x == 0)
      for (int l = known; l < known + shared; ++l) see(l, 0);
    if (x > 0)
      for (const int in : {0, 1})
        for (int l = known; l < known + fresh; ++l) see(l, in);
    if (x > 0 && copies)
      for (int l = known; l < known + fresh; ++l) see(l, 1, 0.15);
    turbomap::rigid_transform<double> T_cw;
    T_cw.tx = -x;
    const auto id = map.add_keyframe(keypoints, T_cw, x, before);
    for (int l = 0; l < known; ++l) {
      if (x == 0) points.push_back(map.add_point({0.4 * (l % 10 - 4.5), 0.4 * (l / 10 - 2), 4}, id));
      turbomap::observe(map, points[static_cast<std::size_t>(l)], id, static_cast<std::size_t>(l));
    }
    mapper.insert(
        id,
        turbomap::keyframe_data<orb, camera>{
            static_cast<int>(keypoints.size()), keypoints.data(), descriptors.data(), rig.data(), 2, {0, 0, 640, 480}});
    before = id;
  }
  return mapper.process(before).points_created;
}

}  // namespace

TEST_CASE("what only the cameras of one keyframe see") {
  using turbomap::creation_rule;
  CHECK(points_made(true, creation_rule::tracks) == fresh);
  CHECK(points_made(false, creation_rule::tracks) == 0);
  CHECK(points_made(true, creation_rule::pairs) == 0);
}

TEST_CASE("points of pairs are the same, whether or not the search matches the cameras of one keyframe") {
  using turbomap::creation_rule;
  constexpr int shared = 12;
  for (const bool search : {false, true})
    CHECK(points_made(false, creation_rule::pairs, 0.8, false, shared, search) == shared);
}

TEST_CASE("what only the cameras of one keyframe see, where its copy is beside it") {
  using turbomap::creation_rule;
  CHECK(points_made(true, creation_rule::tracks, 0, true) == fresh);
  CHECK(points_made(true, creation_rule::tracks, 0.8, true) == 0);
}

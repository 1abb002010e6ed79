// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Local adjustment with a lens of more than 180 degrees: what lies beyond 90 degrees from the axis is seen, though its depth
// is negative.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cmath>
#include <random>
#include <vector>

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>
#include <turbomap/map/simple_map/simple_map_traits.hpp>
#include <turbomap/mapping/local_adjustment.hpp>

#include "support/policies.hpp"

namespace {

using turbomap_test::sequential;
using descriptor = turbomap::binary_descriptor<256>;
using lens = turbomap::kannala_brandt<float>;
using wide_map = turbomap::simple_map<descriptor, lens>;

TEST_CASE("observations beyond 90 degrees stay in the map, and wrong ones go") {
  using turbomap::operator*;
  const lens camera{150, 150, 256, 256, 0, 0, 0, 0};
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> normal;
  std::vector<turbomap::vec3<double>> truth;
  for (int i = 0; i < 200; ++i) {
    const double from_axis = 1.68 * uniform(random), turn = 6.283 * uniform(random), d = 4 + 6 * uniform(random);
    truth.push_back(
        {d * std::sin(from_axis) * std::cos(turn), d * std::sin(from_axis) * std::sin(turn), d * std::cos(from_axis)});
  }
  using turbomap::map_keyframe_id;
  using turbomap::map_point_id;
  turbomap::context<sequential> ctx{sequential{}};
  wide_map map;
  turbomap::store_of<wide_map, sequential> store;
  turbomap::handle_table stored;
  turbomap::guard_times held;
  const auto rig = turbomap::make_mono_rig(camera);
  std::vector<map_point_id> points(truth.size());
  std::vector<map_keyframe_id> keyframes;
  std::size_t beyond = 0, wrong = 0;
  for (int f = 0; f < 6; ++f) {
    turbomap::rigid_transform<double> T;
    T.tx = -0.15 * f, T.ty = 0.05 * f;
    std::vector<turbomap::keypoint> keypoints;
    std::vector<std::size_t> seen;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const auto x = turbomap::to_isometry<double>(T) * truth[i];
      turbomap::vec2<double> p{};
      if (!camera.project(x, p) || std::hypot(p.x - 256, p.y - 256) > 255) continue;
      turbomap::keypoint k;
      const bool off = f == 3 && i % 20 == 7;
      wrong += off ? 1 : 0, beyond += x.z <= 0 ? 1 : 0;
      k.x = static_cast<float>(p.x + 0.3 * normal(random) + (off ? 40 : 0));
      k.y = static_cast<float>(p.y + 0.3 * normal(random));
      keypoints.push_back(k), seen.push_back(i);
    }
    if (f > 1) T.tx += 0.01 * normal(random), T.ty += 0.01 * normal(random);
    keyframes.push_back(map.add_keyframe(keypoints, T));
    const std::vector<descriptor::element> descriptors(keypoints.size() * descriptor::elements);
    turbomap::keyframe_data<descriptor, lens> data;
    data.keypoint_count = static_cast<int>(keypoints.size());
    data.keypoints = keypoints.data(), data.descriptors = descriptors.data();
    data.cameras = rig.view().cameras, data.camera_count = 1, data.bounds = {-100, -100, 612, 612};
    stored.add(turbomap::map_traits<wide_map>::id(map, keyframes.back()), store.insert(data));
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const auto l = seen[i];
      if (points[l] == map_point_id{}) {
        const auto& x = truth[l];
        points[l] = map.add_point({x.x + 0.02 * normal(random), x.y + 0.02 * normal(random), x.z}, keyframes.back());
      }
      turbomap::observe(map, points[l], keyframes.back(), i);
    }
  }
  REQUIRE(beyond > 50);
  REQUIRE(wrong > 3);
  turbomap::local_adjustment<wide_map, sequential> adjust(ctx);
  const auto summary = adjust({ctx, map, store, stored, held}, keyframes.back(), {});
  CHECK(summary.solve.accepted > 0);
  CHECK(summary.outliers >= wrong);
  CHECK(summary.outliers < wrong + 10);  // of about 1000, by chance
  CHECK(summary.points_erased < 3);
}

}  // namespace

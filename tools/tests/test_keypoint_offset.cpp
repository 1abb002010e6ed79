// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// How a recording's keypoints were extracted is told from its observations: 0 for keypoints of the full image, 1 for those of a
// level times its scale, within the standard deviation that is given; and nothing is moved where nothing can be told.

#include "reference/larger_or_nan.hpp"
#include "replay/keypoint_offset.hpp"
#include "simulation/simulate.hpp"
#include "simulation/walks.hpp"

#include <cmath>

#include <doctest/doctest.h>
#include <thrust/execution_policy.h>

namespace sim = turbomap::simulation;
using turbomap::recording;
using turbomap_replay::keypoint_offset;
using turbomap_replay::map_observations;

namespace {

recording simulated(const sim::simulated_rig& rig, std::uint64_t seed) {
  sim::simulation_options options;
  options.motion.most_keyframes = 16, options.seed = seed;
  return sim::simulate(sim::builtin_trajectory(rig.cameras[0].T_bc), rig, options);
}

/// The keypoints as an extractor gives them that multiplies the pixel of the level: where in_full_image() takes back from.
void multiply(recording& r) {
  for (std::size_t k = 0; k < r.kp_xy.size(); ++k) {
    const double s = std::pow(static_cast<double>(r.meta.scale_factor), r.kp_octave[k]);
    const auto move = [&](float x, int size) {
      return static_cast<float>(((static_cast<double>(x) + 0.5) * std::round(size / s) / size - 0.5) * s);
    };
    r.kp_xy[k] = {move(r.kp_xy[k].x, r.meta.width), move(r.kp_xy[k].y, r.meta.height)};
    if (r.kp_uright[k] >= 0) r.kp_uright[k] = move(r.kp_uright[k], r.meta.width);
  }
}

/// What a perfect map would see; each `wrong`-th observation is that of another point. 0: none.
map_observations map_of(const recording& r, std::size_t wrong) {
  map_observations map;
  for (const auto& p : r.sim_point_xyz) map.points.push_back(turbomap::cast<double>(p));
  for (std::size_t f = 0; f < r.keyframe_count(); ++f)
    for (std::size_t row = r.keypoints(f).begin; row < r.keypoints(f).end; ++row) {
      if (r.sim_point_id[row] < 0) continue;
      map.frame.push_back(static_cast<std::int32_t>(f));
      map.keypoint.push_back(static_cast<std::int32_t>(row - r.keypoints(f).begin));
      map.point.push_back(r.sim_point_id[row]);
      if (wrong > 0 && map.point.size() % wrong == 0) std::swap(map.point.back(), map.point[map.point.size() - 2]);
    }
  return map;
}

template <class Camera>
keypoint_offset offset_of(const recording& r, const map_observations& map) {
  std::vector<turbomap::rigid_transform<double>> T_cw;
  for (const auto& T : r.sim_T_cw_true) T_cw.push_back(turbomap::cast<double>(T));
  const thrust::detail::seq_t& policy = thrust::seq;
  return turbomap_replay::estimate_keypoint_offset<Camera>(
      r, policy, map, T_cw, std::vector<std::uint8_t>(T_cw.size(), 1), turbomap_replay::simulated_correlation(r.meta));
}

template <class Camera>
void both_are_told(const sim::simulated_rig& rig, std::size_t wrong) {
  double worst = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    CAPTURE(seed);
    recording r = simulated(rig, seed);
    const map_observations map = map_of(r, wrong);
    const keypoint_offset plain = offset_of<Camera>(r, map);
    multiply(r);
    const keypoint_offset moved = offset_of<Camera>(r, map);
    CAPTURE(plain.json().dump());
    CAPTURE(moved.json().dump());
    CHECK(plain.observations > 1000);
    CHECK_FALSE(plain.multiplied);
    CHECK(moved.multiplied);
    CHECK(plain.sigma > 0);
    CHECK(plain.sigma < 0.1);
    for (const double off : {std::abs(plain.alpha) / plain.sigma, std::abs(moved.alpha - 1) / moved.sigma})
      worst = turbomap_test::larger_or_nan(worst, off);
  }
  CHECK(worst < 4);
  CHECK(worst > 0.05);  // a sigma, not a bound
}

}  // namespace

TEST_CASE("how the keypoints of two rectified cameras were extracted is told") {
  both_are_told<turbomap::pinhole<float>>(sim::euroc_rig(), 0);
}
TEST_CASE("... of two fisheye cameras") { both_are_told<turbomap::kannala_brandt<float>>(sim::tum_vi_rig(), 0); }
TEST_CASE("... of one camera") { both_are_told<turbomap::pinhole<float>>(sim::monocular(sim::euroc_rig()), 0); }

TEST_CASE("some wrong observations do not turn the decision") {
  for (const bool multiplied : {false, true}) {
    CAPTURE(multiplied);
    recording r = simulated(sim::euroc_rig(), 4);
    const map_observations map = map_of(r, 400);
    if (multiplied) multiply(r);
    const keypoint_offset found = offset_of<turbomap::pinhole<float>>(r, map);
    CAPTURE(found.json().dump());
    CHECK(found.multiplied == multiplied);
  }
}

TEST_CASE("what tells nothing moves nothing") {
  recording r = simulated(sim::euroc_rig(), 1);
  multiply(r);
  CHECK_FALSE(offset_of<turbomap::pinhole<float>>(r, {}).multiplied);
  map_observations one = map_of(r, 0);
  one.frame.resize(1), one.keypoint.resize(1), one.point.resize(1);
  CHECK(offset_of<turbomap::pinhole<float>>(r, one).observations == 0);
  CHECK_FALSE(offset_of<turbomap::pinhole<float>>(r, one).multiplied);
  const map_observations whole = map_of(r, 0);
  std::fill(r.kp_octave.begin(), r.kp_octave.end(), std::uint8_t{0});  // no offset at the finest level
  const keypoint_offset same = offset_of<turbomap::pinhole<float>>(r, whole);
  CAPTURE(same.json().dump());
  CHECK_FALSE(same.multiplied);
}

TEST_CASE("a pyramid whose coarsest level is less than a pixel is not estimated, and does not throw") {
  recording r = simulated(sim::euroc_rig(), 1);
  multiply(r);
  const map_observations map = map_of(r, 0);
  r.meta.scale_factor = 5;
  CHECK_FALSE(offset_of<turbomap::pinhole<float>>(r, map).multiplied);
  r.meta.scale_factor = 2, r.meta.height = 64;  // half a pixel, which extractors round to none
  CHECK_FALSE(offset_of<turbomap::pinhole<float>>(r, map).multiplied);
}

TEST_CASE("alpha is nearer to 1 than to anything else, with a sigma") {
  const auto decide = [](double least, double alpha, double curvature, double freedom) {
    double cost[3];
    for (int step = 0; step < 3; ++step) {
      const double from_best = 0.5 * step - alpha;
      cost[step] = least + curvature * from_best * from_best;
    }
    return turbomap_replay::offset_of_costs(cost, freedom, 7);
  };
  const keypoint_offset one = decide(1000, 1, 100, 1000);  // sigma 1/10
  CHECK(one.alpha == doctest::Approx(1));
  CHECK(one.sigma == doctest::Approx(0.1));
  CHECK(one.observations == 7);
  CHECK(one.multiplied);
  CHECK_FALSE(decide(1000, 0, 100, 1000).multiplied);
  CHECK_FALSE(decide(1000, 0.85, 100, 1000).multiplied);  // less than four sigmas above 1/2
  CHECK(decide(1000, 1.85, 100, 1000).multiplied);        // ... above 3/2
  CHECK_FALSE(decide(1000, 3, 100, 1000).multiplied);
  for (const keypoint_offset& none : {decide(-1, 1, 100, 1000), decide(0, 1, 128, 1000), decide(1000, 1, 0, 1000),
                                      decide(1000, 1, -100, 1000), decide(std::nan(""), 1, 100, 1000)}) {
    CHECK(none.sigma == 0);
    CHECK(none.alpha == 0);
    CHECK_FALSE(none.multiplied);
  }
}

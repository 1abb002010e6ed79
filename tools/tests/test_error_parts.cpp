// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// What the error of a map comes from: a map of all true observations has the error of the batch adjustment, and each part
// puts right what it says, and no more.

#include "replay/error_parts.hpp"
#include "simulation/simulate.hpp"
#include "simulation/walks.hpp"

#include <doctest/doctest.h>
#include <thrust/execution_policy.h>

namespace sim = turbomap::simulation;
using turbomap::recording;
using turbomap_replay::map_observations;

namespace {

using poses = std::vector<turbomap::rigid_transform<double>>;

recording simulated() {
  auto rig = sim::euroc_rig();
  rig.disparity_noise_px *= 0.5 / rig.noise_px, rig.noise_px = 0.5;
  sim::simulation_options options;
  options.motion.most_keyframes = 8;
  return sim::simulate(sim::builtin_trajectory(rig.cameras[0].T_bc), rig, options);
}

/// A map of every scene point that is seen twice or more, where it is.
map_observations whole_map(const recording& r) {
  map_observations map;
  const auto all = turbomap_replay::gather_true_observations(r);
  map.points = all.points, map.frame = all.frame, map.point = all.landmark;
  std::size_t row = 0;
  for (std::size_t f = 0; f < r.keyframe_count(); ++f) {
    const auto keypoints = r.gather_keypoints(f);
    for (std::size_t k = 0; k < keypoints.size() && row < all.frame.size(); ++k) {
      const bool is_next =
          all.frame[row] == static_cast<std::int32_t>(f) && all.pixel[row].x == static_cast<double>(keypoints[k].x) &&
          all.pixel[row].y == static_cast<double>(keypoints[k].y) && r.sim_point_id[r.keypoints(f).begin + k] >= 0;
      if (is_next) map.keypoint.push_back(static_cast<std::int32_t>(k)), ++row;
    }
  }
  REQUIRE(map.keypoint.size() == map.frame.size());
  return map;
}

nlohmann::json parts(const recording& r, const map_observations& map, const std::vector<std::uint8_t>& alive) {
  poses T_cw;
  for (const auto& T : r.sim_T_cw_true) T_cw.push_back(turbomap::cast<double>(T));
  const thrust::detail::seq_t& policy = thrust::seq;
  return turbomap_replay::error_parts<turbomap::pinhole<float>, thrust::detail::seq_t>(r, policy, map, T_cw, alive)();
}

double ate(const nlohmann::json& parts, const char* name) { return parts[name]["ate_rmse_m"].get<double>(); }
std::size_t rows(const nlohmann::json& parts, const char* name) { return parts[name]["observations"]; }

}  // namespace

TEST_CASE("a map of all true observations has the error of the batch adjustment, in every part") {
  const recording r = simulated();
  const map_observations map = whole_map(r);
  const auto json = parts(r, map, std::vector<std::uint8_t>(r.keyframe_count(), 1));
  const double bound =
      turbomap_replay::trajectory_error(r, turbomap_replay::batch_poses<turbomap::pinhole<float>>(r, thrust::seq));
  for (const char* name : {"own", "right", "joined", "known", "all"}) {
    CAPTURE(name);
    CHECK(ate(json, name) == doctest::Approx(bound).epsilon(1e-3));
    CHECK(rows(json, name) == map.frame.size());
  }
}

TEST_CASE("each part puts right what it says") {
  const recording r = simulated();
  const std::vector<std::uint8_t> alive(r.keyframe_count(), 1);
  const map_observations whole = whole_map(r);
  const std::size_t observations = whole.frame.size();
  const double bound = ate(parts(r, whole, alive), "all");

  // Every other row is gone; a keypoint of each tenth row that is left sees another point than it shows.
  map_observations map;
  map.points = whole.points;
  std::size_t wrong = 0;
  for (std::size_t row = 0; row < observations; row += 2) {
    map.frame.push_back(whole.frame[row]), map.keypoint.push_back(whole.keypoint[row]);
    map.point.push_back(whole.point[row]);
  }
  std::vector<int> views(map.points.size(), 0);
  for (const auto p : map.point) ++views[static_cast<std::size_t>(p)];
  for (std::size_t row = 0; row + 1 < map.frame.size() && wrong < 20; row += 10) {
    const auto from = static_cast<std::size_t>(map.point[row]), to = static_cast<std::size_t>(map.point[row + 1]);
    if (views[from] < 3 || views[to] < 3) continue;
    map.point[row] = static_cast<std::int32_t>(to), --views[from], ++wrong;
    views[to] = 0;  // no second one
  }
  REQUIRE(wrong > 5);
  // One point in three is there twice, for even and for odd keyframes.
  const std::size_t before = map.points.size();
  for (std::size_t p = 0; p < before; p += 3) {
    const auto copy = static_cast<std::int32_t>(map.points.size());
    map.points.push_back(map.points[p]);
    for (std::size_t row = 0; row < map.frame.size(); ++row)
      if (map.point[row] == static_cast<std::int32_t>(p) && map.frame[row] % 2 == 1) map.point[row] = copy;
  }
  const auto json = parts(r, map, alive);
  CHECK(rows(json, "own") == map.frame.size());
  CHECK(rows(json, "own") - rows(json, "right") >= wrong / 2);  // of two votes either may win
  CHECK(rows(json, "own") - rows(json, "right") <= wrong);
  CHECK(rows(json, "joined") == rows(json, "right"));
  CHECK(json["joined"]["points"].get<std::size_t>() < json["right"]["points"].get<std::size_t>());
  CHECK(rows(json, "known") > rows(json, "joined"));
  CHECK(rows(json, "all") == observations);
  CHECK(ate(json, "own") > 2 * ate(json, "right"));
  CHECK(ate(json, "all") == doctest::Approx(bound).epsilon(1e-9));
}

TEST_CASE("keyframes that have left the map take no part") {
  const recording r = simulated();
  std::vector<std::uint8_t> alive(r.keyframe_count(), 1);
  alive[0] = alive[4] = 0;
  const map_observations whole = whole_map(r);
  map_observations map;
  map.points = whole.points;
  for (std::size_t row = 0; row < whole.frame.size(); ++row) {
    if (alive[static_cast<std::size_t>(whole.frame[row])] == 0) continue;
    map.frame.push_back(whole.frame[row]), map.keypoint.push_back(whole.keypoint[row]);
    map.point.push_back(whole.point[row]);
  }
  const auto json = parts(r, map, alive);
  CHECK(rows(json, "all") <= rows(json, "own"));  // points that one keyframe sees tell it nothing
  CHECK(ate(json, "all") > 0);
  CHECK(ate(json, "all") == doctest::Approx(ate(json, "own")).epsilon(1e-3));
}

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The batch adjustment of a simulated recording: made of all true observations and of nothing else, exact without noise, and
// nearer to the truth with less of it.

#include "replay/trajectory_errors.hpp"
#include "simulation/simulate.hpp"
#include "simulation/walks.hpp"

#include <map>
#include <set>

#include <doctest/doctest.h>
#include <thrust/execution_policy.h>

namespace sim = turbomap::simulation;
using turbomap::recording;

namespace {

recording simulated(sim::simulated_rig rig, double noise, int keyframes = 10) {
  rig.disparity_noise_px *= noise / rig.noise_px, rig.noise_px = noise;
  sim::simulation_options options;
  options.motion.most_keyframes = keyframes;
  return sim::simulate(sim::builtin_trajectory(rig.cameras[0].T_bc), rig, options);
}

nlohmann::json errors(const recording& r) {
  nlohmann::json json;
  std::vector<turbomap::rigid_transform<double>> T_cw;
  for (const auto& T : r.T_cw) T_cw.push_back(turbomap::cast<double>(T));
  if (r.meta.is_fisheye())
    turbomap_replay::add_trajectory_errors<turbomap::kannala_brandt<float>>(r, thrust::seq, T_cw, {}, json);
  else
    turbomap_replay::add_trajectory_errors<turbomap::pinhole<float>>(r, thrust::seq, T_cw, {}, json);
  return json;
}

}  // namespace

TEST_CASE("the true observations are those of points seen twice or more, as they were seen") {
  for (const recording& r : {simulated(sim::euroc_rig(), 0.5, 5), simulated(sim::tum_vi_rig(), 1, 4)}) {
    std::map<std::int32_t, std::size_t> views;
    for (const auto p : r.sim_point_id) views[p] += p >= 0;
    std::size_t expected = 0, points = 0;
    for (const auto& [p, n] : views)
      if (n >= 2) expected += n, ++points;
    const auto all = turbomap_replay::gather_true_observations(r);
    REQUIRE(all.points.size() == points);
    REQUIRE(all.frame.size() == expected);
    CHECK(all.T_cw.size() == r.keyframe_count());
    std::set<std::uint8_t> cameras(all.camera.begin(), all.camera.end());
    CHECK(cameras.size() == (r.meta.is_fisheye() ? 2 : 1));
    std::size_t row = 0;
    for (std::size_t i = 0; i < r.keyframe_count(); ++i)
      for (std::size_t k = r.keypoints(i).begin; k < r.keypoints(i).end; ++k) {
        const auto p = r.sim_point_id[k];
        if (p < 0 || views[p] < 2) continue;
        CHECK(all.frame[row] == static_cast<std::int32_t>(i));
        CHECK(all.pixel[row].x == static_cast<double>(r.kp_xy[k].x));
        CHECK(all.pixel[row].z == static_cast<double>(r.kp_uright[k]));
        CHECK(all.points[static_cast<std::size_t>(all.landmark[row])].x ==
              static_cast<double>(r.sim_point_xyz[static_cast<std::size_t>(p)].x));
        ++row;
      }
  }
}

TEST_CASE("errors: none without noise, in proportion with it; a monocular recording is aligned with scale") {
  for (const auto& rig : {sim::euroc_rig(), sim::tum_vi_rig(), sim::monocular(sim::euroc_rig())}) {
    const auto exact = errors(simulated(rig, 1e-4)), half = errors(simulated(rig, 0.5)),
               one = errors(simulated(rig, 1));
    CHECK(exact["ate_batch_rmse_m"].get<double>() < 1e-5);  // pixels are float32
    CHECK(half["ate_batch_rmse_m"].get<double>() > 1e-4);
    CHECK(half["ate_batch_rmse_m"].get<double>() < 0.02);
    const double ratio = one["ate_batch_rmse_m"].get<double>() / half["ate_batch_rmse_m"].get<double>();
    CHECK(ratio == doctest::Approx(2).epsilon(0.1));
    CHECK(half["ate_input_rmse_m"] == half["ate_rmse_m"]);  // the poses that came in are those that were judged
    CHECK_FALSE(half.contains("peer_ate_rmse_m"));
  }
}

TEST_CASE("nothing is said of what is not known") {
  recording r = simulated(sim::euroc_rig(), 0.5, 4);
  r.sim_point_id.clear();
  r.meta.ate_kf_rmse_m = 0.25;
  CHECK_FALSE(errors(r).contains("ate_batch_rmse_m"));
  CHECK(errors(r)["peer_ate_rmse_m"] == 0.25);
  r.gt_T_wb.clear(), r.gt_t_ns.clear();
  CHECK(errors(r).is_null());
  recording blind = simulated(sim::euroc_rig(), 0.5, 4);  // clutter only: poses stay where they begin
  for (auto& p : blind.sim_point_id) p = -1;
  CHECK(errors(blind)["ate_batch_rmse_m"].get<double>() < 1e-6);
}

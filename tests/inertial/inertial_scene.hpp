// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A small visual-inertial problem, as the library takes it.

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <turbomap/adjustment/levenberg_marquardt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/inertial/inertial_factors.hpp>
#include <turbomap/inertial/inertial_frame.hpp>
#include <turbomap/inertial/predict.hpp>

#include "preintegration_cases.hpp"

namespace turbomap_test {

using turbomap::bias_walk_factor;
using turbomap::inertial_factor;
using turbomap::inertial_frame;
using turbomap::inertial_prior_factor;
using turbomap::inertial_state;
using turbomap::isometry;
using inertial_camera = turbomap::pinhole<double>;

/// What the problem of a scene is made of.
template <class Policy, class Factor = inertial_factor>
using inertial_problem = turbomap::bundle_problem<
    Policy, inertial_frame, turbomap::reprojections<inertial_camera>, turbomap::frame_pair_factors<Factor>,
    turbomap::frame_pair_factors<Factor, turbomap::huber>, turbomap::frame_pair_factors<bias_walk_factor>,
    turbomap::frame_factors<inertial_prior_factor>>;

/// Keyframes every 0.25 s on a lively motion. The first inertial edge is robust and down-weighted.
struct inertial_scene {
  std::vector<turbomap::rig_camera<inertial_camera>> rig{{{435, 436, 367, 252}, {}, 47.9, {}}};
  isometry<double> T_bc;
  vec3<double> gravity{0, 0, -9.81};
  std::vector<inertial_state<double>> truth, states;
  std::vector<std::uint8_t> fixed;
  std::vector<std::uint32_t> held;
  std::vector<vec3<double>> true_points, points;
  std::vector<std::int32_t> frame, landmark;
  std::vector<vec3<double>> pixel;
  std::vector<double> information;
  std::vector<std::int32_t> first, second;  ///< of inertial edges; the first one is the robust one
  std::vector<inertial_factor::row> edges;
  std::vector<bias_walk_factor::row> walks;
  std::vector<std::int32_t> prior_frame;
  std::vector<inertial_prior_factor::row> priors;

  /// \param factor  of the preintegrations, e.g. one whose derivatives are dual numbers
  template <class Policy, class Factor>
  void assign(turbomap::context<Policy>& ctx, inertial_problem<Policy, Factor>& problem, Factor factor) const {
    using turbomap::span;
    using indices = span<const std::int32_t>;
    using rows = span<const inertial_factor::row>;
    turbomap::reprojections<inertial_camera> seen =
        turbomap::huber_reprojections(turbomap::rig_view<inertial_camera>{rig.data(), 1});
    seen.frame = frame, seen.landmark = landmark, seen.pixel = pixel, seen.information = information;
    const std::size_t n = edges.size(), robust = n > 0 ? 1 : 0;
    factor.T_bc = T_bc, factor.gravity = gravity;
    problem.assign(ctx, {states, fixed, held}, {points, {}}, seen,
                   {factor,
                    indices{first.data() + robust, n - robust},
                    indices{second.data() + robust, n - robust},
                    rows{edges.data() + robust, n - robust},
                    {},
                    1e6},
                   {factor, indices{first.data(), robust}, indices{second.data(), robust}, rows{edges.data(), robust},
                    turbomap::huber{16.92}, 1e6},
                   {{}, first, second, walks, {}, 1e6}, {{}, prior_frame, priors, {}, 1e6});
  }
};

inline inertial_scene make_inertial_scene(int frames, int points_per_frame, unsigned seed) {
  using turbomap::operator*;
  using turbomap::operator+;
  inertial_scene s;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const imu_motion m = make_imu_motion(seed, 60 * frames, 0);
  const imu_bias<double> bias{random_vector(random, 0.02), random_vector(random, 0.1)};
  s.T_bc = {turbomap::rotation_exp(random_vector(random, 2)), random_vector(random, 0.1)};
  inertial_state<double> x;
  x.T_cw = turbomap::to_rigid_transform(
      isometry<double>{turbomap::rotation_exp(random_vector(random, 2)), random_vector(random, 1)});
  x.velocity = random_vector(random, 1), x.bias = bias;
  for (int f = 0; f < frames; ++f) {
    s.truth.push_back(x);
    if (f + 1 == frames) break;
    const std::int64_t begin = m.t_ns[3] + f * 250'000'000LL;
    const auto interval = turbomap::find_interval(m.samples(), begin, begin + 250'000'000LL);
    // Integrated where the bias was believed to be: corrected to first order.
    const imu_bias<double> believed{bias.gyro + random_vector(random, 1e-3), bias.acceleration};
    const auto exact = turbomap::preintegrate(m.samples(), interval, bias, {});
    inertial_factor::row edge;
    turbomap::make_inertial_row(turbomap::preintegrate(m.samples(), interval, believed, {}), f == 0 ? 1e-2 : 1, edge);
    bias_walk_factor::row walk;
    turbomap::make_walk_row(exact, walk);
    s.first.push_back(f), s.second.push_back(f + 1), s.edges.push_back(edge), s.walks.push_back(walk);
    x = turbomap::predict(x, exact, s.gravity, s.T_bc);
  }
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int f = 0; f < frames; ++f)
    for (int i = 0; i < points_per_frame; ++i) {
      const double z = 5 + 2 * uniform(random), px = 300 * uniform(random), py = 200 * uniform(random);
      const vec3<double> in_camera{z * px / 435, z * py / 436, z};
      s.true_points.push_back(
          turbomap::inverse(turbomap::to_isometry<double>(s.truth[static_cast<std::size_t>(f)].T_cw)) * in_camera);
      s.points.push_back(s.true_points.back() +
                         vec3<double>{0.03 * normal(random), 0.03 * normal(random), 0.03 * normal(random)});
    }
  for (int f = 0; f < frames; ++f)
    for (std::size_t l = 0; l < s.points.size(); ++l) {
      const auto p = turbomap::to_isometry<double>(s.truth[static_cast<std::size_t>(f)].T_cw) * s.true_points[l];
      const double u = 435 * p.x / p.z + 367, v = 436 * p.y / p.z + 252;
      if (p.z < 1 || std::abs(u - 367) > 400 || std::abs(v - 252) > 300) continue;
      const bool stereo = (l + static_cast<std::size_t>(f)) % 3 != 0;
      s.frame.push_back(f), s.landmark.push_back(static_cast<std::int32_t>(l));
      s.pixel.push_back(
          {u + 0.5 * normal(random), v + 0.5 * normal(random), stereo ? u - 47.9 / p.z + 0.5 * normal(random) : -1});
      s.information.push_back(4);
    }
  for (int f = 0; f < frames; ++f) {
    double step[15];
    for (int i = 0; i < 15; ++i) step[i] = (i < 6 ? 0.01 : i < 9 ? 0.05 : i < 12 ? 1e-3 : 0.02) * normal(random);
    const auto& T = s.truth[static_cast<std::size_t>(f)];
    s.fixed.push_back(f == 0 ? 1 : 0);
    s.states.push_back(f == 0 ? T : turbomap::move_state(step, T));
  }
  s.prior_frame = {frames - 1};
  s.priors.push_back({x.velocity, x.bias, 1, 100, 10});
  return s;
}

}  // namespace turbomap_test

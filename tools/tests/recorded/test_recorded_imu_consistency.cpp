// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Whether a recording's IMU measured what its ground truth says: residuals of preintegrations between true poses, whitened, with
// velocities, biases and the direction of gravity estimated. Their chi-square per degree of freedom is 1 where noise densities,
// covariances, T_bc and times are right, as for an IMU that was simulated along the ground truth.

#include <turbomap/inertial/inertial_factors.hpp>
#include <turbomap/inertial/preintegrate.hpp>
#include <turbomap/io/recording.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <Eigen/Dense>

#include "replay/recorded_imu.hpp"
#include "support/support.hpp"

namespace {

using namespace turbomap_test;
using turbomap::inertial_state;

struct consistency {
  double rotation = 0, velocity = 0, position = 0;  ///< mean square of the whitened residuals
  double per_dof = 0;                               ///< all of them and the walks, per degree of freedom
};

/// Ground truth every `step` of its poses; each unknown state has 9 places: velocity, biases. Two more: turns of gravity.
consistency measure(const turbomap::recording& r, std::size_t step) {
  const turbomap::imu_samples samples{r.imu_t_ns, r.imu};
  const auto options = turbomap_replay::imu_options(r.meta);
  const auto T_bw = [&](std::size_t k) {
    const auto& g = r.gt_T_wb[k];
    return turbomap::inverse(
        turbomap::to_isometry<double>(turbomap::rigid_transform<double>{g.qx, g.qy, g.qz, g.qw, g.px, g.py, g.pz}));
  };
  std::vector<std::size_t> at;
  for (std::size_t k = step; k < r.gt_T_wb.size(); k += step) at.push_back(k);
  std::vector<inertial_state<double>> states;
  for (const std::size_t k : at) states.push_back({turbomap::to_rigid_transform(T_bw(k)), {}, {}});
  const auto n = static_cast<Eigen::Index>(at.size()), size = 9 * n + 2;
  const turbomap::isometry<double> identity = turbomap::inertial_factor{}.T_bc;
  turbomap::vec3<double> gravity{0, 0, -9.81};
  consistency c;
  for (int round = 0; round < 4; ++round) {  // the last one only measures
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(size);
    double total = 0, part[3] = {};
    for (Eigen::Index k = 0; k + 1 < n; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const auto in = turbomap::find_interval(samples, r.gt_t_ns[at[i]], r.gt_t_ns[at[i + 1]]);
      const auto motion = turbomap::preintegrate(samples, in, states[i].bias, options);
      double raw[9], walk[6], W[81];
      turbomap::inertial_jacobian J;
      REQUIRE(turbomap::inertial_whitening(motion, W));
      turbomap::linearise_inertial_residual(motion, identity, states[i], states[i + 1], gravity, raw, J);
      using rows = Eigen::Matrix<double, 9, Eigen::Dynamic, Eigen::RowMajor>;
      const Eigen::Map<const Eigen::Matrix<double, 9, 9, Eigen::RowMajor>> whiten(W);
      rows D(9, 20);
      D << Eigen::Map<const rows>(J.i, 9, 15).rightCols(9), Eigen::Map<const rows>(J.j, 9, 15).rightCols(9),
          Eigen::Map<const rows>(J.gravity, 9, 2);
      const Eigen::Matrix<double, 9, 1> e = whiten * Eigen::Map<const Eigen::Matrix<double, 9, 1>>(raw);
      D = whiten * D;
      for (int p = 0; p < 3; ++p) part[p] += e.segment<3>(3 * p).squaredNorm();
      total += e.squaredNorm();
      const auto place = [&](int column) { return column < 18 ? 9 * k + column : 9 * n + column - 18; };
      for (int row = 0; row < 20; ++row) {
        b[place(row)] -= D.col(row).dot(e);
        for (int column = 0; column < 20; ++column) H(place(row), place(column)) += D.col(row).dot(D.col(column));
      }
      turbomap::bias_walk_residual(states[i].bias, states[i + 1].bias, walk);
      for (int m = 0; m < 6; ++m) {
        const double w = 1 / (m < 3 ? motion.gyro_walk : motion.acceleration_walk);
        const Eigen::Index first = 9 * k + 3 + m, second = first + 9;
        H(first, first) += w, H(second, second) += w, H(first, second) -= w, H(second, first) -= w;
        b[first] += w * walk[m], b[second] -= w * walk[m];
        total += w * walk[m] * walk[m];
      }
    }
    const auto edges = static_cast<double>(n - 1);
    c = {part[0] / (3 * edges), part[1] / (3 * edges), part[2] / (3 * edges),
         total / (15 * edges - static_cast<double>(size))};
    if (round == 3) break;
    const Eigen::VectorXd x = H.ldlt().solve(b);
    for (Eigen::Index k = 0; k < n; ++k) {
      double move[15] = {};
      for (int m = 0; m < 9; ++m) move[6 + m] = x[9 * k + m];
      auto& s = states[static_cast<std::size_t>(k)];
      s = turbomap::move_state(move, s);
    }
    gravity = turbomap::turn_gravity(gravity, &x[9 * n]);
  }
  return c;
}

TEST_CASE("an IMU that was simulated along the ground truth contradicts it by its noise, and no more") {
  for (const char* name : {"tum_room1_inertial", "euroc_v102_inertial"}) {
    const auto directory = data(std::string("recordings/") + name);
    if (!directory) continue;
    const auto r = turbomap::read_recording(*directory);
    for (const std::size_t step : {5, 10, 20}) {
      const consistency c = measure(r, step);
      MESSAGE(std::string(name), ", every ", 0.05 * static_cast<double>(step), " s: mean squares, rotation ",
              c.rotation, ", velocity ", c.velocity, ", position ", c.position, "; chi-square per degree of freedom ",
              c.per_dof);
      // The other's IMU is a real one, and its images are rendered along an estimated trajectory.
      if (r.meta.is_fisheye()) CHECK((c.per_dof > 0.8 && c.per_dof < 1.25));
    }
  }
}

}  // namespace

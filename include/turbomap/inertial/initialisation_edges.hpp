// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What initialise_inertial() compares: for each two keyframes that follow each other, the motion that the IMU measured and the one
/// that the poses say. Residuals are weighed by all that is uncertain in them: the noise of the IMU, the walk of its biases, and the
/// errors of the poses.

#include <cstddef>

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/rotation.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "inertial_residual.hpp"
#include "initialisation_chain.hpp"
#include "initialisation_options.hpp"
#include "preintegration.hpp"

TURBOMAP_BEGIN_NAMESPACE
namespace detail {

/// Edge k is from keyframe k to k + 1. All that is estimated is in an `initialisation`.
class initialisation_edges {
 public:
  initialisation_edges(span<const rigid_transform<double>> T_cw, span<const preintegration<double>> motion,
                       const isometry<double>& T_bc)
      : T_cw_(T_cw), motion_(motion), T_bc_(T_bc), whitening_(motion.size()) {}

  /// The weights of all edges, from the errors of the poses in `found`.
  /// \return false: an edge has none; found.end then says so
  bool weigh(initialisation& found) {
    const double omega = found.rotation_sigma * found.rotation_sigma;
    const double v = found.scale * found.position_sigma * found.scale * found.position_sigma;
    for (std::size_t k = 0; k < motion_.size(); ++k) {
      const raw_edge e = linearise(found, k);
      preintegration<double> p = motion_[k];
      // The biases are one unknown and walk: around their mean by T / 6 of the variance per second.
      const double walks = found.seconds / (6 * p.dt), gyro = walks * p.gyro_walk;
      const double acceleration = walks * p.acceleration_walk;
      mat3<double>* const lower[6] = {&p.C_RR, &p.C_VR, &p.C_VV, &p.C_PR, &p.C_PV, &p.C_PP};
      for (int r = 0; r < 9; ++r)
        for (int c = 0; c < 3 * (r / 3) + 3; ++c) {
          double sum = 0;
          for (int m = 0; m < 6; ++m)  // the biases of i
            sum += (m < 3 ? gyro : acceleration) * e.J.i[15 * r + 9 + m] * e.J.i[15 * c + 9 + m];
          for (int m = 0; m < 6; ++m)
            sum +=
                (m < 3 ? omega : v) * (e.J.i[15 * r + m] * e.J.i[15 * c + m] + e.J.j[15 * r + m] * e.J.j[15 * c + m]);
          (*lower[(r / 3) * (r / 3 + 1) / 2 + c / 3])(r % 3, c % 3) += sum;
        }
      if (inertial_whitening(p, whitening_[k].W)) continue;
      found.end = initialisation_end::interrupted, found.edge = static_cast<int>(k);
      return false;
    }
    return true;
  }

  /// Squared whitened residuals of rotation, and of velocity and position.
  void chi2(const initialisation& found, double& rotation, double& others) const {
    for (std::size_t k = 0; k < motion_.size(); ++k) {
      const raw_edge e = linearise(found, k);
      for (int r = 0; r < 9; ++r) {
        double w = 0;
        for (int m = 0; m <= r; ++m) w += whitening_[k].W[9 * r + m] * e.r[m];
        (r < 3 ? rotation : others) += w * w;
      }
    }
  }

  /// Edge k for the solver. \param linear  the scale is estimated by steps that are added, not by factors
  chain_edge whitened(const initialisation& found, std::size_t k, bool linear) const {
    const raw_edge raw = linearise(found, k);
    constexpr int n = chain_edge::columns, theta = 6;
    double J[9 * n];
    const double dt = motion_[k].dt;
    const mat3<double> B = T_bc_.R * rotation(normalised(T_cw_[k]));
    const vec3<double> down = (1 / norm(found.gravity)) * (B * found.gravity);
    const double along[3] = {down.x, down.y, down.z};
    const double scale[3] = {raw.by_scale.x, raw.by_scale.y, raw.by_scale.z};
    for (int r = 0; r < 9; ++r) {
      double* to = J + n * r;
      for (int c = 0; c < 3; ++c) {
        to[c] = raw.J.i[15 * r + 6 + c], to[3 + c] = raw.J.j[15 * r + 6 + c];
        to[theta + unknown::gyro + c] = raw.J.i[15 * r + 9 + c];
        to[theta + unknown::acceleration + c] = raw.J.i[15 * r + 12 + c];
      }
      for (int c = 0; c < 2; ++c) to[theta + unknown::turn + c] = raw.J.gravity[2 * r + c];
      to[theta + unknown::length] = r < 3 ? 0 : (r < 6 ? -dt : -0.5 * dt * dt) * along[r % 3];
      // The residual of position in the unit of the poses is r / scale: its weight moves with the scale, too.
      to[theta + unknown::scale] = r < 6 ? 0 : linear ? scale[r % 3] : found.scale * scale[r % 3] - raw.r[r];
    }
    chain_edge e;
    for (int r = 0; r < 9; ++r) {
      const double* W = whitening_[k].W + 9 * r;
      e.e[r] = 0;
      for (int m = 0; m <= r; ++m) e.e[r] += W[m] * raw.r[m];
      for (int c = 0; c < n; ++c) {
        double sum = 0;
        for (int m = 0; m <= r; ++m) sum += W[m] * J[n * m + c];
        e.J[n * r + c] = sum;
      }
    }
    return e;
  }

 private:
  using unknown = shared_unknowns;
  /// An edge as it stands: residuals, their derivatives by states and gravity, and those of position by the scale.
  struct raw_edge {
    double r[9];
    inertial_jacobian J;
    vec3<double> by_scale;
  };
  struct whitening {
    double W[81];
  };

  raw_edge linearise(const initialisation& found, std::size_t k) const {
    const auto state = [&](std::size_t f) {
      inertial_state<double> x;
      x.T_cw = normalised(T_cw_[f]);
      x.T_cw.tx *= found.scale, x.T_cw.ty *= found.scale, x.T_cw.tz *= found.scale;
      x.velocity = found.velocity[f], x.bias = found.bias;
      return x;
    };
    raw_edge e;
    const auto i = state(k), j = state(k + 1);
    linearise_inertial_residual(motion_[k], T_bc_, i, j, found.gravity, e.r, e.J);
    const mat3<double> B_i = T_bc_.R * rotation(i.T_cw), B_j = T_bc_.R * rotation(j.T_cw);
    e.by_scale = T_bc_.R * translation(T_cw_[k]) - B_i * (transpose(B_j) * (T_bc_.R * translation(T_cw_[k + 1])));
    return e;
  }

  span<const rigid_transform<double>> T_cw_;
  span<const preintegration<double>> motion_;
  const isometry<double> T_bc_;
  plain_vector<whitening> whitening_;
};

}  // namespace detail
TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a bundle adjustment costs, in plain double from the formulas: the oracle for readers, factors and solvers. It uses
/// none of the library's cameras, rotations or kernels.

#include <cmath>
#include <vector>

#include <turbomap/io/bal.hpp>
#include <turbomap/io/reprojection_data.hpp>

namespace turbomap_test {

/// Huber's rho of a squared error.
inline double huber_rho(double chi2, double delta2) {
  return chi2 <= delta2 ? chi2 : 2 * std::sqrt(delta2 * chi2) - delta2;
}

/// A pinhole (k all 0, `fisheye` false), a Kannala-Brandt or a radially distorted pinhole (k[0], k[1]) camera.
struct cost_camera {
  double fx = 1, fy = 1, cx = 0, cy = 0;
  double k[4] = {0, 0, 0, 0};
  bool fisheye = false;
  double bf = 0;                                                ///< px m
  double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, t[3] = {0, 0, 0};  ///< body to camera

  void project(const double (&x)[3], double& u, double& v) const {
    const double r = std::hypot(x[0], x[1]);
    double a = x[0] / x[2], b = x[1] / x[2];
    if (fisheye) {
      const double angle = std::atan2(r, x[2]), a2 = angle * angle;
      const double d = angle * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
      a = r > 0 ? d * x[0] / r : 0, b = r > 0 ? d * x[1] / r : 0;
    } else {
      const double r2 = a * a + b * b, s = 1 + k[0] * r2 + k[1] * r2 * r2;
      a *= s, b *= s;
    }
    u = fx * a + cx, v = fy * b + cy;
  }
};

/// R of a quaternion, which is scaled to unit length.
inline void rotation_matrix(const turbomap::rigid_transform<double>& T, double (&R)[9]) {
  const double n = std::sqrt(T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw);
  const double x = T.qx / n, y = T.qy / n, z = T.qz / n, w = T.qw / n;
  const double m[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                       2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                       2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  for (int i = 0; i < 9; ++i) R[i] = m[i];
}

/// What one observation contributes.
struct observation_cost {
  double chi2, robust, depth;
};

/// chi2, Huber's rho of it and depth of every observation; stereo ones have three residuals.
inline std::vector<observation_cost> observation_costs(const turbomap::reprojection_data& d,
                                                       const std::vector<cost_camera>& rig, double mono_delta2,
                                                       double stereo_delta2) {
  std::vector<observation_cost> all;
  for (std::size_t i = 0; i < d.observation_count(); ++i) {
    const auto& T = d.T_cw[static_cast<std::size_t>(d.frame[i])];
    const auto& X = d.points[static_cast<std::size_t>(d.landmark[i])];
    const cost_camera& c = rig[d.camera.empty() ? 0 : d.camera[i]];
    double R[9], b[3], x[3], u, v;
    rotation_matrix(T, R);
    const double t[3] = {T.tx, T.ty, T.tz};
    for (int r = 0; r < 3; ++r) b[r] = R[3 * r] * X.x + R[3 * r + 1] * X.y + R[3 * r + 2] * X.z + t[r];
    for (int r = 0; r < 3; ++r) x[r] = c.R[3 * r] * b[0] + c.R[3 * r + 1] * b[1] + c.R[3 * r + 2] * b[2] + c.t[r];
    c.project(x, u, v);
    const bool stereo = d.stereo[i] != 0;
    const double e0 = d.pixel[i].x - u, e1 = d.pixel[i].y - v, e2 = stereo ? d.pixel[i].z - (u - c.bf / x[2]) : 0;
    const double chi2 = d.information[i] * (e0 * e0 + e1 * e1 + e2 * e2);
    all.push_back({chi2, huber_rho(chi2, stereo ? stereo_delta2 : mono_delta2), x[2]});
  }
  return all;
}

/// Sum of Huber's rho over all observations, with [ORB-SLAM3]'s deltas.
inline double robust_cost(const turbomap::reprojection_data& d, const std::vector<cost_camera>& rig) {
  double sum = 0;
  for (const auto& o : observation_costs(d, rig, 5.991, 7.815)) sum += o.robust;
  return sum;
}

/// Half the sum of the squared residuals of a BAL problem.
inline double bal_cost(const turbomap::bal_problem& p) {
  double sum = 0;
  for (std::size_t i = 0; i < p.pixel.size(); ++i) {
    const auto& c = p.cameras[static_cast<std::size_t>(p.camera[i])];
    const auto& X = p.points[static_cast<std::size_t>(p.point[i])];
    // Rodrigues: x' = x cos a + (k x X) sin a + k (k . X) (1 - cos a)
    const double a = std::sqrt(c.rotation.x * c.rotation.x + c.rotation.y * c.rotation.y + c.rotation.z * c.rotation.z);
    const double kx = a > 0 ? c.rotation.x / a : 0, ky = a > 0 ? c.rotation.y / a : 0,
                 kz = a > 0 ? c.rotation.z / a : 0;
    const double dot = (kx * X.x + ky * X.y + kz * X.z) * (1 - std::cos(a)), co = std::cos(a), si = std::sin(a);
    const double x = X.x * co + (ky * X.z - kz * X.y) * si + kx * dot + c.translation.x;
    const double y = X.y * co + (kz * X.x - kx * X.z) * si + ky * dot + c.translation.y;
    const double z = X.z * co + (kx * X.y - ky * X.x) * si + kz * dot + c.translation.z;
    const double u = -x / z, v = -y / z, r2 = u * u + v * v, s = c.f * (1 + c.k1 * r2 + c.k2 * r2 * r2);
    sum += (s * u - p.pixel[i].x) * (s * u - p.pixel[i].x) + (s * v - p.pixel[i].y) * (s * v - p.pixel[i].y);
  }
  return sum / 2;
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The cameras that a simulated keyframe is seen with: one pinhole, a rectified pinhole pair, or two fisheye cameras.

#include <array>
#include <cmath>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Geometry>

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/io/recording_data.hpp>

namespace turbomap::simulation {

struct simulated_camera {
  std::variant<pinhole<double>, kannala_brandt<double>> model;
  Eigen::Isometry3d T_bc = Eigen::Isometry3d::Identity();  ///< camera to body
  int width = 0, height = 0;

  /// The pixel of a point in camera coordinates that lies in front; false when there is none.
  bool project(const Eigen::Vector3d& point, Eigen::Vector2d& pixel) const {
    if (!(point.z() > 0.02)) return false;  // m: nothing is seen closer, nor from the side of a fisheye's image circle
    vec2<double> uv{};
    const vec3<double> x{point.x(), point.y(), point.z()};
    if (!std::visit([&](const auto& camera) { return camera.project(x, uv); }, model)) return false;
    pixel = {uv.x, uv.y};
    return true;
  }
  /// The unit ray of a pixel.
  Eigen::Vector3d unproject(const Eigen::Vector2d& pixel) const {
    vec3<double> ray{0, 0, 1};
    std::visit([&](const auto& camera) { return camera.unproject(vec2<double>{pixel.x(), pixel.y()}, ray); }, model);
    return {ray.x, ray.y, ray.z};
  }
  bool is_fisheye() const { return std::holds_alternative<kannala_brandt<double>>(model); }
  std::vector<double> parameters() const {
    if (const auto* p = std::get_if<pinhole<double>>(&model)) return {p->fx, p->fy, p->cx, p->cy};
    const auto& k = std::get<kannala_brandt<double>>(model);
    return {k.fx, k.fy, k.cx, k.cy, k.k1, k.k2, k.k3, k.k4};
  }
};

/// Noise of an inertial sensor: densities per square root of Hz, EuRoC's (sensor.yaml).
struct imu_noise {
  double gyro = 1.6968e-4, acceleration = 2e-3;            ///< rad/s, m/s^2
  double gyro_walk = 1.9393e-5, acceleration_walk = 3e-3;  ///< rad/s^2, m/s^3
  double rate_hz = 200;
  /// Standard deviations of the biases at the start, rad/s and m/s^2. As large as those in EuRoC's ground truth.
  double gyro_bias = 0.04, acceleration_bias = 0.1;
};

struct simulated_rig {
  std::vector<simulated_camera> cameras;  ///< one, or two fisheye ones
  double baseline = 0;                    ///< m; of a rectified pair (one camera here) or between the two; 0: monocular
  double close_depth = 0;                 ///< m
  int features = 1200;                    ///< keypoints per camera
  /// Standard deviations at the finest level (px), scale_factor^octave times as much at others: of u and v, and of the
  /// disparity of a rectified pair. The right image is searched for the left one's patch, so that u_right errs as u does:
  /// the disparity is known four times as well as either. As measured on EuRoC (docs/performance.md, stereo noise).
  double noise_px = 0.5, disparity_noise_px = 0.13;
  imu_noise imu;

  bool rectified() const { return cameras.size() == 1 && baseline > 0; }
  double focal() const { return cameras[0].parameters()[0]; }
};

inline Eigen::Isometry3d rigid(const std::array<double, 16>& row_major) {
  using matrix = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
  Eigen::Isometry3d T(Eigen::Map<const matrix>(row_major.data()));
  T.linear() = Eigen::Quaterniond(T.linear()).normalized().toRotationMatrix();  // files hold rounded rotations
  return T;
}

/// EuRoC's stereo camera after rectification (Burri et al., IJRR 2016), as a stereo system uses it.
inline simulated_rig euroc_rig() {
  simulated_camera left;
  left.model = pinhole<double>{435.204681, 435.204681, 367.451721, 252.200851};
  left.T_bc.linear() = Eigen::Quaterniond(0.712301433, -0.00770718046, 0.0104993237, 0.701752841).toRotationMatrix();
  left.T_bc.translation() = Eigen::Vector3d(-0.0216401462, -0.0646769851, 0.00981073081);
  left.width = 752, left.height = 480;
  simulated_rig rig;
  rig.cameras = {left};
  rig.baseline = 0.110077843, rig.close_depth = 60 * rig.baseline;
  return rig;
}

/// px; the keypoints of each fisheye image are found and matched by themselves.
inline constexpr double fisheye_noise_px = 1;

/// TUM-VI's fisheye pair at 512 x 512 (Schubert et al., IROS 2018).
inline simulated_rig tum_vi_rig() {
  simulated_camera left, right;
  left.model = kannala_brandt<double>{190.97847715128717,     190.9733070521226,     254.93170605935475,
                                      256.8974428996504,      0.0034823894022493434, 0.0007150348452162257,
                                      -0.0020532361418706202, 0.00020293673591811182};
  right.model =
      kannala_brandt<double>{190.44236969414825,    190.4344384721956,    252.59949716835982,   254.91723064636983,
                             0.0034003170790442797, 0.001766278153469831, -0.00266312569781606, 0.0003299517423931039};
  left.T_bc = rigid({-0.9995250378696743, 0.029615343885863205, -0.008522328211654736, 0.04727988224914392,
                     0.0075019185074052044, -0.03439736061393144, -0.9993800792498829, -0.047443232143367084,
                     -0.02989013031643309, -0.998969345370175, 0.03415885127385616, -0.0681999605066297, 0, 0, 0, 1})
                  .inverse();
  right.T_bc =
      rigid({-0.9995110484978581, 0.030299116376600627, -0.0077218830287333565, -0.053697434688869734,
             0.008104079263822521, 0.012511643720192351, -0.9998888851620987, -0.046131737923635924,
             -0.030199136245891378, -0.9994625667418545, -0.012751072573940885, -0.07149261284195751, 0, 0, 0, 1})
          .inverse();
  left.width = right.width = left.height = right.height = 512;
  simulated_rig rig;
  rig.cameras = {left, right};
  rig.baseline = (left.T_bc.inverse() * right.T_bc).translation().norm(), rig.close_depth = 40 * rig.baseline;
  rig.features = 1000;
  rig.noise_px = fisheye_noise_px;
  rig.imu.gyro = 0.00016, rig.imu.acceleration = 0.0028, rig.imu.gyro_walk = 2.2e-5,
  rig.imu.acceleration_walk = 0.00086;
  return rig;
}

/// The rig without its second view.
inline simulated_rig monocular(simulated_rig rig) {
  rig.cameras.resize(1), rig.baseline = 0, rig.close_depth = 0;
  return rig;
}

}  // namespace turbomap::simulation

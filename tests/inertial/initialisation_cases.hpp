// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Random motions of a body with a camera and an IMU: what the IMU measured, what a visual map made of the poses, and the truth.

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <turbomap/inertial/initialise.hpp>
#include <turbomap/inertial/preintegrate.hpp>

namespace turbomap_test {

using turbomap::imu_bias;
using turbomap::imu_sample;
using turbomap::initialisation;
using turbomap::initialisation_end;
using turbomap::initialisation_options;
using turbomap::isometry;
using turbomap::mat3;
using turbomap::preintegration;
using turbomap::rigid_transform;
using turbomap::vec3;
using turbomap::operator*;
using turbomap::operator+;
using turbomap::operator-;

/// `lively`: a camera in a hand. The others do not tell how long a metre is.
enum class motion_kind { lively, still, constant_velocity, pure_rotation, rotation_at_constant_velocity };

/// Sums of sines, with their derivatives.
class wave {
 public:
  wave() = default;
  wave(std::mt19937_64& random, double size) {
    std::uniform_real_distribution<double> u(0, 1);
    for (auto& s : sines_) s = {size * (0.3 + 0.7 * u(random)), 0.7 + 3.5 * u(random), 6.28 * u(random)};
  }
  double value(double t) const { return sum(t, 0); }
  double first(double t) const { return sum(t, 1); }
  double second(double t) const { return sum(t, 2); }

 private:
  struct sine {
    double size = 0, frequency = 1, phase = 0;
  };
  double sum(double t, int derivative) const {
    double x = 0;
    for (const sine& s : sines_) {
      const double a = s.frequency * t + s.phase;
      x += derivative == 0   ? s.size * std::sin(a)
           : derivative == 1 ? s.size * s.frequency * std::cos(a)
                             : -s.size * s.frequency * s.frequency * std::sin(a);
    }
    return x;
  }
  sine sines_[3];
};

struct recorded_motion {
  std::vector<std::int64_t> t_ns, keyframe_ns;
  std::vector<imu_sample> samples;
  std::vector<rigid_transform<double>> T_cw;  ///< as the visual map has them, in a unit of its own
  isometry<double> T_bc;
  // The truth, in the world of the visual map.
  double scale = 1;  ///< metres per unit
  vec3<double> gravity;
  std::vector<vec3<double>> velocity;
  imu_bias<double> bias;  ///< at the start

  turbomap::imu_samples imu() const { return {t_ns, samples}; }
};

struct motion_noise {
  double position = 0.001, rotation = 3e-4;  ///< of the poses, m and rad, each by itself
  double drift = 1e-3;                       ///< random walk of the position, m per m
  turbomap::imu_noise imu;                   ///< EuRoC
  double gyro_bias = 0.04, acceleration_bias = 0.1;
};

inline mat3<double> euler(double yaw, double pitch, double roll) {
  return turbomap::rotation_exp(vec3<double>{0, 0, yaw}) * turbomap::rotation_exp(vec3<double>{0, pitch, 0}) *
         turbomap::rotation_exp(vec3<double>{roll, 0, 0});
}

/// \param scale  metres per unit of the map
inline recorded_motion make_motion(unsigned seed, motion_kind kind, double seconds, double scale,
                                   const motion_noise& noise = {}) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> u(0, 1);
  const auto vector = [&](double sigma) {
    const double x = sigma * normal(random), y = sigma * normal(random);
    return vec3<double>{x, y, sigma * normal(random)};
  };
  const bool moves = kind == motion_kind::lively;
  const bool turns = moves || kind == motion_kind::pure_rotation || kind == motion_kind::rotation_at_constant_velocity;
  const bool drifts = kind == motion_kind::constant_velocity || kind == motion_kind::rotation_at_constant_velocity;
  const wave along[3] = {{random, moves ? 0.25 : 0}, {random, moves ? 0.25 : 0}, {random, moves ? 0.12 : 0}};
  const wave angle[3] = {{random, turns ? 0.2 : 0}, {random, turns ? 0.1 : 0}, {random, turns ? 0.1 : 0}};
  const vec3<double> start = vector(1), speed = drifts || moves ? vector(0.3) : vec3<double>{0, 0, 0};

  recorded_motion m;
  m.scale = scale;
  m.T_bc = {turbomap::rotation_exp(vector(1)), vector(0.05)};
  const mat3<double> R_vw = turbomap::rotation_exp(vector(2));  // the visual world is turned against the upright one
  m.gravity = R_vw * vec3<double>{0, 0, -9.81};
  m.bias = {vector(noise.gyro_bias), vector(noise.acceleration_bias)};
  imu_bias<double> bias = m.bias;
  // The camera moves as told; the body with its lever arm: for 'pure rotation' the camera stays where it is.
  const auto R_wb = [&](double t) { return euler(angle[0].value(t), angle[1].value(t), angle[2].value(t)); };
  const auto camera = [&](double t) {
    return start + t * speed + vec3<double>{along[0].value(t), along[1].value(t), along[2].value(t)};
  };
  const vec3<double> arm = turbomap::inverse(m.T_bc).t;  // of the body in the camera
  const mat3<double> R_bc = m.T_bc.R;
  const auto body = [&](double t) { return camera(t) + R_wb(t) * (R_bc * arm); };
  constexpr double h = 1e-4;
  const auto body_velocity = [&](double t) { return (0.5 / h) * (body(t + h) - body(t - h)); };
  const auto body_acceleration = [&](double t) {
    const vec3<double> twice = 2.0 * (R_wb(t) * (R_bc * arm));
    const vec3<double> rotating = (1 / (h * h)) * (R_wb(t + h) * (R_bc * arm) - twice + R_wb(t - h) * (R_bc * arm));
    return vec3<double>{along[0].second(t), along[1].second(t), along[2].second(t)} + rotating;
  };
  const auto body_rate = [&](double t) {
    return (0.5 / h) * turbomap::rotation_log(turbomap::transpose(R_wb(t - h)) * R_wb(t + h));
  };

  constexpr double rate = 200;
  const std::int64_t t0 = 1'500'000'000'000'000'000;
  const double white = std::sqrt(rate), walk = 1 / white;
  for (int i = -2; i <= static_cast<int>(seconds * rate) + 2; ++i) {
    const double t = i / rate;
    const vec3<double> force = turbomap::transpose(R_wb(t)) * (body_acceleration(t) + vec3<double>{0, 0, 9.81});
    m.t_ns.push_back(t0 + static_cast<std::int64_t>(i) * 5'000'000);
    m.samples.push_back({body_rate(t) + bias.gyro + vector(noise.imu.gyro * white),
                         force + bias.acceleration + vector(noise.imu.acceleration * white)});
    bias.gyro = bias.gyro + vector(noise.imu.gyro_walk * walk);
    bias.acceleration = bias.acceleration + vector(noise.imu.acceleration_walk * walk);
  }
  vec3<double> off{0, 0, 0}, before = camera(0);
  for (double t = 0; t <= seconds; t += 0.2 + 0.2 * u(random)) {
    const vec3<double> at = camera(t);
    off = off + vector(noise.drift * turbomap::norm(at - before));
    before = at;
    const mat3<double> R_cw = turbomap::transpose(R_bc) * turbomap::transpose(R_vw * R_wb(t));
    const mat3<double> R = turbomap::rotation_exp(vector(noise.rotation)) * R_cw;
    const vec3<double> seen = (1 / scale) * (R_vw * (at + off + vector(noise.position)));
    m.keyframe_ns.push_back(t0 + static_cast<std::int64_t>(t * 1e9));
    m.T_cw.push_back(turbomap::to_rigid_transform(isometry<double>{R, -1.0 * (R * seen)}));
    m.velocity.push_back(R_vw * body_velocity(t));
  }
  return m;
}

/// Preintegrations of the first so many keyframes.
inline std::vector<preintegration<double>> motions_of(const recorded_motion& m, std::size_t keyframes,
                                                      const imu_bias<double>& bias) {
  std::vector<preintegration<double>> p;
  for (std::size_t k = 0; k + 1 < keyframes; ++k)
    p.push_back(turbomap::preintegrate(
        m.imu(), turbomap::find_interval(m.imu(), m.keyframe_ns[k], m.keyframe_ns[k + 1]), bias, {}));
  return p;
}

/// As a mapper does it: integrated again while the bias asks for it.
inline initialisation initialise(const recorded_motion& m, std::size_t keyframes, const initialisation_options& options,
                                 imu_bias<double>& bias) {
  initialisation found;
  for (int round = 0; round < 3; ++round) {
    const auto motion = motions_of(m, keyframes, bias);
    found = turbomap::initialise_inertial({m.T_cw.data(), keyframes}, motion, m.T_bc, options);
    if (!found.integrate_again) break;
    bias = found.bias;
  }
  return found;
}

}  // namespace turbomap_test

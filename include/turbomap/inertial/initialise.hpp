// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A visual map does not know where down is, how fast the body moves, what its IMU measures wrongly and, with one camera, how
/// long a metre is. All of that follows from comparing the poses of some keyframes with what the IMU measured between them: the
/// maximum a posteriori estimate of gravity's direction, scale, velocities and biases, with the poses fixed
/// [Campos, Montiel, Tardos: Inertial-only optimization for visual-inertial initialization, ICRA 2020].
///
/// Ours beyond it: the errors of the poses are estimated too, and positions are compared in the unit of the poses. So weak motion
/// gives a large standard deviation, not a scale that is too small, and the answer is 'not initialised'.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/linear.hpp"
#include "../math/rotation.hpp"
#include "../span.hpp"
#include "bias_update.hpp"
#include "imu_check.hpp"
#include "inertial_residual.hpp"
#include "initialisation_chain.hpp"
#include "initialisation_options.hpp"
#include "preintegration.hpp"

TURBOMAP_BEGIN_NAMESPACE
namespace detail {

constexpr int weighing_rounds = 8;  ///< the weights settle before the last steps

/// One estimate, from start to end.
class initialiser {
 public:
  initialiser(span<const rigid_transform<double>> T_cw, span<const preintegration<double>> motion,
              const isometry<double>& T_bc, const initialisation_options& options)
      : T_cw_(T_cw), motion_(motion), T_bc_(T_bc), options_(options), whitening_(motion.size()) {}

  void run(initialisation& found) {
    if (!estimate(found)) return;
    const preintegration_options limits;
    for (const auto& p : motion_)
      found.integrate_again =
          found.integrate_again || (is_finite(sum_of(found.bias)) && needs_integration(p, found.bias, limits));
  }

 private:
  /// \return whether what was found says something of the bias: what no step led to does not
  bool estimate(initialisation& found) {
    constexpr int linear_rounds = 2;
    start(found);
    bool converged = false;
    for (; found.iterations < options_.max_iterations && !converged; ++found.iterations) {
      found.end = initialisation_end::not_converged;
      const bool linear = found.iterations < linear_rounds, weighs = found.iterations < weighing_rounds;
      if ((weighs && !weigh(found, !linear)) || !step(found, linear, converged))
        return found.end == initialisation_end::scale_unknown;
      converged = converged && !weighs;
    }
    judge(found, converged);
    return true;
  }
  static double sum_of(const imu_bias<double>& b) {
    return b.gyro.x + b.gyro.y + b.gyro.z + b.acceleration.x + b.acceleration.y + b.acceleration.z;
  }

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

  /// Gravity from the mean of what was measured, everything else from nothing.
  void start(initialisation& found) {
    vec3<double> up{0, 0, 0};
    double path = 0;
    for (std::size_t k = 0; k < motion_.size(); ++k) {
      up = up + transpose(T_bc_.R * rotation(normalised(T_cw_[k]))) * motion_[k].dV;
      path += norm(centre(k + 1) - centre(k));
    }
    if (!(norm(up) > 0)) up = {0, 0, 1};
    found.gravity = (-options_.gravity / norm(up)) * up;
    found.bias = motion_[0].bias;
    found.velocity.resize(T_cw_.size(), vec3<double>{0, 0, 0});
    found.rotation_sigma = std::max(options_.rotation_sigma, 1e-3);  // for a start
    found.position_sigma = std::max(options_.position_sigma, 1e-3 * path / static_cast<double>(motion_.size()));
  }
  vec3<double> centre(std::size_t k) const { return camera_centre(to_isometry<double>(normalised(T_cw_[k]))); }

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

  /// Estimates the errors of the poses from the residuals so far, and from them the weights of all edges.
  /// \return false: an edge has none; found.end then says so
  bool weigh(initialisation& found, bool estimate) {
    if (estimate) {
      double rotation = 0, others = 0;
      chi2(found, rotation, others);
      const auto scaled = [](double sigma, double square, int freedom, double least) {
        return std::max(least, sigma * std::sqrt(std::clamp(square / freedom, 0.01, 100.0)));
      };
      found.rotation_sigma = scaled(found.rotation_sigma, rotation, rotation_freedom(), options_.rotation_sigma);
      found.position_sigma = scaled(found.position_sigma, others, other_freedom(), options_.position_sigma);
    }
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

  int rotation_freedom() const { return 3 * static_cast<int>(motion_.size()) - 3; }
  int other_freedom() const { return 3 * static_cast<int>(motion_.size()) - 8 - (options_.monocular ? 1 : 0); }

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

  /// \param linear  steps of gravity and scale are added: the problem is then linear but for the rotations, so that the first
  ///                step finds them from anywhere; the length of gravity is free then
  bool step(initialisation& found, bool linear, bool& converged) {
    const double g = norm(found.gravity), s = found.scale;
    double information[unknown::count] = {}, gradient[unknown::count] = {};
    const bool held[unknown::count] = {false, false, false, false,   false,
                                       false, false, false, !linear, !options_.monocular};
    const auto known = [&](int k, double off, double sigma) {
      information[k] = 1 / (sigma * sigma), gradient[k] = off / (sigma * sigma);
    };
    const double* const bias[2] = {&found.bias.gyro.x, &found.bias.acceleration.x};
    const double* const expected[2] = {&options_.bias.gyro.x, &options_.bias.acceleration.x};
    for (int k = 0; k < 3; ++k) {
      known(unknown::gyro + k, bias[0][k] - expected[0][k], options_.gyro_bias_sigma);
      known(unknown::acceleration + k, bias[1][k] - expected[1][k], options_.acceleration_bias_sigma);
    }
    known(unknown::length, g - options_.gravity, 1);          // m/s^2: keeps the first steps sane
    known(unknown::scale, linear ? s - 1 : std::log(s), 10);  // never decides: e^10 either way
    chain_.begin(information, gradient, held);
    for (std::size_t k = 0; k < motion_.size(); ++k)
      if (!chain_.add(whitened(found, k, linear))) return false;
    double d[unknown::count];
    if (!chain_.solve(d, steps_)) return false;

    found.bias.gyro = found.bias.gyro + vec3<double>{d[0], d[1], d[2]};
    found.bias.acceleration = found.bias.acceleration + vec3<double>{d[3], d[4], d[5]};
    for (std::size_t f = 0; f < T_cw_.size(); ++f) found.velocity[f] = found.velocity[f] + steps_[f];
    if (linear) {
      vec3<double> basis[2];
      gravity_basis(found.gravity, basis);
      found.gravity = found.gravity + d[unknown::turn] * cross(basis[0], found.gravity) +
                      d[unknown::turn + 1] * cross(basis[1], found.gravity) + (d[unknown::length] / g) * found.gravity;
      found.scale = s + d[unknown::scale];
    } else {
      found.gravity = turn_gravity<double>(found.gravity, d + unknown::turn);
      found.scale = s * std::exp(std::clamp(d[unknown::scale], -1.0, 1.0));
    }
    const double length = norm(found.gravity);
    if (!(length > 0) || !is_finite(length + found.scale)) return false;
    found.gravity = (options_.gravity / length) * found.gravity;
    if (!(found.scale > 0)) {
      found.end = initialisation_end::scale_unknown, found.scale_sigma = std::numeric_limits<double>::infinity();
      return false;
    }
    chain_.variances(variance_);
    converged = true;
    for (int k = 0; k < unknown::count; ++k) converged = converged && d[k] * d[k] <= 1e-12 * variance_[3 + k];
    return true;
  }

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

  void judge(initialisation& found, bool converged) const {
    double rotation = 0, others = 0;
    chi2(found, rotation, others);
    found.chi2 = rotation + others, found.degrees_of_freedom = rotation_freedom() + other_freedom();
    const double factor = std::max(1.0, found.chi2 / found.degrees_of_freedom);
    const auto largest = [&](int from, int count) {
      return std::sqrt(factor * *std::max_element(variance_ + from, variance_ + from + count));
    };
    found.velocity_sigma = largest(0, 3);
    found.gyro_bias_sigma = largest(3 + unknown::gyro, 3);
    found.acceleration_bias_sigma = largest(3 + unknown::acceleration, 3);
    found.gravity_sigma = largest(3 + unknown::turn, 2);
    found.scale_sigma = options_.monocular ? largest(3 + unknown::scale, 1) : 0;
    found.end = !(found.scale_sigma <= options_.max_scale_sigma)       ? initialisation_end::scale_unknown
                : !(found.gravity_sigma <= options_.max_gravity_sigma) ? initialisation_end::gravity_unknown
                : !converged                                           ? initialisation_end::not_converged
                                                                       : initialisation_end::initialised;
  }

  span<const rigid_transform<double>> T_cw_;
  span<const preintegration<double>> motion_;
  const isometry<double> T_bc_;
  const initialisation_options& options_;
  plain_vector<whitening> whitening_;
  velocity_chain chain_;
  plain_vector<vec3<double>> steps_;
  double variance_[velocity_chain::rows];
};

inline void check_initialisation_options(const initialisation_options& o) {
  require(o.min_keyframes >= 5, "options.min_keyframes", o.min_keyframes, "must be 5 at least");
  require_not_negative("options.min_seconds", o.min_seconds);
  require(o.max_iterations > weighing_rounds, "options.max_iterations", o.max_iterations,
          "must be above 8, the steps in which the weights settle: it cannot converge before");
  const auto positive = [](const char* name, double value) {
    require(value > 0 && is_finite(value), name, value, "must be finite and positive");
  };
  positive("options.gravity", o.gravity);
  positive("options.gyro_bias_sigma", o.gyro_bias_sigma);
  positive("options.acceleration_bias_sigma", o.acceleration_bias_sigma);
  require_not_negative("options.rotation_sigma", o.rotation_sigma);
  require_not_negative("options.position_sigma", o.position_sigma);
  require_not_negative("options.max_scale_sigma", o.max_scale_sigma);
  require_not_negative("options.max_gravity_sigma", o.max_gravity_sigma);
  check_bias("options.bias", o.bias);
}

inline void check_motion(std::size_t i, const preintegration<double>& p) {
  const auto name = [i](const char* member) { return element_name("motion", i).append(".").append(member); };
  if (!(p.dt >= 0 && is_finite(p.dt))) reject(name("dt"), p.dt, "must be finite and not negative");
  check_bias(name("bias"), p.bias);
  const double sum = sum_of_elements(p);
  if (!is_finite(sum)) reject(element_name("motion", i), sum, "must hold finite numbers");
}

}  // namespace detail

/// Estimates gravity, velocities, biases and, for one camera, the scale from keyframes in the order of time.
/// \param T_cw     poses in the visual world, in metres, or, options.monocular, in any unit
/// \param motion   motion[k]: what the IMU measured from keyframe k to k + 1. One without duration, preintegration(), stands for
///                 a gap in the data: the answer is then 'interrupted', as no chain of velocities leads across
/// \param T_bc     camera to body, the frame of the IMU; metres
/// \return what was found; `end` says whether it may be used. There is no partial answer.
/// \throws std::invalid_argument  sizes, options, a pose or a preintegration that is not finite
/// O(keyframes * iterations): about 3 us per keyframe and iteration.
inline initialisation initialise_inertial(span<const rigid_transform<double>> T_cw,
                                          span<const preintegration<double>> motion, const isometry<double>& T_bc,
                                          const initialisation_options& options = {}) {
  detail::check_initialisation_options(options);
  require(motion.size() + 1 == T_cw.size() || (motion.empty() && T_cw.empty()), "motion.size()", motion.size(),
          "must be one less than the poses");
  if (!is_pose(to_rigid_transform(T_bc))) reject("T_bc", norm(T_bc.t), "must be a pose");
  initialisation found;
  for (std::size_t i = 0; i < T_cw.size(); ++i)
    if (!is_pose(T_cw[i])) reject(detail::element_name("T_cw", i), T_cw[i].tx, "must be a pose");
  for (std::size_t i = 0; i < motion.size(); ++i) {
    detail::check_motion(i, motion[i]);
    found.seconds += motion[i].dt;
    if (motion[i].dt == 0 && found.edge < 0) found.edge = static_cast<int>(i);
  }
  if (found.edge >= 0) {
    found.end = initialisation_end::interrupted;
  } else if (T_cw.size() < static_cast<std::size_t>(options.min_keyframes)) {
    found.end = initialisation_end::too_few_keyframes;
  } else if (found.seconds < options.min_seconds) {
    found.end = initialisation_end::too_short;
  } else {
    detail::initialiser(T_cw, motion, T_bc, options).run(found);
  }
  return found;
}

TURBOMAP_END_NAMESPACE

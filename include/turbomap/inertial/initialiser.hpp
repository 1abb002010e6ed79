// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The estimate of initialise_inertial(): Gauss and Newton's method on gravity, scale, velocities and biases. The first steps find
/// gravity and scale from anywhere; meanwhile the errors of the poses are estimated from the residuals; the last steps converge with
/// weights that stay.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/linear.hpp"
#include "../math/rotation.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "bias_update.hpp"
#include "inertial_residual.hpp"
#include "initialisation_chain.hpp"
#include "initialisation_check.hpp"
#include "initialisation_edges.hpp"
#include "initialisation_options.hpp"
#include "preintegration.hpp"

TURBOMAP_BEGIN_NAMESPACE
namespace detail {

/// One estimate, from start to end. What it is given was checked.
class initialiser {
 public:
  initialiser(span<const rigid_transform<double>> T_cw, span<const preintegration<double>> motion,
              const isometry<double>& T_bc, const initialisation_options& options)
      : T_cw_(T_cw), motion_(motion), T_bc_(T_bc), options_(options), edges_(T_cw, motion, T_bc) {}

  void run(initialisation& found) {
    if (!estimate(found) || !is_likely(found.bias)) return;
    const preintegration_options limits;
    for (const auto& p : motion_)
      found.integrate_again = found.integrate_again || needs_integration(p, found.bias, limits);
  }

 private:
  using unknown = shared_unknowns;

  /// \return whether what was found says something of the bias: what no step led to does not
  bool estimate(initialisation& found) {
    constexpr int linear_rounds = 2;
    start(found);
    bool converged = false;
    for (; found.iterations < options_.max_iterations && !converged; ++found.iterations) {
      found.end = initialisation_end::not_converged;
      const bool linear = found.iterations < linear_rounds, weighs = found.iterations < weighing_rounds;
      if (weighs && !linear) estimate_pose_errors(found);
      if ((weighs && !edges_.weigh(found)) || !step(found, linear, converged))
        return found.end == initialisation_end::scale_unknown;
      converged = converged && !weighs;
    }
    judge(found, converged);
    return true;
  }
  /// A bias of many deviations is that of poses that are wrong, not of the sensor.
  bool is_likely(const imu_bias<double>& b) const {
    constexpr double most = 5;
    return norm(b.gyro - options_.bias.gyro) <= most * options_.gyro_bias_sigma &&
           norm(b.acceleration - options_.bias.acceleration) <= most * options_.acceleration_bias_sigma;
  }

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

  /// The errors of the poses, from the residuals so far.
  void estimate_pose_errors(initialisation& found) const {
    double rotation = 0, others = 0;
    edges_.chi2(found, rotation, others);
    const auto scaled = [](double sigma, double square, int freedom, double least) {
      return std::max(least, sigma * std::sqrt(std::clamp(square / freedom, 0.01, 100.0)));
    };
    found.rotation_sigma = scaled(found.rotation_sigma, rotation, rotation_freedom(), options_.rotation_sigma);
    found.position_sigma = scaled(found.position_sigma, others, other_freedom(), options_.position_sigma);
  }
  int rotation_freedom() const { return 3 * static_cast<int>(motion_.size()) - 3; }
  int other_freedom() const { return 3 * static_cast<int>(motion_.size()) - 8 - (options_.monocular ? 1 : 0); }

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
      if (!chain_.add(edges_.whitened(found, k, linear))) return false;
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

  void judge(initialisation& found, bool converged) const {
    double rotation = 0, others = 0;
    edges_.chi2(found, rotation, others);
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
  initialisation_edges edges_;
  velocity_chain chain_;
  plain_vector<vec3<double>> steps_;
  double variance_[velocity_chain::rows];
};

}  // namespace detail
TURBOMAP_END_NAMESPACE

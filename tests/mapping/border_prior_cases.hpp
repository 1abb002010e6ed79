// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Windows of a map with a marginal prior of the keyframe before them, beside the adjustment of all keyframes.

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "inertial_window_cases.hpp"

namespace turbomap_test {

inline turbomap::local_adjustment_options to_the_end() {
  auto o = exact();
  o.solve.min_relative_decrease = 1e-14, o.solve.slow_iterations = 3;
  o.outlier_factor = 100;  // all observations stay: the optimum is one of the same terms
  return o;
}
/// The same where derivatives are rounded to float32.
inline turbomap::local_adjustment_options to_the_end_in_mixed_precision() {
  auto o = to_the_end();
  o.solve.numbers = turbomap::precision::mixed;
  return o;
}
inline turbomap::inertial_adjustment_options windows(int keyframes, bool prior) {
  auto o = window_of(keyframes);
  o.window.iterations = 50, o.marginal_prior = prior;
  return o;
}

/// Velocities and biases of the map, in about a standard deviation each; what keyframes [first, end) have.
inline double apart(const inertial_map_scene& a, const inertial_map_scene& b, int first, int end) {
  double worst = 0;
  for (int f = first; f < end; ++f) {
    const auto i = static_cast<std::size_t>(f);
    const auto x = a.keyframes[i], y = b.keyframes[i];
    const double d[3] = {1e2 * turbomap::norm(a.map.velocity(x) - b.map.velocity(y)),
                         1e3 * turbomap::norm(a.map.bias(x).gyro - b.map.bias(y).gyro),
                         1e2 * turbomap::norm(a.map.bias(x).acceleration - b.map.bias(y).acceleration)};
    for (const double off : d) worst = larger_or_nan(worst, off);
  }
  return worst;
}

/// Adjusts all keyframes of a scene until nothing moves any more.
template <class Policy>
void adjust_all(inertial_run<Policy>& run, bool prior,
                const turbomap::local_adjustment_options& options = to_the_end()) {
  const int last = static_cast<int>(run.scene.keyframes.size()) - 1;
  for (int i = 0; i < 3; ++i) run(last, options, windows(last + 1, prior));
}

/// Moves what the IMU told of the last keyframes a little.
inline void disturb(inertial_map_scene& scene, int last) {
  for (std::size_t f = scene.keyframes.size() - static_cast<std::size_t>(last); f < scene.keyframes.size(); ++f) {
    const auto k = scene.keyframes[f];
    scene.map.set_velocity(k, scene.map.velocity(k) + vec3<double>{0.02, -0.01, 0.03});
    scene.map.set_bias(k, {scene.map.bias(k).gyro + vec3<double>{1e-3, 2e-3, -1e-3}, scene.map.bias(k).acceleration});
  }
}

/// Windows that begin later than the last one, disturbed at the optimum of all keyframes and landmarks, come back to it,
/// to the same bits each time; with a keyframe that is fixed instead they do not.
/// \param sizes  of the windows: these begin 10, 8 and 5 keyframes later
template <class Policy>
void check_keeps_optimum(const Policy& policy, const std::vector<int>& sizes = {3, 5, 8},
                         const turbomap::local_adjustment_options& options = to_the_end()) {
  for (const int keyframes : sizes) {
    CAPTURE(keyframes);
    double moved[2];
    for (const bool prior : {true, false}) {
      inertial_map_scene scene;
      inertial_run<Policy> run(policy, scene);
      adjust_all(run, prior, options);
      const inertial_map_scene batch = scene;
      disturb(scene, keyframes);
      const auto summary = run(13, options, windows(keyframes, prior));
      CHECK(summary.solve.accepted > 0);
      CHECK(summary.free_keyframes == static_cast<std::size_t>(keyframes) + (prior ? 1 : 0));
      moved[prior] = apart(scene, batch, 0, 14);
      inertial_map_scene twin;
      inertial_run<Policy> again(policy, twin);
      adjust_all(again, prior, options), disturb(twin, keyframes);
      again(13, options, windows(keyframes, prior));
      CHECK(twin.state() == scene.state());
    }
    MESSAGE(keyframes << " keyframes: " << moved[true] << " from the optimum, " << moved[false]
                      << " with a fixed frame");
    CHECK(moved[true] < 1e-4);
    CHECK(moved[false] > 100 * moved[true]);
  }
}

}  // namespace turbomap_test

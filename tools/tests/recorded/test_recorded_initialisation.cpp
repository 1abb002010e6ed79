// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Initialisation on the recorded system's final maps, whose scale and gravity are known: with and without asking for the scale,
// from many keyframes on.

#include <turbomap/inertial/initialise.hpp>
#include <turbomap/inertial/preintegrate.hpp>
#include <turbomap/io/recording.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "reference/larger_or_nan.hpp"
#include "support/support.hpp"

namespace {

using namespace turbomap_test;
using turbomap::initialisation;
using turbomap::initialisation_options;
using turbomap::preintegration;

/// Keyframes [first, first + count) of `alive`: integrated again while the bias asks for it.
initialisation initialise(const turbomap::recording& r, const std::vector<std::size_t>& alive, std::size_t first,
                          std::size_t count, const initialisation_options& options) {
  const turbomap::imu_samples samples{r.imu_t_ns, r.imu};
  turbomap::preintegration_options with;
  with.noise = {std::sqrt(r.meta.imu_noise_variance[0]), std::sqrt(r.meta.imu_noise_variance[3]),
                std::sqrt(r.meta.imu_walk_variance[0]), std::sqrt(r.meta.imu_walk_variance[3]), 0};
  constexpr double rate = 200;  // Hz, of both sensors: recorded variances are those of a step
  with.noise.gyro /= std::sqrt(rate), with.noise.acceleration /= std::sqrt(rate);
  with.noise.gyro_walk *= std::sqrt(rate), with.noise.acceleration_walk *= std::sqrt(rate);
  std::vector<turbomap::rigid_transform<double>> T_cw;
  for (std::size_t k = 0; k < count; ++k) T_cw.push_back(turbomap::cast<double>(r.final_T_cw[alive[first + k]]));
  initialisation found;
  for (int round = 0; round < 3 && (round == 0 || found.integrate_again); ++round) {
    std::vector<preintegration<double>> motion;
    for (std::size_t k = 0; k + 1 < count; ++k) {
      const auto interval = turbomap::find_interval(samples, r.t_ns[alive[first + k]], r.t_ns[alive[first + k + 1]]);
      motion.push_back(turbomap::preintegrate(samples, interval, found.bias, with));
    }
    found = turbomap::initialise_inertial(T_cw, motion, turbomap::to_isometry<double>(r.meta.T_bc), options);
  }
  return found;
}

TEST_CASE("what is initialised on recorded maps has their scale to 1 % and their gravity") {
  for (const char* name : {"euroc_v102_inertial", "tum_room1_inertial"}) {
    const auto directory = data(std::string("recordings/") + name);
    if (!directory) continue;
    const auto r = turbomap::read_recording(*directory);
    std::vector<std::size_t> alive;
    for (std::size_t i = 0; i < r.keyframe_count(); ++i)
      if (r.final_alive[i] != 0) alive.push_back(i);
    for (const bool monocular : {false, true}) {
      initialisation_options options;
      options.monocular = monocular;
      int tried = 0, initialised = 0;
      double scale = 0, gravity = 0;
      for (std::size_t first = 0; first + 10 <= alive.size(); first += 3, ++tried)
        for (std::size_t count = 10; count <= 40 && first + count <= alive.size(); count += 3) {
          const auto found = initialise(r, alive, first, count, options);
          if (!found) continue;
          ++initialised;
          scale = larger_or_nan(scale, std::abs(found.scale - 1));
          gravity = larger_or_nan(gravity, std::acos(std::min(-found.gravity.z / 9.81, 1.0)));
          break;
        }
      MESSAGE(std::string(name) << std::string(monocular ? ", scale asked for" : ", scale known") << ": " << initialised
                                << " of " << tried << " starts; largest errors: scale " << scale << ", gravity "
                                << gravity << " rad");
      CHECK(scale <= 0.01);
      CHECK(gravity < 0.03);
      CHECK(initialised > (monocular ? 0 : 0.9 * tried));
    }
  }
}

}  // namespace

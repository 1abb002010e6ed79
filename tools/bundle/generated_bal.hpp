// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Makes problems of the form and size of Bundle Adjustment in the Large, for solvers of large problems: a street that cameras
/// look at from the other side. It is not as hard as photographs from the internet: there are no outliers, and errors of the
/// start are small.

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

#include <turbomap/io/bal.hpp>
#include <turbomap/io/bal_factor.hpp>
#include "simulation/random.hpp"

namespace turbomap_bundle {

struct generated_size {
  std::int32_t cameras = 0, points = 0;
  std::int64_t observations = 0;  ///< about so many
};

namespace detail {

inline constexpr int half_window = 20;  ///< cameras to each side of a point that may see it

/// Cameras that see one point, at most: so many are in the window of every point, also at the ends of the street.
inline int most_views(std::int32_t cameras) { return cameras < half_window ? cameras : half_window; }

}  // namespace detail

/// "CAMERAS,POINTS,OBSERVATIONS". Throws std::invalid_argument for anything else, and for more observations than can be made: on
/// average a point gets a third of the views that it can have beyond two, so that the limit takes 5 % of them at most.
inline generated_size parse_generated_size(const std::string& text) {
  long long cameras = 0, points = 0, observations = 0;
  char rest = 0;
  const int read = std::sscanf(text.c_str(), "%lld,%lld,%lld%c", &cameras, &points, &observations, &rest);
  if (read != 3 || cameras < 2 || cameras > 1000000 || points < 1 || points > 100000000 || observations < 2 * points ||
      observations > 1000000000)
    throw std::invalid_argument("input = " + text +
                                ": must be CAMERAS,POINTS,OBSERVATIONS, with two observations per point or more");
  const generated_size size{static_cast<std::int32_t>(cameras), static_cast<std::int32_t>(points), observations};
  const long long most = points * (detail::most_views(size.cameras) + 4) / 3;  // 2 + (most views - 2) / 3 per point
  if (observations > most)
    throw std::invalid_argument("input = " + text + ": at most " + std::to_string(most) +
                                " observations of so many cameras and points can be made");
  return size;
}

/// A camera each 0.3 m, points 5 to 15 m away. A point is seen by two cameras or more (as many more as an exponential
/// distribution says) out of the 41 nearest ones, to 0.5 px; it starts 5 cm off, cameras 2 cm, 1 mrad and 1 % of the focal
/// length (standard deviations). The same on every machine. A size that parse_generated_size() refuses gets fewer observations.
inline turbomap::bal_problem generate_bal(const generated_size& size, std::uint64_t seed) {
  using turbomap::simulation::purpose;
  using turbomap::simulation::random_stream;
  constexpr double spacing = 0.3;
  constexpr int half_window = detail::half_window, window = 2 * half_window + 1;
  turbomap::bal_problem p;
  std::vector<turbomap::self_calibrated_state<double>> truth;
  random_stream camera(seed, purpose::drift), point(seed, purpose::scene_points), noise(seed, purpose::observation);
  for (std::int32_t c = 0; c < size.cameras; ++c) {
    const auto near = [&](double sigma) { return sigma * camera.normal(); };
    turbomap::bal_camera k{{near(0.02), near(0.02), near(0.02)}, {}, 500, -0.01, 0.001};
    turbomap::vec3<double> centre{spacing * c + near(0.05), near(0.2), near(0.1)};
    const auto place = [&k, &centre] {
      const turbomap::vec3<double> t = turbomap::rotation(turbomap::bal_pose(k)) * centre;
      k.translation = {-t.x, -t.y, -t.z};
    };
    place();
    truth.push_back(turbomap::bal_state(k));
    k.rotation = {k.rotation.x + near(1e-3), k.rotation.y + near(1e-3), k.rotation.z + near(1e-3)};
    centre = {centre.x + near(0.02), centre.y + near(0.02), centre.z + near(0.02)};
    k.f *= 1 + near(0.01);
    place();
    p.cameras.push_back(k);
  }
  const int most = detail::most_views(size.cameras);
  const double more = static_cast<double>(size.observations) / size.points - 2;
  for (std::int32_t i = 0; i < size.points; ++i) {
    const double along = point.uniform(0, size.cameras);
    const turbomap::vec3<double> X{spacing * along, point.uniform(-2, 2), -point.uniform(5, 15)};
    const double drawn = 2.5 - more * std::log(1 - point.uniform());
    const int views = drawn < most ? static_cast<int>(drawn) : most;  // an int may not hold what was drawn
    bool used[window] = {};
    for (int seen = 0; seen < views;) {  // ends: `most` cameras of the window exist
      const int k = static_cast<int>(point.below(window));
      const int c = static_cast<int>(along) + k - half_window;
      if (used[k] || c < 0 || c >= size.cameras) continue;
      used[k] = true;
      double residual[2] = {};
      turbomap::bal_reprojection().residual(truth[static_cast<std::size_t>(c)], X, {0, 0}, residual);
      p.camera.push_back(c), p.point.push_back(i);
      p.pixel.push_back({residual[0] + 0.5 * noise.normal(), residual[1] + 0.5 * noise.normal()});
      ++seen;
    }
    p.points.push_back({X.x + 0.05 * point.normal(), X.y + 0.05 * point.normal(), X.z + 0.05 * point.normal()});
  }
  return p;
}

}  // namespace turbomap_bundle

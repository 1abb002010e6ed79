// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Baselines and median depths, at their thresholds.

#include <turbomap/matching/neighbour_rules.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace {

using pose = turbomap::rigid_transform<double>;
using points = std::vector<turbomap::vec3<double>>;

/// World to camera of a camera at (x, y, z), turned by half a turn about its y axis or not.
pose at(double x, double y, double z, bool turned = false) {
  pose T;
  if (turned) T.qy = 1, T.qw = 0;
  T.tx = turned ? x : -x, T.ty = -y, T.tz = turned ? z : -z;
  return T;
}

TEST_CASE("the baseline is between the centres, whatever the orientation") {
  CHECK(turbomap::baseline(at(1, 2, 3), at(1, 2, 3, true)) == 0);
  CHECK(turbomap::baseline(at(1, 2, 3), at(4, 2, 7)) == doctest::Approx(5));
  CHECK(turbomap::baseline(at(1, 2, 3, true), at(4, 2, 7)) == doctest::Approx(5));
  CHECK(turbomap::baseline(at(4, 2, 7), at(1, 2, 3, true)) == doctest::Approx(5));
}

TEST_CASE("stereo: not shorter than the pair's own") {
  CHECK(turbomap::baseline_suffices_stereo(at(0, 0, 0), at(0.25, 0, 0), 0.25));
  CHECK(turbomap::baseline_suffices_stereo(at(0, 0, 0, true), at(0.5, 0, 0), 0.25));
  CHECK_FALSE(turbomap::baseline_suffices_stereo(at(0, 0, 0), at(0.2499, 0, 0), 0.25));
  CHECK(turbomap::baseline_suffices_stereo(at(0, 0, 0), at(0, 0, 0), 0));
}

TEST_CASE("monocular: in proportion to the scene") {
  turbomap::neighbour_options options;
  CHECK(options.min_baseline_depth_ratio == 0.01);
  options.min_baseline_depth_ratio = 0.125;
  CHECK(turbomap::baseline_suffices_monocular(at(0, 0, 0), at(0.5, 0, 0), 4, options));
  CHECK_FALSE(turbomap::baseline_suffices_monocular(at(0, 0, 0), at(0.5, 0, 0), 4.01, options));
  CHECK(turbomap::baseline_suffices_monocular(at(0, 0, 0), at(0.011, 0, 0), 1));
  CHECK_FALSE(turbomap::baseline_suffices_monocular(at(0, 0, 0), at(0.009, 0, 0), 1));
  for (const double none : {0.0, -1.0, std::nan("")})
    CHECK_FALSE(turbomap::baseline_suffices_monocular(at(0, 0, 0), at(1, 0, 0), none, options));
}

TEST_CASE("median depth: the lower of the two middle ones, in the camera's frame") {
  std::vector<double> scratch;
  const pose T = at(0, 0, 1);
  CHECK(turbomap::median_depth(T, {}, scratch) == -1);
  CHECK(turbomap::median_depth(T, points{{0, 0, 4}}, scratch) == 3);
  CHECK(turbomap::median_depth(T, points{{0, 0, 9}, {5, 5, 4}}, scratch) == 3);
  CHECK(turbomap::median_depth(T, points{{0, 0, 9}, {5, 5, 4}, {0, 1, 6}}, scratch) == 5);
  CHECK(turbomap::median_depth(at(0, 0, 1, true), points{{0, 0, 4}}, scratch) == -3);  // behind: that is a depth too
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  CHECK(turbomap::median_depth(T, points{{0, 0, nan}, {0, 0, 4}, {0, 0, infinity}, {0, 0, 9}}, scratch) == 3);
  CHECK(turbomap::median_depth(T, points{{nan, nan, nan}}, scratch) == -1);
}

TEST_CASE("median depth against a sort") {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-5, 20);
  std::vector<double> scratch;
  for (std::size_t n = 1; n < 60; ++n) {
    points all(n);
    std::vector<double> depths;
    for (auto& p : all) {
      p = {uniform(random), uniform(random), std::floor(uniform(random))};
      depths.push_back(p.z - 0.5);
    }
    std::sort(depths.begin(), depths.end());
    CHECK(turbomap::median_depth(at(3, 2, 0.5), all, scratch) == depths[(n - 1) / 2]);
  }
}

}  // namespace

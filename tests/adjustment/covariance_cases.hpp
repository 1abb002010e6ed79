// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Covariances of frames of the scene of adjustment_cases.hpp, under any policy.

#include <cmath>
#include <cstdint>
#include <vector>

#include <turbomap/adjustment/covariance.hpp>

#include "adjustment_cases.hpp"

namespace turbomap_test {

/// At the scene's own estimate. \return empty: not determined
template <class Policy>
std::vector<double> covariance_of(const Policy& policy, const adjustment_scene& s,
                                  const std::vector<std::int32_t>& frames) {
  turbomap::context<Policy> ctx{policy};
  turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  std::vector<double> result;
  const bool known = turbomap::frame_covariance(ctx, problem, turbomap::span<const std::int32_t>(frames), result);
  if (!known) result.clear();
  return result;
}

/// Largest difference, relative to the standard deviations of row and column.
inline double relative_difference(const std::vector<double>& a, const std::vector<double>& b) {
  REQUIRE(a.size() == b.size());
  const auto n = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(a.size()))));
  double largest = 0;
  for (std::size_t r = 0; r < n; ++r)
    for (std::size_t c = 0; c < n; ++c) {
      const double scale = std::sqrt(b[r * n + r] * b[c * n + c]), difference = std::abs(a[r * n + c] - b[r * n + c]);
      largest = std::max(largest, scale > 0 ? difference / scale : difference);
    }
  return largest;
}

}  // namespace turbomap_test

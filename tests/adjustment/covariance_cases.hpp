// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Covariances of frames of the scene of adjustment_cases.hpp, and what must hold of those that are not determined, under any
/// policy.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <turbomap/adjustment/covariance.hpp>

#include "adjustment_cases.hpp"
#include "adjustment_factors.hpp"
#include "reference/larger_or_nan.hpp"

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

/// How many directions nothing tells, at the scene's own estimate.
template <class Policy>
int directions_of(const Policy& policy, const adjustment_scene& s) {
  turbomap::context<Policy> ctx{policy};
  turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  return turbomap::undetermined_directions(ctx, problem);
}

/// Largest difference, relative to the standard deviations of row and column.
inline double relative_difference(const std::vector<double>& a, const std::vector<double>& b) {
  REQUIRE(a.size() == b.size());
  const auto n = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(a.size()))));
  double largest = 0;
  for (std::size_t r = 0; r < n; ++r)
    for (std::size_t c = 0; c < n; ++c) {
      const double scale = std::sqrt(b[r * n + r] * b[c * n + c]), difference = std::abs(a[r * n + c] - b[r * n + c]);
      largest = larger_or_nan(largest, scale > 0 ? difference / scale : difference);
    }
  return largest;
}

/// A frame that sees nothing but one landmark, by two rows of unequal weights: nothing is left of them when the landmark is taken
/// out, and rounding is no information. \return how many landmarks say otherwise
template <class Policy>
int misled_by_rounding(const Policy& policy) {
  const auto scene = make_adjustment_scene(scene_kind::mono, 2, 1, 25, 7);
  int misled = 0;
  for (std::size_t i = 0; i < scene.frame.size(); ++i) {
    if (scene.fixed[static_cast<std::size_t>(scene.frame[i])] != 0) continue;
    auto s = scene;
    s.frame.assign(2, scene.frame[i]), s.landmark.assign(2, scene.landmark[i]), s.pixel.assign(2, scene.pixel[i]);
    s.camera.assign(2, scene.camera[i]), s.information = {1, 0.7};
    misled += directions_of(policy, s) == 6 ? 0 : 1;
  }
  return misled;
}

/// What the problem does not tell is not made up.
template <class Policy>
void check_not_made_up(const Policy& policy) {
  const auto good = make_adjustment_scene(scene_kind::stereo, 5, 2, 25, 7);
  auto s = good;
  s.fixed.assign(s.fixed.size(), 0);
  CHECK(directions_of(policy, good) == 0);
  CHECK(covariance_of(policy, s, {1}).empty());  // the gauge is free
  CHECK(directions_of(policy, s) == 6);
  s = make_adjustment_scene(scene_kind::mono, 5, 1, 25, 7);
  CHECK(covariance_of(policy, s, {1}).empty());  // ... or the scale
  CHECK(directions_of(policy, s) == 1);
  s.fixed.assign(s.fixed.size(), 0);
  CHECK(directions_of(policy, s) == 7);  // ... or both
  s = good;
  for (std::size_t i = s.frame.size(); i-- > 0;)
    if (s.frame[i] == 0) {
      s.frame.erase(s.frame.begin() + static_cast<std::ptrdiff_t>(i));
      s.landmark.erase(s.landmark.begin() + static_cast<std::ptrdiff_t>(i));
      s.pixel.erase(s.pixel.begin() + static_cast<std::ptrdiff_t>(i));
      s.information.erase(s.information.begin() + static_cast<std::ptrdiff_t>(i));
      s.camera.erase(s.camera.begin() + static_cast<std::ptrdiff_t>(i));
    }
  CHECK(covariance_of(policy, s, {0}).empty());  // a frame that sees nothing ...
  CHECK(directions_of(policy, s) == 6);
  CHECK_FALSE(covariance_of(policy, s, {1, 2}).empty());  // ... takes nothing from the others
  s = good;
  s.points[3].x = std::numeric_limits<double>::quiet_NaN();
  CHECK(covariance_of(policy, s, {1}).empty());
  CHECK(directions_of(policy, s) == 6 * static_cast<int>(std::count(s.fixed.begin(), s.fixed.end(), 0)));
  s = good;
  s.frame.clear(), s.landmark.clear(), s.pixel.clear(), s.information.clear(), s.camera.clear();
  CHECK(covariance_of(policy, s, {1}).empty());
  CHECK(misled_by_rounding(policy) == 0);
}

/// Of a scene and one prior of a frame. \return whether all frames are determined
template <class Policy, class List>
bool covariance_with_prior(const Policy& policy, const adjustment_scene& s, std::int32_t of, double weight,
                           const rigid_transform<double>& T, const std::vector<std::int32_t>& frames, List& result) {
  turbomap::context<Policy> ctx{policy};
  turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>,
                           turbomap::frame_factors<prior_factor>>
      problem(ctx);
  const prior_factor::row row{T};
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group(), {{weight}, {&of, 1}, {&row, 1}, {}, 1e6});
  return turbomap::frame_covariance(ctx, problem, turbomap::span<const std::int32_t>(frames), result);
}

/// A scale that is free is not told by far points, and is by a weak prior.
template <class Policy>
void check_free_scale(const Policy& policy) {
  for (unsigned seed = 0; seed < 120; ++seed) {
    CAPTURE(seed);
    auto s = make_adjustment_scene(scene_kind::mono, 6, 1, 40, seed);
    for (auto& p : s.points) p = {100 * p.x, 100 * p.y, 100 * p.z};
    CHECK(covariance_of(policy, s, {1}).empty());
    CHECK(covariance_of(policy, s, {0, 3}).empty());
  }
  const auto s = make_adjustment_scene(scene_kind::mono, 6, 1, 40, 7);
  std::vector<double> covariance;
  REQUIRE(covariance_with_prior(policy, s, 0, 1e-3, s.poses[0], {0}, covariance));  // sigma 1 km
  const double sigma = std::sqrt(covariance[3 * 6 + 3] + covariance[4 * 6 + 4] + covariance[5 * 6 + 5]);
  CHECK(sigma > 900);
  CHECK(sigma < 1100);
}

/// The answer is per frame.
template <class Policy>
void check_answer_per_frame(const Policy& policy) {
  for (unsigned seed = 0; seed < 40; ++seed) {  // two points: a frame may turn about the line through them
    auto s = make_adjustment_scene(scene_kind::stereo, 5, 2, 25, seed);
    auto two = s;
    two.frame.clear(), two.landmark.clear(), two.pixel.clear(), two.information.clear(), two.camera.clear();
    int kept = 0;
    for (std::size_t i = 0; i < s.frame.size(); ++i) {
      if (s.frame[i] == 0 && (s.pixel[i].z < 0 || ++kept > 2)) continue;
      two.frame.push_back(s.frame[i]), two.landmark.push_back(s.landmark[i]), two.pixel.push_back(s.pixel[i]);
      two.information.push_back(s.information[i]), two.camera.push_back(0);
    }
    REQUIRE(kept >= 2);
    CHECK(covariance_of(policy, two, {0}).empty());
    CHECK_FALSE(covariance_of(policy, two, {1, 2}).empty());
  }
  const auto s = make_adjustment_scene(scene_kind::stereo, 5, 2, 25, 7);
  std::vector<double> some;
  auto nowhere = s.poses[1];
  nowhere.tx = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(covariance_with_prior(policy, s, 1, 1, nowhere, {0, 1, 4}, some));
  REQUIRE(some.size() == 18 * 18);
  const auto without = covariance_of(policy, s, {0});
  for (std::size_t r = 0; r < 18; ++r)
    for (std::size_t c = 0; c < 18; ++c) {
      const bool of_1 = r / 6 == 1 || c / 6 == 1, of_4 = r / 6 == 2 || c / 6 == 2;
      CHECK(std::isnan(some[r * 18 + c]) == of_1);
      if (of_4 && !of_1) CHECK(some[r * 18 + c] == 0);  // fixed
      if (r < 6 && c < 6) CHECK(some[r * 18 + c] == doctest::Approx(without[r * 6 + c]).epsilon(1e-9));
    }
}

/// Unknowns that are held are known.
template <class Policy>
void check_held_unknowns(const Policy& policy) {
  const auto s = make_adjustment_scene(scene_kind::stereo, 4, 1, 25, 3);
  std::vector<std::uint32_t> held(4, 0);
  held[1] = 1U << 3;
  turbomap::context<Policy> ctx{policy};
  turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  const auto in = s.frame_input();
  problem.assign(ctx, {in.states, in.fixed, {held.data(), 4}}, s.landmark_input(), s.group());
  const std::int32_t frame = 1;
  std::vector<double> with;
  REQUIRE(turbomap::frame_covariance(ctx, problem, {&frame, 1}, with));
  const auto all = covariance_of(policy, s, {1});
  for (std::size_t r = 0; r < 6; ++r)
    for (std::size_t c = 0; c < 6; ++c) {  // conditioned on unknown 3
      const double expected = all[r * 6 + c] - all[r * 6 + 3] * all[3 * 6 + c] / all[3 * 6 + 3];
      CHECK(std::abs(with[r * 6 + c] - (r == 3 || c == 3 ? 0 : expected)) <= 1e-7 * std::sqrt(all[r * 7] * all[c * 7]));
    }
}

/// A landmark that is seen once takes nothing from what is known.
template <class Policy>
void check_landmark_seen_once(const Policy& policy) {
  auto s = make_adjustment_scene(scene_kind::mono, 5, 2, 25, 7);
  const auto before = covariance_of(policy, s, {0, 1});
  const vec3<double> p{0.1, 0.2, 4};
  s.points.push_back(p);
  s.frame.push_back(1), s.landmark.push_back(25), s.pixel.push_back({380, 260, -1});
  s.information.push_back(1), s.camera.push_back(0);
  CHECK(relative_difference(covariance_of(policy, s, {0, 1}), before) < 1e-6);
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What adjustment_summary::undetermined counts, and what it does not: unknowns one by one, not directions that several have in
/// common. For those frame_covariance() says which frames are lost.

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <turbomap/adjustment/covariance.hpp>

#include "inertial_scene.hpp"

namespace turbomap_test {

/// What is said of a problem, and the states afterwards.
struct told {
  turbomap::adjustment_summary summary;
  std::string known;  ///< [frame] by frame_covariance() at the start: 1, or 0
  int directions;     ///< by undetermined_directions() at the start
  std::vector<inertial_state<double>> states;
};

template <class Policy>
told tell(const Policy& policy, const inertial_scene& s) {
  turbomap::context<Policy> ctx{policy};
  inertial_problem<Policy> problem(ctx);
  s.assign(ctx, problem, inertial_factor{});
  std::vector<std::int32_t> frames;
  for (std::size_t f = 0; f < s.states.size(); ++f) frames.push_back(static_cast<std::int32_t>(f));
  std::vector<double> covariance;
  turbomap::frame_covariance(ctx, problem, turbomap::span<const std::int32_t>(frames), covariance);
  told t;
  const std::size_t n = 15 * frames.size();
  for (std::size_t f = 0; f < frames.size(); ++f) t.known += std::isnan(covariance[15 * f * (n + 1)]) ? '0' : '1';
  t.directions = turbomap::undetermined_directions(ctx, problem);
  t.summary = turbomap::adjust(ctx, problem);
  problem.frames(ctx, t.states);
  return t;
}

/// Takes away what joins the last of the frames with the one before.
inline void cut_last_edge(inertial_scene& s) {
  s.first.pop_back(), s.second.pop_back(), s.edges.pop_back(), s.walks.pop_back();
}
/// Takes away all that a frame sees but the first so many.
inline void keep_observations(inertial_scene& s, int frame, int most) {
  std::size_t to = 0;
  for (std::size_t i = 0; i < s.frame.size(); ++i) {
    if (s.frame[i] == frame && most-- <= 0) continue;
    s.frame[to] = s.frame[i], s.landmark[to] = s.landmark[i], s.pixel[to] = s.pixel[i];
    s.information[to] = s.information[i], ++to;
  }
  s.frame.resize(to), s.landmark.resize(to), s.pixel.resize(to), s.information.resize(to);
}

/// A velocity that nothing touches is counted, and stays.
template <class Policy>
void check_untouched_velocity(const Policy& policy) {
  auto s = make_inertial_scene(5, 12, 6);
  cut_last_edge(s);
  told t = tell(policy, s);  // the prior tells it
  CHECK(t.summary.undetermined == 0);
  CHECK(t.known == "11111");
  CHECK(t.directions == 0);
  s.priors[0].velocity_weight = 0;
  t = tell(policy, s);
  CHECK(t.summary.undetermined == 3);
  CHECK(t.known == "11110");
  CHECK(t.directions == 3);
  CHECK(t.summary.accepted > 0);
  CHECK(t.states[4].velocity.x == s.states[4].velocity.x);
  CHECK(t.states[4].bias.gyro.x != s.states[4].bias.gyro.x);
}

/// Frames that may all turn about gravity together: each unknown is touched, so none is counted, and no frame is known.
template <class Policy>
void check_free_heading(const Policy& policy) {
  auto s = make_inertial_scene(5, 12, 6);
  s.fixed.assign(5, 0), s.held.assign(5, 0);
  s.held[0] = inertial_frame::hold_centre, s.priors[0].velocity_weight = 0;  // a known velocity tells the heading
  told t = tell(policy, s);
  CHECK(t.summary.undetermined == 0);
  CHECK(t.known == "00000");
  CHECK(t.directions == 1);
  CHECK(t.summary.accepted > 0);
  s.held[0] |= 1;  // an axis of the first rotation holds the heading of all
  t = tell(policy, s);
  CHECK(t.summary.undetermined == 0);
  CHECK(t.known == "11111");
  CHECK(t.directions == 0);
}

/// The same of two frames that see nothing, and that an edge joins to each other only.
template <class Policy>
void check_untied_edge(const Policy& policy) {
  auto s = make_inertial_scene(5, 12, 6);
  keep_observations(s, 3, 0), keep_observations(s, 4, 0);
  s.first.erase(s.first.begin() + 2), s.second.erase(s.second.begin() + 2);
  s.edges.erase(s.edges.begin() + 2), s.walks.erase(s.walks.begin() + 2);
  const told t = tell(policy, s);
  CHECK(t.summary.undetermined == 0);
  CHECK(t.known == "11100");
  CHECK(t.directions == 6);
}

/// A frame with one landmark: three numbers touch its six unknowns, so none is counted, and it is not known.
template <class Policy>
void check_one_landmark(const Policy& policy) {
  auto s = make_inertial_scene(5, 12, 6);
  cut_last_edge(s);
  s.prior_frame.clear(), s.priors.clear();
  s.held.assign(5, 0), s.held[4] = inertial_frame::visual_only;
  CHECK(tell(policy, s).known == "11111");
  keep_observations(s, 4, 1);  // without u_right: two numbers
  told t = tell(policy, s);
  CHECK(t.summary.undetermined == 0);
  CHECK(t.known == "11110");
  CHECK(t.directions == 4);
  keep_observations(s, 4, 0);
  t = tell(policy, s);
  CHECK(t.summary.undetermined == 6);
  CHECK(t.known == "11110");
  CHECK(t.directions == 6);
}

}  // namespace turbomap_test

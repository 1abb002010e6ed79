// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What inertial adjustment of a map must do under every execution policy, host or device: the window and the result of the
/// definition, what thrust::seq leaves and the same bits each time, and a map that stays where nothing may be written.

#include <turbomap/map/validate.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <vector>

#include <doctest/doctest.h>

#include "adjustment/adjustment_results.hpp"
#include "inertial_adjustment_cases.hpp"
#include "inertial_window_definition.hpp"
#include "reference/larger_or_nan.hpp"

namespace turbomap_test {

/// In float64, to the last iteration.
inline turbomap::local_adjustment_options exact() {
  turbomap::local_adjustment_options o;
  o.solve.numbers = turbomap::precision::float64, o.solve.min_relative_decrease = 0;
  return o;
}
inline turbomap::inertial_adjustment_options window_of(int keyframes, int observers = 200) {
  turbomap::inertial_adjustment_options o;
  o.strong_points = -1, o.window.keyframes = keyframes, o.most_observers = observers;
  return o;
}

/// Of two maps of one scene: the largest difference of poses, velocities and biases, relative to what is larger than 1 (m,
/// m/s). What is not a number in both is no difference.
inline double largest_difference(const inertial_map_scene& a, const inertial_map_scene& b) {
  double largest = 0;
  const auto compare = [&largest](const vec3<double>& x, const vec3<double>& y) {
    const double size = std::max(1.0, turbomap::norm(y)), off = turbomap::norm(x - y) / size;
    if (!(std::isnan(turbomap::norm(x)) && std::isnan(turbomap::norm(y)))) largest = larger_or_nan(largest, off);
  };
  for (std::size_t f = 0; f < a.keyframes.size(); ++f) {
    const auto i = a.keyframes[f], j = b.keyframes[f];
    if (a.map.alive(i) != b.map.alive(j)) return HUGE_VAL;
    if (!a.map.alive(i)) continue;
    const auto &T = a.map.T_cw(i), &U = b.map.T_cw(j);
    compare({T.qx, T.qy, T.qz}, {U.qx, U.qy, U.qz}), compare({T.qw, 0, 0}, {U.qw, 0, 0}),
        compare({T.tx, T.ty, T.tz}, {U.tx, U.ty, U.tz});
    compare(a.map.velocity(i), b.map.velocity(j)), compare(a.map.bias(i).gyro, b.map.bias(j).gyro);
    compare(a.map.bias(i).acceleration, b.map.bias(j).acceleration);
  }
  return largest;
}

/// The positions of the points, m; of those that are not alive, 0.
inline std::vector<vec3<double>> positions_of(const inertial_map_scene& s) {
  std::vector<vec3<double>> all;
  for (const auto& p : s.points) {
    all.emplace_back();
    if (!s.map.alive(p)) continue;
    const auto& x = s.map.position(p);
    all.back() = {x.x, x.y, x.z};
  }
  return all;
}

/// What the keyframes tell of the points: positions_of(); of a point that one keyframe sees with one camera, the direction in
/// which it sees it, because nothing tells how far away it is.
inline std::vector<vec3<double>> told_of_points(const inertial_map_scene& s) {
  using turbomap::operator*;
  std::vector<vec3<double>> all = positions_of(s);
  for (std::size_t l = 0; l < all.size(); ++l) {
    if (!s.map.alive(s.points[l])) continue;
    const auto views = s.map.observations(s.points[l]);
    if (views.size() != 1) continue;
    const auto k = s.map.keyframe_at(views[0].keyframe);
    if (s.map.keypoints(k)[static_cast<std::size_t>(views[0].keypoint)].u_right >= 0) continue;
    const auto T_cw = turbomap::to_isometry<double>(s.map.T_cw(k));
    const auto ray = all[l] - turbomap::camera_centre(T_cw);
    all[l] = (1 / turbomap::norm(ray)) * ray;
  }
  return all;
}

/// Of largest_difference() and of points, where the order of sums is another. Measured on a device, of keyframes: 5e-10 where the
/// map may turn or a motion is missing, else 1e-11. Between two ways of rounding on the host, of points: 4e-10. The distance of a
/// point that one camera of one keyframe sees stays where damping leaves it: 5e-9 on a device, 2e-8 between two ways of rounding.
inline constexpr double told = 1e-9, untold = 1e-7;

/// Adjusts a scene under a policy, in float64. It must leave the same bits when it runs again, and what thrust::seq leaves. (Not in as
/// many iterations: near the optimum rounding decides whether one more step is accepted.)
template <class Policy>
turbomap::local_adjustment_summary adjust_as_on_host(const Policy& policy, inertial_map_scene& s, int current,
                                                     const turbomap::inertial_adjustment_options& inertial,
                                                     turbomap::fault_sink faults = {}) {
  inertial_map_scene again = s, host = s;
  turbomap::fault_list others;
  const auto other_faults = turbomap::fault_sink(others);
  const auto summary = inertial_run<Policy>(policy, s)(current, exact(), inertial, faults);
  inertial_run<Policy>(policy, again)(current, exact(), inertial, other_faults);
  const auto expected =
      inertial_run<sequential_policy>(sequential_policy{}, host)(current, exact(), inertial, other_faults);
  CHECK(s.state() == again.state());
  CHECK(summary.free_keyframes == expected.free_keyframes);
  CHECK(summary.inertial_edges == expected.inertial_edges);
  CHECK(summary.observations == expected.observations);
  CHECK(summary.outliers == expected.outliers);
  CHECK(summary.solve.undetermined == expected.solve.undetermined);
  CHECK((summary.solve.accepted > 0) == (expected.solve.accepted > 0));
  CHECK(summary.solve.cost_final == doctest::Approx(expected.solve.cost_final).epsilon(1e-9));
  CHECK(largest_difference(s, host) < told);
  CHECK(distance(told_of_points(s), told_of_points(host)) < told);
  CHECK(distance(positions_of(s), positions_of(host)) < untold);
  CHECK(turbomap::validate(s.map).empty());
  return summary;
}

/// Windows of many sizes. The definition orders frames and rows in another way.
template <class Policy>
void check_definition(const Policy& policy) {
  for (const unsigned seed : {1U, 2U})
    for (const auto& numbers : std::vector<std::array<int, 3>>{
             {13, 5, 200}, {13, 5, 2}, {13, 40, 200}, {6, 40, 200}, {9, 4, 0}, {1, 1, 200}, {1, 2, 0}, {13, 1, 200}}) {
      const int current = numbers[0], keyframes = numbers[1], observers = numbers[2];
      CAPTURE(seed);
      CAPTURE(current);
      CAPTURE(keyframes);
      inertial_map_scene s({14, 20, seed});
      const auto inertial = window_of(keyframes, observers);
      const auto w = window_by_definition(s, current, keyframes, observers);
      const auto expected = adjusted_by_definition(s, w, current, exact(), inertial.window);
      const inertial_map_scene before = s;
      const auto summary = adjust_as_on_host(policy, s, current, inertial);
      CHECK(summary.inertial);
      CHECK_FALSE(summary.stale);
      CHECK(summary.free_keyframes == static_cast<std::size_t>(current - w.first + (w.begins ? 1 : 0)));
      CHECK(summary.inertial_edges == static_cast<std::size_t>(current - w.first));
      CHECK(summary.fixed_keyframes == (w.begins ? 0 : 1) + w.observers.size());
      CHECK(summary.points == w.points.size());
      CHECK(summary.observations == w.rows);
      REQUIRE(summary.solve.accepted > 0);
      CHECK(summary.solve.undetermined == 0);
      for (int f = 0; f < 14; ++f) {
        const auto i = static_cast<std::size_t>(f);
        const bool moves = f >= w.first + (w.begins ? 0 : 1) && f <= current;
        if (moves)
          CHECK(difference(expected[static_cast<std::size_t>(f - w.first)], s.map, s.keyframes[i]) < told);
        else
          CHECK(difference({before.map.T_cw(s.keyframes[i]), before.map.velocity(s.keyframes[i]),
                            before.map.bias(s.keyframes[i])},
                           s.map, s.keyframes[i]) == 0);
      }
      if (w.begins) CHECK(before.map.T_cw(s.keyframes[0]).qx == s.map.T_cw(s.keyframes[0]).qx);
    }
}

template <class Policy>
void check_outliers(const Policy& policy) {
  inertial_recipe recipe;
  recipe.outliers = 0.08;
  inertial_map_scene s(recipe);
  for (const int current : {7, 10, 13}) adjust_as_on_host(policy, s, current, window_of(10));
  inertial_map_scene once(recipe);
  CHECK(adjust_as_on_host(policy, once, 13, window_of(10)).outliers > 10);
}

/// Where tracking is strong, the large window.
template <class Policy>
void check_large_window(const Policy& policy) {
  turbomap::inertial_adjustment_options o;
  o.window.keyframes = 3, o.large.keyframes = 6, o.strong_points = 1;
  inertial_map_scene s;
  CHECK(adjust_as_on_host(policy, s, 13, o).free_keyframes == 6);
  o.strong_points = 100000;
  CHECK(adjust_as_on_host(policy, s, 13, o).free_keyframes == 3);
}

/// While the estimates are young the map turns about its first keyframe, which keeps its place; later that keeps its pose.
template <class Policy>
void check_young_map_turns(const Policy& policy) {
  for (const bool young : {false, true}) {
    CAPTURE(young);
    inertial_map_scene s;
    s.map.set_refined(!young);
    const auto centre = [&s] {
      return turbomap::camera_centre(turbomap::to_isometry<double>(s.map.T_cw(s.keyframes[0])));
    };
    const auto at = centre();
    const double q = s.map.T_cw(s.keyframes[0]).qx;
    adjust_as_on_host(policy, s, 13, window_of(40));
    CHECK(turbomap::norm(centre() - at) < 1e-9);
    CHECK((s.map.T_cw(s.keyframes[0]).qx == q) == !young);
  }
}

/// Keyframes were culled, and their motions merged.
template <class Policy>
void check_culled_window(const Policy& policy) {
  inertial_map_scene s({20, 20, 3});
  for (const std::size_t f : {5U, 8U, 9U, 14U, 15U, 17U}) {
    turbomap::bridge_motion(s.map, s.keyframes[f]);
    turbomap::erase_keyframe(s.map, s.keyframes[f]);
  }
  const auto summary = adjust_as_on_host(policy, s, 19, window_of(8));
  CHECK(summary.free_keyframes == 8);
  CHECK(summary.inertial_edges == 8);
  CHECK(summary.solve.cost_final < 0.01 * summary.solve.cost_initial);
}

/// Others change a velocity, a bias or a pose of the window, or take out one of its keyframes, while it is adjusted.
template <class Policy>
void check_changed_meanwhile(const Policy& policy) {
  for (const int what : {0, 1, 2, 3, 4}) {
    CAPTURE(what);
    inertial_map_scene s;
    inertial_run<Policy> run(policy, s);
    turbomap::local_adjustment_summary summary;
    const auto scope = run.scope();
    run.adjust.snapshot(scope, s.keyframes[13], {}, window_of(6), summary);
    REQUIRE(run.adjust.compute(scope, {}, summary));
    const auto k = s.keyframes[11];
    if (what == 0) s.map.set_velocity(k, {1, 2, 3});
    if (what == 1) s.map.set_bias(k, {{0.1, 0, 0}, {}});
    if (what == 2) s.map.set_pose(k, {});
    if (what >= 3) {  // 11 moves; 7 holds the window
      const auto gone = what == 3 ? k : s.keyframes[7];
      turbomap::bridge_motion(s.map, gone);
      turbomap::erase_keyframe(s.map, gone);
    }
    const auto before = s.state();
    run.adjust.commit(scope, {}, summary);
    CHECK(summary.stale);
    CHECK(s.state() == before);
  }
}

/// Stopped before it began, a keyframe that is none, bad options, gravity that is not a number.
template <class Policy>
void check_refused(const Policy& policy) {
  constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
  inertial_map_scene s;
  inertial_run<Policy> run(policy, s);
  const auto before = s.state();
  const std::atomic<bool> stop{true};
  turbomap::local_adjustment_options options;
  options.solve.stop = &stop;
  CHECK(run(13, options).solve.end == turbomap::adjustment_end::stopped);
  CHECK(run.adjust(run.scope(), {}, {}).stale);
  const char* const names[] = {
      "options.window.keyframes", "options.large.iterations", "options.window.initial_lambda",
      "options.most_observers",   "options.max_time_error",   "options.large.robust_chi2",
      "options.max_force",        "options.max_force",        "options.window.oldest_edge_weight"};
  for (int bad = 0; bad < 9; ++bad) {
    turbomap::inertial_adjustment_options o;
    if (bad == 0) o.window.keyframes = 0;
    if (bad == 1) o.large.iterations = 0;
    if (bad == 2) o.window.initial_lambda = nan_value;
    if (bad == 3) o.most_observers = -1;
    if (bad == 4) o.max_time_error = nan_value;
    if (bad == 5) o.large.robust_chi2 = 0;
    if (bad == 6) o.max_force = 0;
    if (bad == 7) o.max_force = nan_value;
    if (bad == 8) o.window.oldest_edge_weight = 0;
    CHECK_THROWS_WITH_AS(run(13, {}, o), doctest::Contains(names[bad]), std::invalid_argument);
  }
  s.map.set_gravity({0, nan_value, -9.81});
  CHECK_THROWS_AS(run(13), std::invalid_argument);
  CHECK(s.state() == before);
}

/// What is wrong with the keyframe 11 of a scene.
enum class imu_damage {
  huge_velocity,        ///< 100 g all the time
  huge_position,        ///< likewise, told by the position alone
  motion_not_finite,    ///< NaN
  infinite_covariance,  ///< a variance is infinite
  no_duration,          ///< no time has passed
  other_duration,       ///< another interval's motion
  velocity_not_finite,  ///< NaN
  bias_not_finite,      ///< NaN
  no_motion             ///< a gap over the whole interval: known, so no fault
};

inline const char* to_string(imu_damage damage) {
  switch (damage) {
    case imu_damage::huge_velocity:
      return "huge_velocity";
    case imu_damage::huge_position:
      return "huge_position";
    case imu_damage::motion_not_finite:
      return "motion_not_finite";
    case imu_damage::infinite_covariance:
      return "infinite_covariance";
    case imu_damage::no_duration:
      return "no_duration";
    case imu_damage::other_duration:
      return "other_duration";
    case imu_damage::velocity_not_finite:
      return "velocity_not_finite";
    case imu_damage::bias_not_finite:
      return "bias_not_finite";
    case imu_damage::no_motion:
      return "no_motion";
  }
  return "unknown";
}

inline void damage(inertial_map& map, turbomap::map_keyframe_id k, imu_damage what) {
  constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
  turbomap::preintegration<double> p = *map.motion(k);
  switch (what) {
    case imu_damage::huge_velocity:
      p.dV.y = 1000 * p.dt;
      break;
    case imu_damage::huge_position:
      p.dP = {0, 0, 1e10};
      break;
    case imu_damage::motion_not_finite:
      p.dV.x = nan_value;
      break;
    case imu_damage::infinite_covariance:
      p.C_PP(1, 1) = std::numeric_limits<double>::infinity();
      break;
    case imu_damage::no_duration:
      p.dt = 0;
      break;
    case imu_damage::other_duration:
      p.dt += 0.02;
      break;
    case imu_damage::velocity_not_finite:
      return map.set_velocity(k, {nan_value, 0, 0});
    case imu_damage::bias_not_finite:
      return map.set_bias(k, {{0, 0, nan_value}, {}});
    case imu_damage::no_motion:
      return map.clear_motion(k);
  }
  map.set_motion(k, p);
}

/// A motion or a state that cannot be used is refused, or noted and passed over; one that is not known is no fault.
template <class Policy>
void check_unusable_imu_data(const Policy& policy) {
  using turbomap::map_fault;
  for (const auto what : {imu_damage::huge_velocity, imu_damage::huge_position, imu_damage::motion_not_finite,
                          imu_damage::infinite_covariance, imu_damage::no_duration, imu_damage::other_duration,
                          imu_damage::velocity_not_finite, imu_damage::bias_not_finite, imu_damage::no_motion}) {
    INFO(to_string(what));
    const bool of_velocity = what == imu_damage::velocity_not_finite, of_bias = what == imu_damage::bias_not_finite;
    const bool of_state = of_velocity || of_bias, is_fault = what != imu_damage::no_motion;
    inertial_map_scene s;
    const auto k = s.keyframes[11];
    damage(s.map, k, what);
    const auto before = s.state();
    if (is_fault) {
      CHECK_THROWS_AS(inertial_run<Policy>(policy, s)(13, {}, window_of(8)), turbomap::inconsistent_map);
      CHECK(s.state() == before);
    }
    turbomap::fault_list noted;
    const auto then = s.map.velocity(k);
    const auto summary = adjust_as_on_host(policy, s, 13, window_of(8), turbomap::fault_sink(noted));
    REQUIRE(noted.size() == (is_fault ? 1 : 0));
    if (is_fault) {
      CHECK(noted[0].fault == (of_state ? map_fault::bad_inertial_state : map_fault::bad_motion));
      CHECK(noted[0].keyframe == 11);
    }
    CHECK(summary.free_keyframes == 8);
    CHECK(summary.inertial_edges == (of_state ? 6 : 7));
    REQUIRE(summary.solve.accepted > 0);
    CHECK(summary.solve.undetermined == 0);
    if (of_velocity) CHECK(std::isnan(s.map.velocity(k).x));  // not made up
    if (of_bias) CHECK(s.map.velocity(k).x == then.x);
    // The biases of the first keyframe after the hole stay; its velocity is known from the next edge.
    if (!of_state) CHECK_FALSE(s.map.velocity(k).x == then.x);
    CHECK(summary.solve.cost_final < 0.5 * summary.solve.cost_initial);
  }
  inertial_map_scene s;  // no motion at all: velocities and biases stay, poses move
  for (const auto& k : s.keyframes) s.map.clear_motion(k);
  inertial_map_scene before = s;
  const auto summary = adjust_as_on_host(policy, s, 13, window_of(8));
  CHECK(summary.inertial_edges == 0);
  CHECK(summary.solve.accepted > 0);
  CHECK(summary.solve.undetermined == 0);
  for (const auto& k : s.keyframes) CHECK(s.map.velocity(k).x == before.map.velocity(k).x);
}

}  // namespace turbomap_test

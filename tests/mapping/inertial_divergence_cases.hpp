// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Inertial adjustments that find no better state: numbers that overflow, motions that contradict each other by half a turn,
/// systems that cannot be solved. None may leave a trace, in the map or in the stage.

#include <turbomap/math/rotation.hpp>

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "inertial_window_cases.hpp"

namespace turbomap_test {

/// What the window around keyframe 13 comes to.
struct divergence {
  const char* name;
  turbomap::adjustment_end end;
  void (*make)(inertial_map_scene&, turbomap::local_adjustment_options&);
};

/// Changes the motion to keyframe f.
template <class Change>
void change_motion(inertial_map_scene& s, std::size_t f, const Change& change) {
  auto p = *s.map.motion(s.keyframes[f]);
  change(p);
  s.map.set_motion(s.keyframes[f], p);
}

inline std::vector<divergence> divergences() {
  using motion = turbomap::preintegration<double>;
  using options = turbomap::local_adjustment_options;
  using scene = inertial_map_scene;
  const auto not_finite = turbomap::adjustment_end::not_finite, singular = turbomap::adjustment_end::singular,
             no_descent = turbomap::adjustment_end::no_descent;
  return {
      {"the square of a motion overflows", not_finite,
       [](scene& s, options&) { change_motion(s, 11, [](motion& p) { p.dP.x = 1e153; }); }},
      {"the square of a velocity overflows", not_finite,
       [](scene& s, options&) {
         s.map.set_velocity(s.keyframes[11], {1e160, 0, 0});
       }},
      {"a bias turns a motion into what is not a number", not_finite,
       [](scene& s, options&) {
         s.map.set_bias(s.keyframes[11], {{1e200, 0, 0}, {0, 0, 0}});
       }},
      {"a correction by the bias overflows", not_finite,
       [](scene& s, options&) { change_motion(s, 11, [](motion& p) { p.J_Pa(0, 0) = 1e200; }); }},
      {"gravity overflows", not_finite,
       [](scene& s, options&) {
         s.map.set_gravity({0, 0, 1e200});
       }},
      // Their inverses are finite, and so is the cost; sums of the normal equations are not.
      {"covariances of almost 0", singular,
       [](scene& s, options&) {
         for (std::size_t f = 6; f < 14; ++f)
           change_motion(s, f, [](motion& p) {
             for (auto* C : {&p.C_RR, &p.C_VR, &p.C_VV, &p.C_PR, &p.C_PV, &p.C_PP})
               for (double& c : C->m) c *= 1e-200;
           });
       }},
      // Half a turn away the linear model of a rotation is wrong: its full step makes the cost larger.
      {"a motion that is half a turn off, one try", no_descent,
       [](scene& s, options& o) {
         o.solve.max_retries = 0;
         change_motion(s, 11, [](motion& p) {
           using turbomap::operator*;
           p.dR = turbomap::rotation_exp(vec3<double>{3.1, 0, 0}) * p.dR;
         });
       }},
  };
}

/// The map is what it was, to the last bit; and the stage adjusts a sound map as a new one does, to the last bit.
template <class Policy>
void check_divergence(const Policy& policy) {
  for (const auto& d : divergences()) {
    const std::string name = d.name;
    CAPTURE(name);
    inertial_recipe recipe;
    recipe.outliers = 0.05;  // that would leave the map
    const inertial_map_scene sound(recipe);
    inertial_map_scene s = sound, fresh = sound;
    auto options = exact();
    d.make(s, options);
    const auto before = s.state();
    inertial_run<Policy> run(policy, s);
    auto inertial = window_of(8);
    inertial.max_force = 1e300;  // what is absurd is tried all the same
    const auto summary = run(13, options, inertial);
    CHECK(summary.inertial);
    CHECK(summary.inertial_edges == 8);
    CHECK_FALSE(summary.stale);
    CHECK(summary.solve.end == d.end);
    CHECK(summary.solve.accepted == 0);
    CHECK(summary.outliers == 0);
    CHECK(summary.points_erased == 0);
    CHECK(run.adjust.points_that_lost_views().size() == 0);
    CHECK(s.state() == before);
    CHECK(turbomap::validate(s.map).empty());

    s.map = sound.map;
    const auto after = run(13, exact(), window_of(8));
    CHECK(after.solve.accepted > 0);
    CHECK(after.outliers > 0);
    inertial_run<Policy>(policy, fresh)(13, exact(), window_of(8));
    CHECK(s.state() == fresh.state());
  }
}

/// A damping that lets nothing move is given up for the one that the options stand for by themselves.
template <class Policy>
void check_endless_damping(const Policy& policy) {
  using turbomap::damping_rule;
  const std::vector<std::pair<damping_rule, double>> rules{
      {damping_rule::identity, 1e100}, {damping_rule::identity, 1e300}, {damping_rule::diagonal, 1e100}};
  for (const auto& given : rules) {
    const double lambda = given.second;
    CAPTURE(static_cast<int>(given.first));
    CAPTURE(lambda);
    inertial_map_scene s;
    auto inertial = window_of(8);
    inertial.window.damping = given.first, inertial.window.initial_lambda = lambda;
    const auto summary = adjust_as_on_host(policy, s, 13, inertial);
    REQUIRE(summary.solve.accepted > 0);
    CHECK(summary.solve.each[0].steps == 2);
    CHECK(summary.solve.each[0].lambda < 1e-20 * lambda);
    CHECK(summary.solve.cost_final < 0.01 * summary.solve.cost_initial);
  }
}

}  // namespace turbomap_test

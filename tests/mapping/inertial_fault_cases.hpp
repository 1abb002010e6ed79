// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What local mapping must do under every execution policy, host or device, when its IMU fails: samples that cannot be
/// integrated, motions and states that cannot be used, a body that is never accelerated. It is said what is wrong, the map
/// stays valid, and mapping goes on.

#include <doctest/doctest.h>

#include <turbomap/inertial/preintegrate.hpp>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/inertial_initialisation.hpp>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "scenes/inertial_motion.hpp"
#include "scenes/mapping_scene.hpp"

namespace turbomap_test {

/// Samples of the time between two keyframes, and some before and after it.
struct sample_list {
  std::vector<std::int64_t> t_ns;
  std::vector<turbomap::imu_sample> sample;

  sample_list() {
    constexpr std::int64_t ms = 1'000'000;
    for (std::int64_t t = -20 * ms; t <= 220 * ms; t += 5 * ms) t_ns.push_back(t), sample.push_back({{}, {0, 0, 9.81}});
  }
  void erase(std::size_t first, std::size_t count) {
    const auto i = static_cast<std::ptrdiff_t>(first), j = static_cast<std::ptrdiff_t>(first + count);
    t_ns.erase(t_ns.begin() + i, t_ns.begin() + j), sample.erase(sample.begin() + i, sample.begin() + j);
  }
};
struct sample_damage {
  const char *name, *message;  ///< what preintegrate() says of it
  void (*make)(sample_list&);
};
inline const std::vector<sample_damage> sample_damages{
    {"a hole of 100 ms", "samples.t_ns[14]", [](sample_list& s) { s.erase(14, 20); }},
    {"a hole over the whole interval", "samples.t_ns[3]", [](sample_list& s) { s.erase(3, 43); }},
    {"samples end early", "interval.end_ns", [](sample_list& s) { s.erase(34, s.t_ns.size() - 34); }},
    {"no samples", "samples.t_ns.size()", [](sample_list& s) { s.erase(0, s.t_ns.size()); }},
    {"equal times", "samples.t_ns[20]", [](sample_list& s) { s.t_ns[20] = s.t_ns[19]; }},
    {"a time that decreases", "samples.t_ns[21]", [](sample_list& s) { std::swap(s.t_ns[20], s.t_ns[21]); }},
    {"not a number", "samples.sample[20].gyro.y",
     [](sample_list& s) { s.sample[20].gyro.y = std::numeric_limits<double>::quiet_NaN(); }},
    {"saturated", "samples.sample[20].acceleration.x", [](sample_list& s) { s.sample[20].acceleration.x = -40; }},
};

/// The next keyframe, whose samples are damaged: as tracking does, it has a motion where they can be integrated.
/// \return what was said where they cannot
template <class Run>
std::string track_damaged(Run& run, const true_motion& motion, void (*make)(sample_list&)) {
  const auto k = track(run, motion);
  sample_list s;
  make(s);
  turbomap::preintegration_options options;
  options.acceleration_range = 4 * 9.81;
  try {
    const turbomap::imu_samples samples{s.t_ns, s.sample};
    turbomap::preintegrate(samples, turbomap::find_interval(samples, 0, 200'000'000), turbomap::imu_bias<double>{},
                           options);
  } catch (const std::invalid_argument& e) {
    run.map.clear_motion(k);
    return e.what();
  }
  return "";
}

/// A stereo pair with an initialised IMU, after so many keyframes.
template <class Policy>
struct initialised_run {
  mapping_scene<pinhole_camera> scene{pinhole_rig(50), noisy_recipe()};
  true_motion motion{scene};
  inertial_mapping<mapped_inertial, Policy> mapping;

  initialised_run(const Policy& policy, int keyframes)
      : mapping(scene, culled_inertial_options(noisy_recipe()), {}, policy) {
    mapping.map.set_gravity(motion.gravity), mapping.map.set_initialised(true);
    auto& inertial = mapping.mapper.options().inertial;
    inertial.strong_points = -1, inertial.window.keyframes = 100;  // all of the map
    for (int n = 0; n < keyframes; ++n) mapping.mapper.process(track(mapping, motion));
  }
  /// How many keyframes have a motion from the one before. Each is the true one, and over a hole there is none.
  std::size_t check_motions(const std::vector<int>& holes) const {
    const auto& all = mapping.keyframes();
    std::size_t known = 0;
    int before = 0;  // stays in the map
    for (int i = 1; i < static_cast<int>(all.size()); ++i) {
      const auto& k = all[static_cast<std::size_t>(i)];
      if (!mapping.map.alive(k)) continue;
      bool whole = true;
      for (const int hole : holes) whole = whole && (hole <= before || hole > i);
      const auto* p = mapping.map.motion(k);
      REQUIRE((p != nullptr) == whole);
      if (whole) CHECK(turbomap::norm(p->dP - motion.between(before, i).dP) < 1e-9);
      known += whole ? 1 : 0;
      before = i;
    }
    return known;
  }
  /// m: of the last keyframe from where it truly is.
  double error() const {
    const auto& k = mapping.keyframes().back();
    const auto n = static_cast<int>(mapping.keyframes().size()) - 1;
    return turbomap::norm(turbomap::camera_centre(turbomap::to_isometry<double>(mapping.map.T_cw(k))) -
                          motion.body(n).t);
  }
};

/// Samples that cannot be integrated are said by name, and mapping goes on without them.
template <class Policy>
void check_damaged_samples(const Policy& policy) {
  initialised_run<Policy> run(policy, 12);
  CHECK(track_damaged(run.mapping, run.motion, [](sample_list&) {}).empty());
  run.mapping.mapper.process(run.mapping.keyframes().back());
  std::vector<int> holes;  // keyframes at their ends
  for (const auto& d : sample_damages) {
    const std::string name = d.name;
    CAPTURE(name);
    const std::string said = track_damaged(run.mapping, run.motion, d.make);
    CAPTURE(said);
    CHECK(said.find(std::string("turbomap: ") + d.message + " = ") == 0);
    holes.push_back(static_cast<int>(run.mapping.keyframes().size()) - 1);
    for (int n = 0; n < 3; ++n) {
      CAPTURE(n);
      const auto k = n == 0 ? run.mapping.keyframes().back() : track(run.mapping, run.motion);
      const std::size_t motions = run.check_motions(holes);
      const auto& report = run.mapping.mapper.process(k);
      CHECK(report.refused.empty());  // a motion that is not known is no fault
      CHECK(report.adjustment.inertial);
      CHECK(report.adjustment.inertial_edges == motions);
      CHECK(report.adjustment.solve.accepted > 0);
      CHECK(report.adjustment.solve.undetermined == 0);
      REQUIRE(turbomap::validate(run.mapping.map).empty());
      CHECK(run.error() < 0.05);
    }
  }
}

/// Motions and states that cannot be used are reported, each with its keyframe, and mapping goes on.
template <class Policy>
void check_reported_motions(const Policy& policy) {
  constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
  const auto change = [](mapped_inertial& map, turbomap::map_keyframe_id k, int what) {
    auto p = *map.motion(k);
    if (what == 0) p.dV.x = nan_value;
    if (what == 1) p.C_VV(0, 0) = std::numeric_limits<double>::infinity();
    if (what == 2) p.dt = 0;
    if (what == 3) p.dt -= 0.1;  // of a part of the time: samples were missing, and nobody noticed
    if (what < 4) map.set_motion(k, p);
    if (what == 4) map.set_velocity(k, {0, nan_value, 0});
    if (what == 5) map.set_bias(k, {{}, {nan_value, 0, 0}});
  };
  for (int what = 0; what < 6; ++what) {
    CAPTURE(what);
    initialised_run<Policy> run(policy, 8);
    auto& options = run.mapping.mapper.options();
    options.enabled[turbomap::mapping_stage::keyframe_culling] = false;  // it merges motions, and the damage with them
    options.inertial.window.keyframes = 5;
    const auto k = track(run.mapping, run.motion);
    change(run.mapping.map, k, what);
    for (int n = 0; n < 8; ++n) {
      CAPTURE(n);
      const auto& report = run.mapping.mapper.process(n == 0 ? k : track(run.mapping, run.motion));
      for (const auto& r : report.refused) {
        CHECK(r.fault == (what < 4 ? turbomap::map_fault::bad_motion : turbomap::map_fault::bad_inertial_state));
        CHECK(r.keyframe == 8);
      }
      CHECK(report.refused.size() == (n < (what < 4 ? 5 : 6) ? 1 : 0));  // as long as it is in the window
      CHECK(report.adjustment.inertial);
      CHECK(report.adjustment.solve.accepted > 0);
      REQUIRE(turbomap::validate(run.mapping.map).empty());
      CHECK(run.error() < 0.03);
    }
  }
}

/// A body that is never accelerated: not initialised, and mapping goes on by what it sees.
template <class Policy>
void check_never_accelerated(const Policy& policy) {
  using turbomap::initialisation_end;
  for (const bool monocular : {false, true})
    for (const double sway : {0.0, 3.0}) {  // where it sways, it is initialised
      CAPTURE(monocular);
      CAPTURE(sway);
      mapping_recipe recipe = noisy_recipe();
      recipe.sway = sway;
      const mapping_scene<pinhole_camera> scene(pinhole_rig(50), recipe);
      const true_motion motion{scene};
      inertial_mapping<mapped_inertial, Policy> run(scene, culled_inertial_options(recipe), {}, policy);
      turbomap::inertial_initialisation<mapped_inertial> initialise;
      turbomap::initialisation_options how;
      how.monocular = monocular;  // whether the scale is asked for, too
      initialisation_end end{};
      for (int n = 0; n < 40; ++n) {
        CAPTURE(n);
        const auto& report = run.mapper.process(track(run, motion));
        CHECK(report.refused.empty());
        CHECK_FALSE(report.adjustment.inertial);
        CHECK((n == 0 || report.adjustment.solve.accepted > 0));
        REQUIRE(turbomap::validate(run.map).empty());
        const std::string before = content(run.map);
        end = initialise(run.map, run.keyframes().back(), how).end;
        if (end == initialisation_end::initialised) break;
        CHECK(content(run.map) == before);
        CHECK_FALSE(run.map.initialised());
      }
      CHECK(end == (sway > 0    ? initialisation_end::initialised
                    : monocular ? initialisation_end::scale_unknown
                                : initialisation_end::gravity_unknown));
    }
}

}  // namespace turbomap_test

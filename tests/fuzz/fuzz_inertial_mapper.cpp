// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Local mapping with an IMU, with fixed frames or a marginal prior before its windows, on a map itself and on a mirror of it,
// while others write whatever they like into both: also velocities, biases, motions and gravity; now and then the IMU is
// initialised. The maps stay sound, and are the same to the last bit.

#include <thrust/execution_policy.h>

#include <turbomap/mapping/inertial_initialisation.hpp>

#include <cmath>
#include <vector>

#include "adjustment/adjustment_results.hpp"
#include "hostile_inertial.hpp"
#include "mapper_world.hpp"
#include "scenes/inertial_motion.hpp"
#include "scenes/mirrored_map.hpp"

using namespace turbomap_fuzz;

namespace {

using direct = turbomap_test::mapped_inertial;
using mirrored = turbomap_test::mirrored_map<direct>;
using policy = std::decay_t<decltype(thrust::seq)>;
template <class Map>
using run_on = turbomap_test::inertial_mapping<Map, policy>;
using twins = twin_runs<run_on<direct>, run_on<mirrored>>;

/// Gravity, velocities and biases.
std::vector<double> states(const direct& map) {
  const auto g = map.gravity();
  std::vector<double> all{g.x, g.y, g.z};
  for (const auto k : keyframes_of(map)) {
    const auto v = map.velocity(k);
    const auto b = map.bias(k);
    all.insert(all.end(),
               {v.x, v.y, v.z, b.gyro.x, b.gyro.y, b.gyro.z, b.acceleration.x, b.acceleration.y, b.acceleration.z});
  }
  return all;
}
/// All that the IMU tells.
std::vector<double> inertial_numbers(const direct& map) {
  std::vector<double> all = states(map);
  for (const auto k : keyframes_of(map))
    if (const auto* m = map.motion(k)) {
      all.insert(all.end(), {m->dt, m->dV.x, m->dV.y, m->dV.z, m->dP.x, m->dP.y, m->dP.z});
      all.insert(all.end(), m->dR.m, m->dR.m + 9);
    }
  return all;
}
void compare(const direct& a, const direct& b) {
  expect(turbomap_test::content<direct>(a) == turbomap_test::content<direct>(b) &&
             turbomap_test::same_bits(inertial_numbers(a), inertial_numbers(b)),
         "a mirrored map is left as the map itself would be");
}

/// Somebody else writes what the IMU tells.
void edit_inertial(twins& t, choices& c) {
  const auto keyframes = keyframes_of(t.first.map);
  if (keyframes.empty()) return;
  const auto k = keyframes[c.below(keyframes.size())];
  state x{t.first.map.T_cw(k), t.first.map.velocity(k), t.first.map.bias(k)};
  const unsigned what = c.byte() % 4;
  if (what < 2) spoil_state(x, c);
  const bool moves = what == 2 && t.first.map.motion(k) != nullptr;
  turbomap::preintegration<double> motion;
  if (moves) motion = *t.first.map.motion(k), spoil_motion(motion, c);
  const auto gravity = c.vector(10);
  const auto write = [&](auto& run) {
    if (what < 2) run.map.set_pose(k, x.T_cw), run.map.set_velocity(k, x.velocity), run.map.set_bias(k, x.bias);
    if (moves) run.map.set_motion(k, motion);
    if (what == 3) run.map.set_gravity(gravity);
  };
  write(t.first), write(t.second);
  t.second.mapper.refresh();
  t.spoilt = t.spoilt || is_spoilt(t.first.map);
}

/// Gravity, velocities and biases are estimated from the poses, and the scale where the rig is said to have one camera. Limits
/// of what is believed are wide or as by default.
void initialise(twins& t, choices& c) {
  const auto keyframes = keyframes_of(t.first.map);
  if (keyframes.empty()) return;
  const auto current = keyframes[keyframes.size() - 1 - c.below(2) % keyframes.size()];
  turbomap::initialisation_options options;
  options.monocular = c.flag();
  options.min_keyframes = 5, options.min_seconds = 0;
  if (c.byte() % 4 != 0) options.max_scale_sigma = options.max_gravity_sigma = 1e3;
  t.both([&](auto& run) {
    const direct& map = run.map;
    const auto before = states(map);
    const auto poses = turbomap_test::content<direct>(map);
    turbomap::inertial_initialisation<std::decay_t<decltype(run.map)>> stage;
    const auto& found = stage(run.map, current, options);
    expect(!stage.stale(), "nobody changes the map meanwhile");
    if (!found) {  // motions may have been integrated again
      expect(turbomap_test::same_bits(states(map), before) && turbomap_test::content<direct>(map) == poses,
             "a map that is not initialised is as it was");
      return;
    }
    const auto g = map.gravity();
    expect(found.scale > 0 && std::isfinite(found.scale) && (options.monocular || found.scale == 1),
           "a scale is a number above 0, and 1 where it is known");
    expect(std::abs(std::sqrt(g.x * g.x + g.y * g.y + g.z * g.z) - options.gravity) < 1e-6,
           "gravity is as strong as it is");
    for (const auto& v : found.velocity)
      expect(std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z), "velocities are numbers");
  });
  t.second.mapper.refresh();
  t.spoilt = t.spoilt || is_spoilt(t.first.map);
}

void live(choices& c) {
  const turbomap_test::mapping_scene<turbomap_test::pinhole_camera> scene(turbomap_test::pinhole_rig(50),
                                                                          draw_recipe(c));
  const turbomap_test::true_motion motion{scene};
  auto options = turbomap_test::culled_inertial_options(scene.recipe());
  draw_options(options, c);
  options.keyframe_culling.keep_keyframes = 4;
  options.inertial.marginal_prior = c.flag(), options.inertial.strong_points = c.flag() ? -1 : 100;
  options.inertial.window.keyframes = 2 + static_cast<int>(c.below(4));
  options.inertial.fewest_edges = static_cast<int>(c.below(4));
  options.checked_share = c.flag() ? 0 : 1;
  twins t(scene, options, draw_store(c));
  const std::size_t last = 5 + c.below(6), initialised = c.below(5);
  const bool undisturbed = c.byte() % 4 == 0;  // so that more initialisations find what they look for
  for (std::size_t n = 0; n < last; ++n) {
    if (n > 1 && !undisturbed) {
      for (unsigned edits = c.byte() % 3; edits > 0; --edits) t.edit(c);
      for (unsigned edits = c.byte() % 3; edits > 0; --edits) edit_inertial(t, c);
    }
    if (n > 4 && c.flag()) initialise(t, c), compare(t.first.map, t.second.map);
    if (n == 0) t.first.map.set_gravity(motion.gravity), t.second.map.set_gravity(motion.gravity);
    t.both([&](auto& run) {
      const auto k = turbomap_test::track(run, motion);
      run.map.set_initialised(n >= initialised);
      run.mapper.process(k);
    });
    compare(t.first.map, t.second.map);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  live(c);
  return 0;
}

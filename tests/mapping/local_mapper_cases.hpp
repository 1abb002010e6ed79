// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What local mapping must do under every execution policy, host or device: make the map that it makes under thrust::seq,
/// sound after every keyframe, and true.

#include <turbomap/local_mapper.hpp>
#include <turbomap/map/validate.hpp>

#include <thrust/detail/seq.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

#include "reference/larger_or_nan.hpp"
#include "scenes/mapping_scene.hpp"

namespace turbomap_test {

using sequential_policy = std::decay_t<decltype(thrust::seq)>;
template <class Camera>
using mapped_by = turbomap::simple_map<turbomap::binary_descriptor<256>, Camera>;

/// A rig, its scene and its options.
template <class Camera>
struct mapping_case {
  test_rig<Camera> rig;
  mapping_recipe recipe;
  turbomap::local_mapper_options options;
};

inline mapping_case<pinhole_camera> stereo_case(const mapping_recipe& recipe = {}) {
  return {pinhole_rig(50), recipe, turbomap::local_mapper_options::stereo(0.11, 6, recipe.scales)};
}
inline mapping_case<fisheye_camera> rig_case(const mapping_recipe& recipe = {}) {
  return {fisheye_rig(2), recipe, turbomap::local_mapper_options::stereo(0.1, 6, recipe.scales)};
}
inline mapping_case<pinhole_camera> monocular_case(mapping_recipe recipe = {}) {
  recipe.fresh = 0.8;
  return {pinhole_rig(), recipe, turbomap::local_mapper_options::monocular(recipe.scales)};
}
inline mapping_recipe noisy(unsigned seed, double pixels = 0.4, int bits = 20) {
  mapping_recipe recipe;
  recipe.seed = seed, recipe.pixel_noise = pixels, recipe.noisy_bits = bits;
  return recipe;
}

/// The counts of reports that do not depend on the clock.
inline std::vector<std::uint64_t> counts(const turbomap::mapping_report& r) {
  std::vector<std::uint64_t> all{r.neighbours,      r.matches,        r.points_created,
                                 r.points_culled,   r.fusion_targets, r.fused.entries,
                                 r.fused.merged,    r.fused.stale,    r.fused.observations_added,
                                 r.fused.conflicts, r.points_updated, r.fused.already_observed};
  all.insert(all.end(), r.keyframes_culled.begin(), r.keyframes_culled.end());
  return all;
}

/// Policy and thrust::seq make the same map, keyframe by keyframe; after each of them it is sound. \param exact  to the last
/// bit; else floating point numbers within 1e-9
template <class Policy, class Camera>
void check_same_map(const Policy& policy, const mapping_case<Camera>& c, int keyframes, bool exact = true) {
  const mapping_scene<Camera> scene(c.rig, c.recipe);
  mapping_run<mapped_by<Camera>, Policy> run(scene, c.options, {}, policy);
  mapping_run<mapped_by<Camera>, sequential_policy> expected(scene, c.options);
  std::size_t merged = 0, created = 0;
  for (int n = 0; n < keyframes; ++n) {
    CAPTURE(n);
    const auto& a = run.step();
    const auto& b = expected.step();
    REQUIRE(counts(a) == counts(b));
    REQUIRE(content(run.map, exact) == content(expected.map, exact));
    const auto faults = turbomap::validate(run.map);
    if (!faults.empty()) CAPTURE(turbomap::to_string(faults[0]));
    REQUIRE(faults.empty());
    merged += a.fused.merged, created += a.points_created;
    for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) {
      const auto stage = static_cast<turbomap::mapping_stage>(s);
      CHECK(a.outcome[stage] == (stage == turbomap::mapping_stage::adjustment ? turbomap::stage_outcome::off
                                                                              : turbomap::stage_outcome::done));
    }
  }
  CHECK(created > 20);
  CHECK(merged + (c.options.neighbours.stereo_baseline > 0 ? 0 : 20) > 20);
  using traits = turbomap::map_traits<mapped_by<Camera>>;
  double worst = 0;
  std::vector<turbomap::vec3<double>> positions;
  traits::for_each_point(expected.map,
                         [&](turbomap::map_point_id p) { positions.push_back(expected.map.position(p)); });
  std::size_t i = 0;
  traits::for_each_point(run.map, [&](turbomap::map_point_id p) {
    const auto &x = run.map.position(p), &y = positions[i++];
    worst = larger_or_nan(worst, std::abs(x.x - y.x) + std::abs(x.y - y.y) + std::abs(x.z - y.z));
  });
  CHECK(worst <= (exact ? 0 : 1e-9));
}

/// A digest of bytes, number after number (FNV-1a).
class decision_digest {
 public:
  void add(const void* data, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; ++i)
      value_ = (value_ ^ static_cast<const unsigned char*>(data)[i]) * 1099511628211U;
  }
  template <class Run>
  void add(const Run& run, const turbomap::mapping_report& report, bool computed, bool poses) {
    const auto counted = counts(report);
    const std::string map = content(run.map, computed, poses);
    add(counted.data(), counted.size() * sizeof counted[0]), add(map.data(), map.size());
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 14695981039346656037U;
};

/// All integers of a run whose inputs do not depend on the compiler: what each stage counted, and names, octaves, descriptors
/// and observations of the map after each keyframe. Poses stay as they were given: no adjustment.
/// \param computed  what is computed of points counts too: positions, normals, ranges
template <class Policy, class Camera>
std::uint64_t decisions(const Policy& policy, mapping_case<Camera> c, int keyframes, bool computed = false) {
  c.recipe.rounded = true;
  const mapping_scene<Camera> scene(c.rig, c.recipe);
  mapping_run<mapped_by<Camera>, Policy> run(scene, c.options, {}, policy);
  decision_digest digest;
  for (int n = 0; n < keyframes; ++n) digest.add(run, run.step(), computed, true);
  CHECK(run.quality().points > 100);
  return digest.value();
}

/// The same of a run with its adjustments, in float64: which observations each of them took out besides. Poses and points differ
/// in their last bits between compilers, and a decision does only where a number lies as close to its limit.
template <class Policy, class Camera>
std::uint64_t adjusted_decisions(const Policy& policy, mapping_case<Camera> c, int keyframes) {
  using map_type = mapped_by<Camera>;
  using methods = turbomap::adjustment_methods<turbomap::adjustment_methods<>::solvers,
                                               turbomap::precision_list<turbomap::precision::float64>>;
  c.recipe.rounded = true;
  c.options.adjustment.solve.numbers = turbomap::precision::float64;
  const mapping_scene<Camera> scene(c.rig, c.recipe);
  mapping_run<map_type, Policy, turbomap::local_adjustment<map_type, Policy, methods>> run(scene, c.options, {},
                                                                                           policy);
  decision_digest digest;
  std::size_t adjusted = 0, taken_out = 0;
  for (int n = 0; n < keyframes; ++n) {
    const turbomap::mapping_report& report = run.step();
    const turbomap::local_adjustment_summary& window = report.adjustment;
    const std::uint64_t counted[] = {window.free_keyframes, window.fixed_keyframes, window.points,
                                     window.observations,   window.outliers,        window.points_erased};
    digest.add(run, report, false, false), digest.add(counted, sizeof counted);
    adjusted += window.free_keyframes, taken_out += window.outliers;
  }
  CHECK(run.quality().points > 100);
  CHECK(adjusted > 0);
  CHECK(taken_out > 0);
  return digest.value();
}

/// Prints a digest as a line `turbomap-digest NAME VALUE`, which scripts compare, and returns it.
inline std::uint64_t print_digest(const char* name, std::uint64_t digest) {
  std::printf("turbomap-digest %s %016llx\n", name, static_cast<unsigned long long>(digest));
  return digest;
}

/// decisions() of four scenes, printed.
template <class Policy>
std::vector<std::uint64_t> print_decisions(const Policy& policy) {
  mapping_recipe back = noisy(5);
  back.turn_back = 6;
  auto pairs = rig_case(noisy(9));
  pairs.options.creation.rule = turbomap::creation_rule::pairs;
  return {print_digest("stereo-decisions", decisions(policy, stereo_case(back), 14)),
          print_digest("fisheye-rig-decisions", decisions(policy, rig_case(noisy(6)), 9)),
          print_digest("fisheye-rig-pairs-decisions", decisions(policy, pairs, 9)),
          print_digest("mono-decisions", decisions(policy, monocular_case(noisy(7)), 12))};
}

/// adjusted_decisions() of two scenes whose noise takes some observations beyond their gate, printed.
template <class Policy>
std::vector<std::uint64_t> print_adjusted_decisions(const Policy& policy) {
  return {print_digest("stereo-adjusted-decisions", adjusted_decisions(policy, stereo_case(noisy(5, 1.2)), 12)),
          print_digest("fisheye-rig-adjusted-decisions", adjusted_decisions(policy, rig_case(noisy(6, 1.2)), 9))};
}

/// A whole run, and what became of the truth.
template <class Policy, class Camera>
map_quality quality_of(const Policy& policy, const mapping_case<Camera>& c, int keyframes) {
  const mapping_scene<Camera> scene(c.rig, c.recipe);
  mapping_run<mapped_by<Camera>, Policy> run(scene, c.options, {}, policy);
  run.steps(keyframes);
  CHECK(turbomap::validate(run.map).empty());
  return run.quality();
}

/// Without noise no point is wrong, none is merged with another's, and what is made lies where its landmark is.
inline void check_perfect(const map_quality& q, std::size_t least_merged) {
  CHECK(q.points > 100);
  CHECK(q.merged >= least_merged);
  CHECK(q.merged_wrongly == 0);
  CHECK(q.mixed == 0);
  CHECK(q.worst_error < 1e-3);
  CHECK(q.duplicates * 20 <= q.points);
}
/// With noise, and landmarks that look alike side by side, less than one merge in a hundred is wrong.
inline void check_good(const map_quality& q) {
  CAPTURE(q.merged);
  CAPTURE(q.mixed);
  CHECK(q.merged > 200);
  CHECK(q.merged_wrongly * 100 < q.merged);
  CHECK(q.mixed * 50 < q.points);
}

}  // namespace turbomap_test

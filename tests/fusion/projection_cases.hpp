// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The checks of what the search by projection does beyond the duplicate search, for every execution policy, host or device.

#include <set>
#include <utility>
#include <vector>

#include "duplicate_cases.hpp"

namespace turbomap_test {

using turbomap::projection_options;
using turbomap::projection_outcome;

/// Points that crowd around few keypoints, some of which are taken; windows wide enough that points meet.
inline duplicate_recipe crowded(unsigned seed) {
  duplicate_recipe recipe = seeded(seed);
  recipe.points = 300, recipe.clutter = 60, recipe.taken = 0.15, recipe.noise = 25;
  return recipe;
}
inline projection_options wide() {
  projection_options options;
  options.radius = 8, options.oblique_cosine = 0.8, options.coarser_octaves = 1;
  return options;
}

/// Trials before claims == the oracle; with one_to_one == those, settled by its oracle; the plan has each keypoint once.
template <class Policy, class Descriptor, class Camera>
void check_projections(const Policy& policy, duplicate_scene<Descriptor, Camera>& s, projection_options options,
                       duplicate_tally& t) {
  options.scales = s.scales();
  duplicate_tally before;
  options.one_to_one = false;
  check_duplicates(policy, s, s.points(), options, before);
  t.trials += before.trials, t.doubtful += before.doubtful, t.differences += before.differences;
  auto expected = find_under(policy, s, s.points(), options).trials;
  options.one_to_one = true;
  const auto found = find_alike(policy, s, s.points(), options);
  REQUIRE(found.trials.size() == expected.size());
  const std::size_t points = s.position.size();
  for (std::size_t i = 0; i < expected.size(); i += points)
    settle_oracle(expected.data() + i, static_cast<int>(points));
  CHECK(same(found.trials, expected));
  for (const auto& trial : expected) ++t.outcomes[static_cast<std::size_t>(trial.outcome)];
  std::set<std::pair<int, int>> keypoints;
  for (const auto& m : found.plan) {
    CHECK(keypoints.emplace(m.target, m.keypoint).second);
    const auto& taken = s.taken[static_cast<std::size_t>(m.target)];
    CHECK((taken.empty() || taken[static_cast<std::size_t>(m.keypoint)] == 0));
  }
}

template <class Descriptor = orb, class Policy, class Camera>
duplicate_tally check_projection_scenes(const Policy& policy, const std::vector<test_rig<Camera>>& rigs,
                                        duplicate_recipe recipe, const projection_options& options,
                                        unsigned scenes = 4) {
  duplicate_tally t;
  for (unsigned i = 0; i < scenes; ++i, ++recipe.seed) {
    duplicate_scene<Descriptor, Camera> s(rigs, recipe);
    check_projections(policy, s, options, t);
  }
  return t;
}

}  // namespace turbomap_test

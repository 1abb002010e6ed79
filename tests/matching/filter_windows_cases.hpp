// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The checks of what filters compare a match with: windows of the epipolar order, visual word groups.

#include <vector>

#include "filters_cases.hpp"

namespace turbomap_test {

/// On views as large as real ones, under usual gates: filters after an ordered search, which ask windows only, leave
/// what they leave after an exhaustive one. Also where a camera's resolution is unknown, and where few matches are
/// left.
template <class Policy, class Camera>
void check_filter_windows(const test_rig<Camera>& rig, unsigned seed) {
  long removed = 0;
  for (const motion how : every_motion)
    for (const double max_distance : {100.0, 12.0}) {
      scene_recipe recipe;
      recipe.seed = seed++, recipe.how = how, recipe.neighbours = 3, recipe.mapped = 0.2;
      recipe.query_keypoints = 700, recipe.neighbour_keypoints = 600;
      recipe.landmarks = 0.8, recipe.prototypes = 60, recipe.noise = 14;
      scene<orb, Camera> s(rig, recipe);
      turbomap::search_options options;
      options.scales = s.scales();
      options.max_distance = max_distance;
      const auto left = [&](turbomap::candidates set, const auto&... filters) {
        options.candidate_set = set;
        searched<Policy, orb, Camera> r(Policy{}, s, options);
        const auto before = r.plan().size();
        turbomap::filter(r.ctx, r.matches, filters...);
        removed += static_cast<long>(before - r.plan().size());
        return r.plan();
      };
      const auto check = [&](const auto&... filters) {
        CHECK(same(left(turbomap::candidates::epipolar_ordered, filters...),
                   left(turbomap::candidates::exhaustive, filters...)));
      };
      check(ratio_test{0.95});
      check(mutual_best{});
      check(one_to_one{}, mutual_best{}, ratio_test{0.9});
    }
  CHECK(removed > 500);
}

/// Given matches across groups: 'the others' are the keypoints of the group of the one that is kept fixed.
template <class Policy>
void check_given_matches_of_other_groups() {
  scene_recipe recipe = crowded(40);
  scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
  auto options = permissive();
  options.scales = s.scales();
  options.candidate_set = turbomap::candidates::exhaustive;
  turbomap::context<Policy> ctx(Policy{});
  const resident_scene<orb, pinhole_camera, Policy> keyframes(ctx, s);
  turbomap::correspondences<orb, pinhole_camera, Policy> result(ctx);
  turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours(), options, result);
  const auto found = result.plan(ctx);
  options.candidate_set = turbomap::candidates::grouped;
  filter_input<orb, pinhole_camera> in(s.query(), s.neighbours(), options);
  const auto check = [&](const auto& filter) {
    turbomap::given_correspondences(ctx, keyframes.query(), keyframes.neighbours(),
                                    turbomap::span<const turbomap::correspondence<orb::distance_type>>(found), options,
                                    result);
    turbomap::filter(ctx, result, filter);
    in.matches = found;
    in.doubtful.clear();
    const auto expected = oracle_filter(in, filter);
    CHECK(expected.size() < found.size());
    CHECK(count_differences(expected, result.plan(ctx), in.doubtful, [](auto& a, auto& b) { return same(a, b); }) == 0);
  };
  check(ratio_test{0.95});
  check(mutual_best{});
}

}  // namespace turbomap_test

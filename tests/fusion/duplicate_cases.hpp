// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The checks of the search by projection, and of the duplicate search, for every execution policy, host or device.

#include <turbomap/descriptor/binary.hpp>
#include <turbomap/fusion/duplicate_search.hpp>

#include <thrust/detail/seq.h>

#include <array>
#include <cstring>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

#include "reference/projection_oracle.hpp"
#include "reference/same_plans.hpp"
#include "scenes/duplicate_scene.hpp"

namespace turbomap_test {

using sequential = std::decay_t<decltype(thrust::seq)>;
using orb = turbomap::binary_descriptor<256>;

/// What a comparison with the oracle has seen, over many scenes.
struct duplicate_tally {
  long trials = 0, doubtful = 0, differences = 0;
  std::array<long, 12> outcomes{};
};
/// Everything equal, few trials left out, and every outcome often enough to mean something.
inline void check_duplicate_tally(const duplicate_tally& t, long least, double doubtful_share = 0.002) {
  CAPTURE(t.trials);
  CAPTURE(t.doubtful);
  CHECK(t.differences == 0);
  CHECK(static_cast<double>(t.doubtful) <= doubtful_share * static_cast<double>(t.trials));
  for (const int outcome : {0, 1, 3, 4, 5, 6, 7, 8, 9}) {
    CAPTURE(outcome);
    CHECK(t.outcomes[static_cast<std::size_t>(outcome)] >= least);
  }
}

/// What the library finds under a policy: the plan of an ordinary search, and the trials of another with its plan.
template <class Descriptor>
struct duplicates_found {
  std::vector<turbomap::duplicate<typename Descriptor::distance_type>> plan, plan_of_trials;
  std::vector<turbomap::duplicate_trial<typename Descriptor::distance_type>> trials;
};
template <class Descriptor, class Camera, class Policy>
void search(turbomap::context<Policy>& ctx, const turbomap::map_point_view<Descriptor>& points,
            turbomap::span<const turbomap::duplicate_target<Descriptor, Camera>> targets,
            const turbomap::duplicate_options& options, turbomap::duplicates<Descriptor, Camera, Policy>& result) {
  turbomap::find_duplicates(ctx, points, targets, options, result);
}
template <class Descriptor, class Camera, class Policy>
void search(turbomap::context<Policy>& ctx, const turbomap::map_point_view<Descriptor>& points,
            turbomap::span<const turbomap::projection_target<Descriptor, Camera>> targets,
            const turbomap::projection_options& options, turbomap::projections<Descriptor, Camera, Policy>& result) {
  turbomap::search_by_projection(ctx, points, targets, options, result);
}
template <class Policy, class Descriptor, class Camera, class Options = turbomap::duplicate_options>
duplicates_found<Descriptor> find_under(const Policy& policy, const duplicate_scene<Descriptor, Camera>& s,
                                        const turbomap::map_point_view<Descriptor>& points, Options options) {
  turbomap::context<Policy> ctx(policy);
  const resident_targets<Descriptor, Camera, Policy> resident(ctx, s);
  turbomap::projections<Descriptor, Camera, Policy> result(ctx);
  duplicates_found<Descriptor> found;
  options.keep_trials = true;
  search(ctx, points, resident.targets(), options, result);
  found.plan_of_trials = result.plan(ctx);
  found.trials = result.trials(ctx);
  options.keep_trials = false;
  search(ctx, points, resident.targets(), options, result);
  found.plan = result.plan(ctx);
  CHECK_THROWS_AS(result.trials(ctx), std::invalid_argument);
  return found;
}

/// The matches among trials, in their order.
template <class Descriptor, class Camera>
auto plan_of_trials(const duplicate_scene<Descriptor, Camera>& s, const duplicates_found<Descriptor>& found) {
  std::vector<turbomap::duplicate<typename Descriptor::distance_type>> plan;
  std::size_t i = 0;
  for (std::size_t t = 0; t < s.frames.size(); ++t)
    for (std::size_t c = 0; c < s.frames[t].cameras.size(); ++c)
      for (std::size_t p = 0; p < s.position.size(); ++p, ++i)
        if (const auto& a = found.trials.at(i); a.outcome == turbomap::duplicate_outcome::matched)
          plan.push_back({static_cast<int>(t), static_cast<int>(c), static_cast<int>(p), a.keypoint, a.distance});
  return plan;
}

/// Search under `policy` == search under thrust::seq, to the last bit; what is skipped early would not have matched.
template <class Policy, class Descriptor, class Camera, class Options = turbomap::duplicate_options>
duplicates_found<Descriptor> find_alike(const Policy& policy, const duplicate_scene<Descriptor, Camera>& s,
                                        const turbomap::map_point_view<Descriptor>& points, const Options& options) {
  const auto found = find_under(policy, s, points, options);
  const auto matches = plan_of_trials(s, found);
  CHECK(same(found.plan_of_trials, matches));
  CHECK(same(found.plan, matches));
  if constexpr (!std::is_same_v<Policy, sequential>) {
    const auto expected = find_under(sequential{}, s, points, options);
    CHECK(same(found.trials, expected.trials));
    CHECK(same(found.plan, expected.plan));
  }
  return found;
}

/// The same, and == the oracle.
template <class Policy, class Descriptor, class Camera, class Options = turbomap::duplicate_options>
void check_duplicates(const Policy& policy, duplicate_scene<Descriptor, Camera>& s,
                      const turbomap::map_point_view<Descriptor>& points, Options options, duplicate_tally& t) {
  options.scales = s.scales();
  const auto found = find_alike(policy, s, points, options);
  const auto targets = s.targets();
  turbomap::projection_options plain = options;  // the oracle settles no claims: see projection_cases.hpp
  plain.one_to_one = false;
  const auto oracle = projection_oracle<Descriptor, Camera>(points, targets, plain);
  REQUIRE(found.trials.size() == oracle.size());
  for (std::size_t i = 0; i < oracle.size(); ++i) {
    ++t.trials;
    ++t.outcomes[static_cast<std::size_t>(oracle[i].trial.outcome)];
    if (oracle[i].doubtful)
      ++t.doubtful;
    else
      t.differences += same(found.trials[i], oracle[i].trial) ? 0 : 1;
  }
}
template <class Policy, class Descriptor, class Camera, class Options = turbomap::duplicate_options>
void check_duplicates(const Policy& policy, duplicate_scene<Descriptor, Camera>& s, const Options& options,
                      duplicate_tally& t) {
  check_duplicates(policy, s, s.points(), options, t);
}

/// Several scenes of one kind.
template <class Descriptor = orb, class Policy, class Camera, class Options = turbomap::duplicate_options>
duplicate_tally check_scenes(const Policy& policy, const std::vector<test_rig<Camera>>& rigs, duplicate_recipe recipe,
                             const Options& options = {}, unsigned scenes = 4) {
  duplicate_tally t;
  for (unsigned i = 0; i < scenes; ++i, ++recipe.seed) {
    duplicate_scene<Descriptor, Camera> s(rigs, recipe);
    check_duplicates(policy, s, options, t);
  }
  return t;
}

template <class Descriptor = orb, class Policy, class Camera, class Options = turbomap::duplicate_options>
duplicate_tally check_scenes(const Policy& policy, const test_rig<Camera>& rig, const duplicate_recipe& recipe,
                             const Options& options = {}, unsigned scenes = 4) {
  return check_scenes<Descriptor>(policy, std::vector<test_rig<Camera>>{rig}, recipe, options, scenes);
}

inline duplicate_recipe seeded(unsigned seed) {
  duplicate_recipe recipe;
  recipe.seed = seed;
  return recipe;
}

/// Fisheye rigs of one, two and three cameras in one call.
inline std::vector<test_rig<fisheye_camera>> fisheye_rigs() { return {fisheye_rig(2), fisheye_rig(1), fisheye_rig(3)}; }

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The checks of the filters of correspondences, for every execution policy, host or device.

#include <turbomap/descriptor/real.hpp>
#include <turbomap/matching/filters.hpp>
#include <turbomap/matching/given_correspondences.hpp>

#include <array>
#include <stdexcept>
#include <string>
#include <vector>

#include "matching_cases.hpp"
#include "reference/filters_oracle.hpp"
#include "scenes/keyframe_samples.hpp"

namespace turbomap_test {

using turbomap::mutual_best;
using turbomap::one_to_one;
using turbomap::ratio_test;
using turbomap::rotation_histogram;

/// A user's own filter: reads the views and the distance.
struct upper_half_or_near {
  float row;
  double near;
  template <class D, class C>
  TURBOMAP_HD bool keep(const turbomap::search_view<D, C>& search, int i) const {
    const auto& p = search.neighbour(i / search.slot_count).pixel[search.match[i]];
    return p.y < row || search.distance[i] <= near;
  }
};
struct nothing {
  template <class D, class C>
  TURBOMAP_HD bool keep(const turbomap::search_view<D, C>&, int) const {
    return false;
  }
};
template <class D, class C>
bool oracle_keeps(filter_input<D, C>& in, const typename filter_input<D, C>::match& m, const upper_half_or_near& f) {
  const auto& view = in.neighbours[static_cast<std::size_t>(m.neighbour)].view;
  return view.pixel[m.candidate].y < f.row || m.distance <= f.near;
}

/// The scene's search under a policy, with all that it lives from.
template <class Policy, class Descriptor, class Camera>
struct searched {
  turbomap::context<Policy> ctx;
  resident_scene<Descriptor, Camera, Policy> keyframes;
  turbomap::correspondences<Descriptor, Camera, Policy> matches;

  searched(const Policy& policy, const scene<Descriptor, Camera>& s, const turbomap::search_options& options)
      : ctx(policy), keyframes(ctx, s), matches(ctx) {
    turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours(), options, matches);
  }
  plan_of<Descriptor, Camera> plan() { return matches.plan(ctx); }
};

/// Each filter after the one before it: == the oracle on what was left, and == under thrust::seq; all of them in one
/// call give the same.
template <class Policy, class Descriptor, class Camera, class... Filters>
void check_filters(const Policy& policy, scene<Descriptor, Camera>& s, turbomap::search_options options, tally& t,
                   const Filters&... filters) {
  options.scales = s.scales();
  filter_input<Descriptor, Camera> in(s.query(), s.neighbours(), options);
  searched<Policy, Descriptor, Camera> step(policy, s, options), at_once(policy, s, options);
  searched<sequential, Descriptor, Camera> plain(sequential{}, s, options);
  in.matches = step.plan();
  const auto check_one = [&](const auto& filter) {
    in.doubtful.clear();
    const auto expected = oracle_filter(in, filter);
    turbomap::filter(step.ctx, step.matches, filter);
    turbomap::filter(plain.ctx, plain.matches, filter);
    const auto got = step.plan();
    CHECK(same(got, plain.plan()));
    t.results += static_cast<long>(in.matches.size());
    t.doubtful += static_cast<long>(in.doubtful.size());
    t.matches += static_cast<long>(in.matches.size() - expected.size());  // what was removed
    t.differences += count_differences(expected, got, in.doubtful, [](auto& a, auto& b) { return same(a, b); });
    in.matches = got;
  };
  (check_one(filters), ...);
  turbomap::filter(at_once.ctx, at_once.matches, filters...);
  CHECK(same(at_once.plan(), in.matches));
}

/// Many candidates in few groups, alike, so that each filter has something to do.
inline scene_recipe crowded(unsigned seed) {
  scene_recipe recipe;
  recipe.seed = seed, recipe.neighbours = 2, recipe.query_keypoints = recipe.neighbour_keypoints = 100;
  recipe.mapped = 0.1, recipe.landmarks = 0.9, recipe.prototypes = 4, recipe.groups = 3, recipe.noise = 14;
  return recipe;
}
/// Wide gates for the same reason.
inline turbomap::search_options permissive() {
  turbomap::search_options options;
  options.line_chi2 = 200, options.reprojection_chi2 = 200, options.epipole_radius = 1;
  return options;
}

/// Every filter alone and several orders, for all candidate sets.
template <class Policy, class Descriptor = orb, class Camera>
void check_all_filters(const test_rig<Camera>& rig, scene_recipe recipe, turbomap::search_options options,
                       long least_removed) {
  const Policy policy{};
  for (const auto set : every_candidate_set) {
    options.candidate_set = set;
    tally ratio, mutual, rotation, one, own, several;
    for (const motion how : {motion::sideways, motion::forward}) {
      recipe.how = how;
      ++recipe.seed;
      scene<Descriptor, Camera> s(rig, recipe);
      check_filters(policy, s, options, ratio, ratio_test{0.9});
      check_filters(policy, s, options, mutual, mutual_best{});
      check_filters(policy, s, options, rotation, rotation_histogram{});
      check_filters(policy, s, options, rotation, rotation_histogram{7, 2, 0.9});
      check_filters(policy, s, options, one, one_to_one{});
      check_filters(policy, s, options, own, upper_half_or_near{200, options.max_distance / 10});
      check_filters(policy, s, options, several, ratio_test{}, mutual_best{}, rotation_histogram{12, 5, 0.2},
                    one_to_one{});
      check_filters(policy, s, options, several, one_to_one{}, rotation_histogram{12, 5, 0.2},
                    upper_half_or_near{300, options.max_distance / 15}, mutual_best{}, ratio_test{0.95});
    }
    for (const tally* t : {&ratio, &mutual, &rotation, &one, &own, &several}) {
      CAPTURE(static_cast<int>(set));
      CAPTURE(t->results);
      CAPTURE(t->matches);
      CHECK(t->differences == 0);
      CHECK(t->doubtful * 25 <= t->results);
      CHECK(t->matches >= least_removed);
      CHECK(t->matches < t->results);
    }
  }
}

/// N matches, keypoint i with keypoint i of one neighbour, whose angles and distances the test says.
template <class Policy>
class given_matches {
 public:
  using plan_type = plan_of<orb, pinhole_camera>;

  given_matches(const std::vector<float>& query_angles, const std::vector<float>& neighbour_angles)
      : scene_(pinhole_rig(), recipe(query_angles.size())) {
    for (std::size_t i = 0; i < query_angles.size(); ++i) {
      scene_.frames[0].keypoints[i].angle = query_angles[i];
      scene_.frames[1].keypoints[i].angle = neighbour_angles[i];
      matches_.push_back({0, static_cast<std::int32_t>(i), static_cast<std::int32_t>(i), 0});
    }
    for (auto& f : scene_.frames) scene_.repack(f);
  }
  plan_type& matches() { return matches_; }
  /// The query keypoints that are left.
  template <class... Filters>
  std::vector<int> left(const Filters&... filters) {
    const Policy policy{};
    turbomap::context<Policy> ctx(policy);
    const resident_scene<orb, pinhole_camera, Policy> keyframes(ctx, scene_);
    turbomap::correspondences<orb, pinhole_camera, Policy> result(ctx);
    turbomap::given_correspondences(ctx, keyframes.query(), keyframes.neighbours(),
                                    turbomap::span<const plan_type::value_type>(matches_), {}, result);
    turbomap::filter(ctx, result, filters...);
    std::vector<int> queries;
    for (const auto& m : result.plan(ctx)) queries.push_back(m.query);
    return queries;
  }

 private:
  static scene_recipe recipe(std::size_t keypoints) {
    scene_recipe r;
    r.neighbours = 1, r.query_keypoints = r.neighbour_keypoints = static_cast<int>(keypoints);
    r.mapped = -1;
    return r;
  }
  scene<orb, pinhole_camera> scene_;
  plan_type matches_;
};

template <class Policy>
void check_rotation_edges() {
  using ints = std::vector<int>;
  const rotation_histogram fullest{30, 1, 0};
  {
    given_matches<Policy> equal({77, 77, 77, 77}, {77, 77, 77, 77});
    CHECK(equal.left(rotation_histogram{}) == ints{0, 1, 2, 3});
    CHECK(equal.left(rotation_histogram{1, 1, 1}) == ints{0, 1, 2, 3});
  }
  {  // changes of 1.5 and 4 degrees share the bin [0, 12) although the first is -358.5; -1 does not, nor do 11.9 and 12
    given_matches<Policy> wrap({1, 4, 0, 11.875F, 12, 359.5F}, {359.5F, 0, 1, 0, 0, 358});
    CHECK(wrap.left(fullest) == ints{0, 1, 3, 5});
    CHECK(wrap.left(rotation_histogram{30, 2, 0}) == ints{0, 1, 3, 4, 5});  // equal counts: the lower bin, 12 not -1
    CHECK(wrap.left(rotation_histogram{30, 3, 0}) == ints{0, 1, 2, 3, 4, 5});
    CHECK(wrap.left(rotation_histogram{30, 3, 0.25}) == ints{0, 1, 2, 3, 4, 5});
    CHECK(wrap.left(rotation_histogram{30, 3, 0.3}) == ints{0, 1, 3, 5});
    CHECK(wrap.left(rotation_histogram{30, 100, 0}) == ints{0, 1, 2, 3, 4, 5});
  }
  {  // a change that rounds to a full turn is in the last bin, and angles beyond [0, 360) do no harm
    given_matches<Policy> odd({0, 359.999F, 1e30F, -1e30F, -720}, {1e-9F, 0, 0, 0, 3000});
    CHECK(odd.left(fullest) == ints{0, 1, 2});
    CHECK(odd.left(rotation_histogram{30, 2, 0}) == ints{0, 1, 2, 3, 4});
  }
}

template <class Policy>
void check_one_to_one_edges() {
  using ints = std::vector<int>;
  given_matches<Policy> given({0, 0, 0, 0, 0}, {0, 0, 0, 0, 0});
  auto& m = given.matches();
  m[0].distance = 7, m[1].distance = 3, m[2].distance = 3, m[3].distance = 3, m[4].distance = 0;
  CHECK(given.left(one_to_one{}) == ints{0, 1, 2, 3, 4});
  for (auto& k : m) k.candidate = 2;
  CHECK(given.left(one_to_one{}) == ints{4});
  m[4].distance = 3;
  CHECK(given.left(one_to_one{}) == ints{1});  // equal: the lower query keypoint
  m[0].candidate = 0;
  CHECK(given.left(one_to_one{}) == ints{0, 1});
  m.clear();
  CHECK(given.left(ratio_test{}, mutual_best{}, rotation_histogram{}, one_to_one{}).empty());
}

/// Nothing to filter: no keypoints, no neighbours, no match left by the filter before.
template <class Policy>
void check_empty_filters() {
  const Policy policy{};
  for (const auto [query, neighbours, keypoints] : {std::array<int, 3>{0, 3, 50}, std::array<int, 3>{50, 0, 50},
                                                    std::array<int, 3>{50, 3, 0}, std::array<int, 3>{50, 3, 50}}) {
    scene_recipe recipe;
    recipe.query_keypoints = query, recipe.neighbours = neighbours, recipe.neighbour_keypoints = keypoints;
    const scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
    searched<Policy, orb, pinhole_camera> r(policy, s, {});
    turbomap::filter(r.ctx, r.matches);
    CHECK(r.plan().empty() == (query * neighbours * keypoints == 0));
    turbomap::filter(r.ctx, r.matches, nothing{}, ratio_test{}, mutual_best{}, rotation_histogram{}, one_to_one{});
    CHECK(r.plan().empty());
  }
}

/// Options out of range name themselves, and the matches stay.
template <class Policy>
void check_filter_options() {
  const scene<orb, pinhole_camera> s(pinhole_rig(50), {});
  searched<Policy, orb, pinhole_camera> r(Policy{}, s, {});
  const auto before = r.plan();
  const auto refused = [&r](const auto& filter, const char* name) {
    try {
      turbomap::filter(r.ctx, r.matches, filter);
    } catch (const std::invalid_argument& e) {
      return std::string(e.what()).find(name) != std::string::npos;
    }
    return false;
  };
  for (const double ratio : {0.0, -1.0, 1.01, std::nan("")}) CHECK(refused(ratio_test{ratio}, "ratio_test.ratio"));
  CHECK(refused(rotation_histogram{0, 3, 0.1}, "rotation_histogram.bins = 0"));
  CHECK(refused(rotation_histogram{30, 0, 0.1}, "rotation_histogram.kept = 0"));
  for (const double f : {-0.1, 1.1, std::nan("")})
    CHECK(refused(rotation_histogram{30, 3, f}, "rotation_histogram.min_fraction"));
  // A good filter in front of a bad one is not applied either.
  CHECK_THROWS_AS(turbomap::filter(r.ctx, r.matches, one_to_one{}, ratio_test{2}), std::invalid_argument);
  CHECK(same(r.plan(), before));
  // Without the angles of one keyframe there is no histogram; the other filters do not need them.
  for (std::size_t without = 0; without < s.frames.size(); ++without) {
    auto query = r.keyframes.query();
    std::vector<decltype(query)> neighbours(r.keyframes.neighbours().begin(), r.keyframes.neighbours().end());
    (without == 0 ? query : neighbours[without - 1]).view.angle = nullptr;
    turbomap::search_correspondences(r.ctx, query, turbomap::span<const decltype(query)>(neighbours), {}, r.matches);
    CHECK(refused(rotation_histogram{}, "angle"));
    CHECK(same(r.plan(), before));
    turbomap::filter(r.ctx, r.matches, ratio_test{}, mutual_best{}, one_to_one{});
    CHECK(r.plan().size() < before.size());
  }
  // A keyframe without keypoints has no angles to miss.
  std::vector<turbomap::posed_keyframe<orb, pinhole_camera>> neighbours(r.keyframes.neighbours().begin(),
                                                                        r.keyframes.neighbours().end());
  neighbours.push_back(neighbours[0]);
  neighbours.back().view = {};
  neighbours.back().view.cameras = neighbours[0].view.cameras, neighbours.back().view.camera_count = 1;
  neighbours.back().has_point = {};
  turbomap::search_correspondences(r.ctx, r.keyframes.query(),
                                   turbomap::span<const turbomap::posed_keyframe<orb, pinhole_camera>>(neighbours), {},
                                   r.matches);
  turbomap::filter(r.ctx, r.matches, rotation_histogram{});
  CHECK(r.plan().size() > 0);
}

/// After the first calls neither search nor filters allocate; `upstream` is the policy's memory.
template <class Policy>
void check_filter_allocations(std::pmr::memory_resource* upstream) {
  counting_resource resource(upstream);
  {
    turbomap::context<Policy> ctx(Policy{}, &resource);
    const scene<orb, pinhole_camera> s(pinhole_rig(50), {});
    const resident_scene<orb, pinhole_camera, Policy> keyframes(ctx, s);
    turbomap::correspondences<orb, pinhole_camera, Policy> result(ctx);
    const auto round = [&] {
      turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours(), {}, result);
      turbomap::filter(ctx, result, ratio_test{0.9}, mutual_best{}, rotation_histogram{}, one_to_one{});
    };
    for (int i = 0; i < 3; ++i) round();
    const auto plan = result.plan(ctx);
    CHECK_FALSE(plan.empty());
    const long before = resource.allocations;
    CHECK(before > 0);
    for (int i = 0; i < 5; ++i) round();
    CHECK(resource.allocations == before);
    CHECK(same(result.plan(ctx), plan));
  }
  CHECK(resource.bytes_out == 0);
}

}  // namespace turbomap_test

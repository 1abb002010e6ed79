// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Point creation against its oracle, its bad input, the order in which keypoints are given away.

#include <turbomap/matching/given_correspondences.hpp>

#include <thrust/execution_policy.h>

#include <limits>
#include <stdexcept>
#include <string>

#include "matching_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::creation_options;
using turbomap::creation_outcome;
using turbomap::search_options;

template <class Policy, class Camera>
std::vector<long> check_rig(const test_rig<Camera>& rig, unsigned seed, const creation_options& options, long least) {
  tally t;
  std::vector<long> outcomes(11);
  for (const motion how : {motion::sideways, motion::forward, motion::backward, motion::along_axis, motion::anything}) {
    scene_recipe recipe;
    recipe.seed = seed++, recipe.how = how, recipe.mapped = 0.1,
    recipe.query_keypoints = recipe.neighbour_keypoints = 250;
    recipe.prototypes = 40;
    scene<orb, Camera> s(rig, recipe);
    check_creation(Policy{}, s, search_options{}, options, t, outcomes);
    check_creation(Policy{}, s, wide_gates(), options, t, outcomes);
  }
  check_tally(t, least);
  return outcomes;
}

TEST_CASE_TEMPLATE("points are made as the oracle says", Policy, TURBOMAP_TEST_POLICIES) {
  const auto mono = check_rig<Policy>(pinhole_rig(), 1, {}, 100);
  CHECK(mono[static_cast<std::size_t>(creation_outcome::no_depth)] == 0);
  const auto stereo = check_rig<Policy>(pinhole_rig(50), 11, {}, 200);
  const auto fish = check_rig<Policy>(fisheye_rig(), 21, {}, 100);
  // Every reason but the two that need an exact coincidence has been seen.
  for (std::size_t o = 0; o < mono.size(); ++o) {
    const auto outcome = static_cast<creation_outcome>(o);
    if (outcome == creation_outcome::at_infinity || outcome == creation_outcome::zero_distance ||
        outcome == creation_outcome::too_far)
      continue;
    CAPTURE(o);
    CHECK(mono[o] + stereo[o] + fish[o] > 0);
  }
}

TEST_CASE_TEMPLATE("more results than a host looks at in a row", Policy, TURBOMAP_TEST_POLICIES) {
  tally t;
  std::vector<long> outcomes(11);
  scene_recipe recipe;
  recipe.seed = 61, recipe.mapped = 0, recipe.prototypes = 40;
  recipe.query_keypoints = recipe.neighbour_keypoints = 250, recipe.neighbours = 10;
  static_assert(10 * 250 > 2 * turbomap::create_point_run<orb, pinhole_camera>::length);
  scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
  check_creation(Policy{}, s, wide_gates(), {}, t, outcomes);
  check_tally(t, 200);
}

TEST_CASE("other options") {
  creation_options o;
  o.max_parallax_cosine = 0.9996, o.mono_chi2 = 2, o.stereo_chi2 = 20, o.scale_tolerance = 1, o.max_distance = 4;
  const auto stereo = check_rig<sequential>(pinhole_rig(50), 31, o, 20);
  CHECK(stereo[static_cast<std::size_t>(creation_outcome::too_far)] > 0);
  check_rig<sequential>(mixed_rig(), 41, o, 10);
}

TEST_CASE("a fisheye rig's depth is not that of a stereo pair") {
  scene_recipe recipe;
  scene<orb, fisheye_camera> s(fisheye_rig(), recipe);
  for (auto& f : s.frames) {
    for (auto& k : f.keypoints) k.u_right = k.x, k.depth = 3;
    s.repack(f);
  }
  const auto points = create_under(sequential{}, s, {}, {});
  CHECK(points.size() > 50);
  for (const auto& p : points)
    CHECK((p.method == turbomap::creation_method::triangulated || p.method == turbomap::creation_method::none));
}

TEST_CASE("a stereo keypoint whose depth is zero or unknown gives no point of its own") {
  scene_recipe recipe;
  recipe.stereo = 1, recipe.mapped = 0;
  tally t;
  std::vector<long> outcomes(11);
  for (const float depth : {0.0F, -1.0F}) {
    recipe.seed = 51;
    scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
    for (auto& k : s.frames[0].keypoints) k.depth = depth;
    s.repack(s.frames[0]);
    check_creation(sequential{}, s, {}, {}, t, outcomes);  // the neighbours' depths are known
    for (auto& f : s.frames) {
      for (auto& k : f.keypoints) k.depth = depth;
      s.repack(f);
    }
    creation_options parallel;  // most rays count as such
    parallel.max_parallax_cosine = 0.99;
    check_creation(sequential{}, s, {}, parallel, t, outcomes);
  }
  CHECK(t.differences == 0);
  CHECK(t.matches > 50);
  CHECK(outcomes[static_cast<std::size_t>(creation_outcome::no_depth)] > 50);
}

/// A keyframe at (x, 0, 0) that looks along z. Its stereo pair of 10 cm sees (0.1, 0.1, z) by its one keypoint.
/// \param depth    of the keypoint
/// \param u_right  whether it has one
scene_frame<orb, pinhole_camera> stereo_frame(double x, double z, float depth, bool u_right = true) {
  scene_frame<orb, pinhole_camera> f;
  f.cameras = {{pinhole_camera{400, 400, 320, 240}, {}, 40, {}}}, f.bounds = {0, 0, 640, 480};
  turbomap::keypoint k;
  const double u = 320 + 400 * (0.1 - x) / z;
  k.x = static_cast<float>(u), k.y = static_cast<float>(240 + 400 * 0.1 / z), k.depth = depth;
  if (u_right) k.u_right = static_cast<float>(u - 40 / z);
  f.keypoints = {k}, f.T_cw.tx = -x;
  f.descriptors.resize(static_cast<std::size_t>(orb::elements));
  turbomap::keyframe_packing_scratch scratch;
  f.pack(scratch, {1.2F, 8});
  return f;
}
/// What becomes of the match of their keypoints.
turbomap::created_point pair_of(scene_frame<orb, pinhole_camera> a, scene_frame<orb, pinhole_camera> b) {
  turbomap::context<sequential> ctx{};
  const auto neighbour = b.posed();
  const turbomap::correspondence<std::int32_t> match{0, 0, 0, 5};
  turbomap::correspondences<orb, pinhole_camera, sequential> given(ctx);
  turbomap::given_correspondences(ctx, a.posed(), turbomap::span<const decltype(a.posed())>(&neighbour, 1),
                                  turbomap::span<const turbomap::correspondence<std::int32_t>>(&match, 1), {}, given);
  turbomap::point_creation<sequential> points(ctx);
  turbomap::create_points(ctx, given, {}, points);
  return points.plan(ctx, given).at(0);
}

TEST_CASE("a stereo keypoint whose depth is unknown is triangulated where the rays suffice") {
  using turbomap::creation_method;
  for (const bool other_too : {false, true})
    for (const double baseline : {1.0, -1.0}) {
      const auto p = pair_of(stereo_frame(0, 20, -1), stereo_frame(baseline, 20, -1, other_too));
      CHECK(p.outcome == creation_outcome::accepted);
      CHECK(p.method == creation_method::triangulated);
      CHECK(p.position.z == doctest::Approx(20).epsilon(1e-3));
    }
  const auto reversed = pair_of(stereo_frame(0, 20, -1, false), stereo_frame(1, 20, -1));
  CHECK(reversed.method == creation_method::triangulated);
  // 0.2 degrees of parallax are too few, and there is nothing to fall back on. One that has a depth gives it.
  CHECK(pair_of(stereo_frame(0, 20, -1), stereo_frame(0.07, 20, -1, false)).outcome == creation_outcome::no_depth);
  CHECK(pair_of(stereo_frame(0, 20, -1), stereo_frame(0.07, 20, -1)).outcome == creation_outcome::no_depth);
  CHECK(pair_of(stereo_frame(0, 20, -1), stereo_frame(0.07, 20, 20)).method == creation_method::stereo_neighbour);
}

TEST_CASE("of two stereo keypoints that are equally deep the query's gives the point") {
  const auto p = pair_of(stereo_frame(0, 4, 4), stereo_frame(0.05, 4, 4));
  CHECK(p.outcome == creation_outcome::accepted);
  CHECK(p.method == turbomap::creation_method::stereo_query);
  CHECK(p.position.z == doctest::Approx(4));
}

TEST_CASE("a keypoint is given to one point only, the first that asks") {
  using turbomap::created_point;
  const auto point = [](int n, int q, int c, creation_outcome o = creation_outcome::accepted) {
    created_point p{};
    p.neighbour = n, p.query = q, p.candidate = c, p.outcome = o;
    return p;
  };
  const std::vector<created_point> plan{point(0, 0, 2, creation_outcome::scale),
                                        point(0, 1, 2),   // taken
                                        point(0, 3, 2),   // its candidate is gone
                                        point(1, 0, 2),   // the same index of another neighbour
                                        point(1, 1, 0),   // its query is gone
                                        point(1, 3, 0)};  // free: nothing came of it before
  const auto first = turbomap::first_claims(plan, 4, {3, 3});
  REQUIRE(first.size() == 3);
  CHECK((first[0].neighbour == 0 && first[0].query == 1 && first[0].candidate == 2));
  CHECK((first[1].neighbour == 1 && first[1].query == 0 && first[1].candidate == 2));
  CHECK((first[2].neighbour == 1 && first[2].query == 3 && first[2].candidate == 0));
  CHECK_THROWS_AS(turbomap::first_claims({point(0, 4, 0)}, 4, {3}), std::out_of_range);
  CHECK_THROWS_AS(turbomap::first_claims({point(1, 0, 0)}, 4, {3}), std::out_of_range);
  CHECK_THROWS_AS(turbomap::first_claims({point(-1, 0, 0)}, 4, {3}), std::out_of_range);
  CHECK_THROWS_AS(turbomap::first_claims({point(0, 0, 3)}, 4, {3, 3}), std::out_of_range);  // the next one has a fourth
  CHECK(turbomap::first_claims({}, 0, {}).empty());
}

TEST_CASE("memory of claims that is kept forgets them") {
  const turbomap::created_point first{0, 2, 1, creation_outcome::accepted, turbomap::creation_method::none, {}};
  const turbomap::created_point second{0, 0, 1, creation_outcome::accepted, turbomap::creation_method::none, {}};
  turbomap::claimed_keypoints claimed;
  std::vector<turbomap::created_point> result;
  for (const int query_keypoints : {3, 4, 3}) {  // keypoints of the neighbour are elsewhere each time
    claimed.clear();
    claimed.add_keyframe(query_keypoints), claimed.add_keyframe(2);
    turbomap::first_claims(std::vector{first, second}, claimed, result);
    REQUIRE(result.size() == 1);
    CHECK(result[0].query == 2);
  }
  turbomap::first_claims(std::vector{second}, claimed, result);  // not cleared: the keypoint is taken
  CHECK(result.empty());
}

TEST_CASE("nothing found, nothing created") {
  scene_recipe recipe;
  for (const bool no_query : {true, false}) {
    recipe.query_keypoints = no_query ? 0 : 20, recipe.neighbours = no_query ? 2 : 0;
    scene<orb, pinhole_camera> s(pinhole_rig(), recipe);
    CHECK(create_under(sequential{}, s, {}, {}).empty());
  }
}

TEST_CASE("points are read with the search that they were made from") {
  scene_recipe recipe;
  scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
  turbomap::context<sequential> ctx{};
  const resident_scene<orb, pinhole_camera, sequential> keyframes(ctx, s);
  const auto few = turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours().subspan(0, 1));
  turbomap::point_creation<sequential> points(ctx);
  turbomap::create_points(ctx, few, {}, points);
  CHECK(!points.plan(ctx, few).empty());
  const auto all = turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours());
  CHECK_THROWS_AS(points.plan(ctx, all), std::invalid_argument);
}

TEST_CASE("options out of range are refused by name, and the last points stay") {
  scene_recipe recipe;
  scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
  turbomap::context<sequential> ctx{};
  const resident_scene<orb, pinhole_camera, sequential> keyframes(ctx, s);
  const auto found = turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours());
  turbomap::point_creation<sequential> points(ctx);
  turbomap::create_points(ctx, found, {}, points);
  const auto before = points.plan(ctx, found);
  REQUIRE(!before.empty());
  const auto refused = [&](const char* name, auto set) {
    CAPTURE(name);
    for (const double value : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
      creation_options o;
      set(o, value);
      std::string message;
      try {
        turbomap::create_points(ctx, found, o, points);
      } catch (const std::invalid_argument& e) {
        message = e.what();
      }
      CHECK(message.find(std::string("options.") + name + " = ") != std::string::npos);
    }
    CHECK(same(points.plan(ctx, found), before));
  };
  refused("mono_chi2", [](creation_options& o, double v) { o.mono_chi2 = v; });
  refused("stereo_chi2", [](creation_options& o, double v) { o.stereo_chi2 = v; });
  refused("scale_tolerance", [](creation_options& o, double v) { o.scale_tolerance = v; });
  refused("max_distance", [](creation_options& o, double v) { o.max_distance = v; });
  refused("scales.scale_factor", [](creation_options& o, double v) { o.scales.scale_factor = static_cast<float>(v); });
  creation_options o;
  o.max_parallax_cosine = 1.1;
  CHECK_THROWS_AS(turbomap::create_points(ctx, found, o, points), std::invalid_argument);
}

TEST_CASE("a scale factor that is not that of the search is refused, both named") {
  const scene<orb, pinhole_camera> s(pinhole_rig(50), {});
  turbomap::context<sequential> ctx{};
  const resident_scene<orb, pinhole_camera, sequential> keyframes(ctx, s);
  search_options search;
  search.scales.scale_factor = 1.25F;
  const auto found = turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours(), search);
  turbomap::point_creation<sequential> points(ctx);
  std::string message;
  try {
    turbomap::create_points(ctx, found, {}, points);
  } catch (const std::invalid_argument& e) {
    message = e.what();
  }
  CHECK(message.find("options.scales.scale_factor = 1.2") != std::string::npos);
  CHECK(message.find("that of the search, 1.25") != std::string::npos);
  creation_options creation;
  creation.scales = search.scales;
  turbomap::create_points(ctx, found, creation, points);
  CHECK(!points.plan(ctx, found).empty());
}

}  // namespace

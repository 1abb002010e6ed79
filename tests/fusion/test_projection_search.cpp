// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The search by projection against its oracle, under every host policy, and what it does beyond the duplicate search.

#include <turbomap/descriptor/real.hpp>

#include <thrust/execution_policy.h>

#include <array>
#include <functional>
#include <limits>
#include <string>

#include "projection_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::projection_gate;

TEST_CASE_TEMPLATE("pinhole frames, as the oracle says", Policy, TURBOMAP_TEST_POLICIES) {
  const auto t = check_projection_scenes(Policy{}, std::vector{pinhole_rig(50)}, crowded(10), wide());
  check_duplicate_tally(t, 10, 0.01);
  CHECK(t.outcomes[static_cast<std::size_t>(projection_outcome::lost)] > 20);
  const auto published = check_projection_scenes(Policy{}, std::vector{pinhole_rig()}, crowded(20), {});
  check_duplicate_tally(published, 5, 0.01);
}
TEST_CASE_TEMPLATE("fisheye rigs of one to three cameras, as the oracle says", Policy, TURBOMAP_TEST_POLICIES) {
  const auto t = check_projection_scenes(Policy{}, fisheye_rigs(), crowded(30), wide());
  check_duplicate_tally(t, 10, 0.01);
  CHECK(t.outcomes[static_cast<std::size_t>(projection_outcome::lost)] > 10);
}
TEST_CASE("other cameras and descriptors") {
  projection_options options = wide();
  check_duplicate_tally(check_projection_scenes(sequential{}, std::vector{mixed_rig()}, crowded(40), options), 5, 0.01);
  options.max_distance = 2;
  for (const double ratio : {1.0, 0.8}) {
    options.max_ratio = ratio;
    const auto t = check_projection_scenes<turbomap::real_descriptor<float, 64>>(
        sequential{}, std::vector{pinhole_rig(50)}, crowded(50), options);
    CHECK(t.differences == 0);
    CHECK(t.outcomes[static_cast<std::size_t>(projection_outcome::lost)] > 0);
    CHECK((t.outcomes[static_cast<std::size_t>(projection_outcome::ambiguous)] > 5) == (ratio < 1));
  }
}

TEST_CASE_TEMPLATE("gate, ratio, octaves, without ranges", Policy, TURBOMAP_TEST_TWO_POLICIES) {
  projection_options options = wide();
  options.gate = projection_gate::all, options.max_ratio = 0.8;
  const auto t = check_projection_scenes(Policy{}, std::vector{pinhole_rig(50)}, crowded(60), options);
  CHECK(t.differences == 0);
  CHECK(t.outcomes[static_cast<std::size_t>(projection_outcome::ambiguous)] > 20);
  CHECK(t.outcomes[static_cast<std::size_t>(projection_outcome::matched)] > 20);
  options = wide(), options.finer_octaves = 0, options.coarser_octaves = 3, options.oblique_factor = 0.5;
  CHECK(check_projection_scenes(Policy{}, fisheye_rigs(), crowded(70), options).differences == 0);
  options = wide(), options.range_gate = false, options.min_view_cosine = -1, options.window_octave = 2;
  const auto any = check_projection_scenes(Policy{}, std::vector{pinhole_rig(50)}, crowded(80), options);
  CHECK(any.differences == 0);
  CHECK(any.outcomes[static_cast<std::size_t>(projection_outcome::lost)] > 20);
}

TEST_CASE_TEMPLATE("points that are not exact", Policy, TURBOMAP_TEST_TWO_POLICIES) {
  duplicate_recipe recipe = crowded(200);
  recipe.points = 600, recipe.uncertain = 0.7;
  projection_options options;
  check_duplicate_tally(check_projection_scenes(Policy{}, std::vector{pinhole_rig(50)}, recipe, options), 5, 0.01);
  options.stereo_correlation = 0.9, options.max_radius = 12, options.gate = projection_gate::all;
  check_duplicate_tally(check_projection_scenes(Policy{}, std::vector{pinhole_rig(50)}, recipe, options), 5, 0.01);
  options.gate = projection_gate::none, options.window_sigmas = 1.5;
  check_duplicate_tally(check_projection_scenes(Policy{}, fisheye_rigs(), recipe, options), 5, 0.01);
  recipe.not_finite = 0.5, options = {};
  check_duplicate_tally(check_projection_scenes(Policy{}, std::vector{mixed_rig()}, recipe, options), 5, 0.01);
}

TEST_CASE("points on the threshold, numbers that are not finite, any grid") {
  duplicate_recipe recipe = crowded(90);
  recipe.on_edge = 0.5, recipe.not_finite = 0.2, recipe.off_unit = 5e-4;
  for (const auto& [columns, rows] : {std::array{64, 48}, std::array{0, 0}, std::array{3, 200}}) {
    recipe.columns = columns, recipe.rows = rows;
    const auto t = check_projection_scenes(sequential{}, std::vector{pinhole_rig(50)}, recipe, wide());
    CHECK(t.differences == 0);
    CHECK(t.outcomes[0] > 20);
  }
}

TEST_CASE_TEMPLATE("nothing to do, and very little", Policy, TURBOMAP_TEST_POLICIES) {
  for (const auto& [targets, points, clutter] :
       {std::array{0, 0, 0}, std::array{3, 0, 50}, std::array{1, 1, 0}, std::array{1, 65, 0}, std::array{2, 192, 3}}) {
    duplicate_recipe recipe = crowded(100);
    recipe.targets = targets, recipe.points = points, recipe.clutter = clutter;
    CHECK(check_projection_scenes(Policy{}, std::vector{pinhole_rig(50)}, recipe, wide()).differences == 0);
  }
  duplicate_scene<orb, pinhole_camera> s({pinhole_rig(50)}, seeded(180));
  for (auto& f : s.frames) f.keypoints.clear(), s.repack(f);
  CHECK(find_under(Policy{}, s, s.points(), projection_options{}).plan.empty());
  s.frames.clear();
  CHECK(find_under(Policy{}, s, s.points(), projection_options{}).trials.empty());
}

/// One camera at the origin, whose numbers are powers of two, and points on its axis, predicted at octave 1: windows of
/// 2 x radius. Nothing is rounded.
struct by_hand {
  duplicate_scene<orb, pinhole_camera> s{{rig()}, nothing()};
  projection_options options;

  static test_rig<pinhole_camera> rig() { return {{{pinhole_camera{128, 128, 64, 64}, {}, 16, {}}}, {0, 0, 128, 128}}; }
  static duplicate_recipe nothing() {
    duplicate_recipe recipe;
    recipe.points = recipe.clutter = 0, recipe.targets = 1, recipe.skip = -1, recipe.scale_factor = 2;
    return recipe;
  }
  by_hand() {
    s.frames[0].T_cw = {};
    options.radius = 3, options.oblique_factor = 1;
    options.min_range_factor = options.max_range_factor = 1;
  }
  static void set_bits(std::vector<std::uint8_t>& descriptors, int bits) {
    descriptors.resize(descriptors.size() + 32);
    for (int b = 0; b < bits; ++b)
      descriptors[descriptors.size() - 32 + static_cast<std::size_t>(b) / 8] |= static_cast<std::uint8_t>(1 << b % 8);
  }
  void add_point(int bits = 0) {
    s.position.push_back({0, 0, 4}), s.normal.push_back({0, 0, 1});
    s.min_distance.push_back(1), s.max_distance.push_back(7);
    set_bits(s.descriptors, bits);
  }
  void add(float x, int bits, int octave = 1) {
    turbomap::keypoint k;
    k.x = x, k.y = 64, k.octave = static_cast<std::uint8_t>(octave);
    s.frames[0].keypoints.push_back(k);
    set_bits(s.frames[0].descriptors, bits);
  }
  auto find() {
    s.repack(s.frames[0]);
    options.scales = s.scales();
    return find_under(sequential{}, s, s.points(), options);
  }
  projection_outcome outcome(std::size_t point = 0) { return find().trials.at(point).outcome; }
};

TEST_CASE("a keypoint goes to the most similar point, of equal ones to the first; the others go without") {
  by_hand h;
  h.add_point(10), h.add_point(6), h.add_point(6), h.add_point(200);
  h.add(64, 0), h.add(65, 20);
  auto found = h.find();  // point 0 is 10 from either keypoint and takes the first in order
  REQUIRE(found.plan.size() == 1);
  CHECK(found.plan[0].point == 1);
  CHECK(found.plan[0].keypoint == 0);
  CHECK(found.trials[0].outcome == projection_outcome::lost);
  CHECK(found.trials[0].keypoint == 0);
  CHECK(found.trials[0].distance == 10);
  CHECK(found.trials[1].outcome == projection_outcome::matched);
  CHECK(found.trials[2].outcome == projection_outcome::lost);
  CHECK(found.trials[3].outcome == projection_outcome::too_different);
  h.options.one_to_one = false;
  CHECK(h.find().plan.size() == 3);
}

TEST_CASE("keypoints that are taken are no candidates") {
  by_hand h;
  h.add_point();
  h.add(64, 3), h.add(65, 9);
  CHECK(h.find().trials.at(0).keypoint == 0);
  h.s.taken[0] = {1, 0};
  CHECK(h.find().trials.at(0).keypoint == 1);
  h.s.taken[0] = {1, 255};
  CHECK(h.outcome() == projection_outcome::no_consistent_keypoint);
}

TEST_CASE("the ratio of the two best") {
  by_hand h;
  h.add_point();
  h.add(64, 16), h.add(65, 20);
  CHECK(h.outcome() == projection_outcome::matched);
  h.options.max_ratio = 0.8;
  CHECK(h.outcome() == projection_outcome::matched);
  h.options.max_ratio = 0.79;
  CHECK(h.outcome() == projection_outcome::ambiguous);
  CHECK(h.find().plan.empty());
  h.s.taken[0] = {0, 1};  // what is no candidate is no second best
  CHECK(h.outcome() == projection_outcome::matched);
  by_hand reversed;  // whatever the order
  reversed.add_point();
  reversed.add(64, 20), reversed.add(65, 16);
  reversed.options.max_ratio = 0.79;
  CHECK(reversed.outcome() == projection_outcome::ambiguous);
}

TEST_CASE("the window of a point that is seen obliquely is larger") {
  by_hand h;
  h.add_point();
  h.add(71, 0);  // 7 px beside; the window has 6
  CHECK(h.outcome() == projection_outcome::no_keypoint);
  h.options.oblique_factor = 1.5;
  CHECK(h.outcome() == projection_outcome::no_keypoint);
  h.s.normal[0].z = 0.998F;  // in float a little more
  CHECK(h.outcome() == projection_outcome::no_keypoint);
  h.s.normal[0].z = 0.9979F;
  CHECK(h.outcome() == projection_outcome::matched);
  h.options.oblique_cosine = 0.99;
  CHECK(h.outcome() == projection_outcome::no_keypoint);
}

TEST_CASE("candidate octaves, and the gate") {
  for (const int octave : {0, 1, 2, 3}) {
    by_hand h;
    h.add_point();
    h.add(64, 0, octave);
    CHECK((h.outcome() == projection_outcome::matched) == (octave <= 1));
    h.options.coarser_octaves = 1;
    CHECK((h.outcome() == projection_outcome::matched) == (octave <= 2));
    h.options.finer_octaves = 0;
    CHECK((h.outcome() == projection_outcome::matched) == (octave == 1 || octave == 2));
  }
  by_hand h;
  h.add_point();
  h.add(69.5F, 0);  // 5.5 px, sigma2 is 4
  CHECK(h.outcome() == projection_outcome::matched);
  h.options.gate = projection_gate::all;
  CHECK(h.outcome() == projection_outcome::no_consistent_keypoint);
  h.options.mono_chi2 = 5.5 * 5.5 / 4;
  CHECK(h.outcome() == projection_outcome::matched);
}

TEST_CASE("a point with a covariance: the window holds the ellipse, the gate allows it, zero is exact") {
  by_hand h;  // 128 px at 4 m: 32 px per m
  h.add_point();
  h.add(64 + 20, 0);
  h.s.covariance.resize(1);
  CHECK(h.outcome() == projection_outcome::no_keypoint);
  h.s.covariance[0].zz = 9;  // along the ray: nothing changes
  CHECK(h.outcome() == projection_outcome::no_keypoint);
  h.s.covariance[0].xx = 0.0625;  // 8 px, and the keypoint's own 2: 8.2; the gate allows 20.2 and the window 24.7
  CHECK(h.outcome() == projection_outcome::matched);
  h.options.mono_chi2 = 5.8;  // 19.9
  CHECK(h.outcome() == projection_outcome::no_consistent_keypoint);
  h.options.gate = projection_gate::none;
  CHECK(h.outcome() == projection_outcome::matched);
  h.options.max_radius = 20;
  CHECK(h.outcome() == projection_outcome::no_keypoint);
  h.options.max_radius = 40, h.options.window_sigmas = 2;  // 16.5
  CHECK(h.outcome() == projection_outcome::no_keypoint);
  h.options.window_sigmas = 2.5;
  CHECK(h.outcome() == projection_outcome::matched);
  h.s.covariance[0] = {}, h.s.covariance[0].yy = 0.0625;  // the other axis
  CHECK(h.outcome() == projection_outcome::no_keypoint);
  h.s.covariance[0].yx = std::numeric_limits<float>::quiet_NaN();
  CHECK(h.outcome() == projection_outcome::behind);
}

TEST_CASE("bad options and flags are refused by name, and the last result stays") {
  duplicate_scene<orb, pinhole_camera> s({pinhole_rig(50)}, crowded(7));
  auto targets = s.targets();
  turbomap::context<sequential> ctx;
  turbomap::projections<orb, pinhole_camera, sequential> result(ctx);
  const auto find = [&](const projection_options& options) {
    turbomap::search_by_projection(ctx, s.points(),
                                   turbomap::span<const turbomap::projection_target<orb, pinhole_camera>>(targets),
                                   options, result);
  };
  find({});
  const auto before = result.plan(ctx);
  REQUIRE(!before.empty());
  const auto refused = [&](const char* text, const std::function<void(projection_options&)>& spoil) {
    projection_options options;
    spoil(options);
    std::string message;
    try {
      find(options);
    } catch (const std::invalid_argument& e) {
      message = e.what();
    }
    CAPTURE(message);
    CHECK(message.find(text) != std::string::npos);
    CHECK(same(result.plan(ctx), before));
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double v : {-1.01, 1.01, nan})
    refused("options.oblique_cosine = ", [&](auto& o) { o.oblique_cosine = v; });
  for (const double v : {-1.0, 0.0, nan}) refused("options.oblique_factor = ", [&](auto& o) { o.oblique_factor = v; });
  for (const double v : {0.0, 1.01, nan}) refused("options.max_ratio = ", [&](auto& o) { o.max_ratio = v; });
  for (const double v : {-0.1, 1.0, nan})
    refused("options.stereo_correlation = ", [&](auto& o) { o.stereo_correlation = v; });
  for (const double v : {-1.0, nan}) refused("options.window_sigmas = ", [&](auto& o) { o.window_sigmas = v; });
  for (const double v : {-1.0, 0.0, nan}) refused("options.max_radius = ", [&](auto& o) { o.max_radius = v; });
  refused("options.finer_octaves = -1", [](auto& o) { o.finer_octaves = -1; });
  refused("options.coarser_octaves = -1", [](auto& o) { o.coarser_octaves = -1; });
  turbomap::projection_options any;
  any.finer_octaves = any.coarser_octaves = std::numeric_limits<int>::max();
  CHECK((any.is_candidate(0, 7) && any.is_candidate(7, 0) && any.is_candidate(255, 3)));
  targets[1].taken = targets[1].taken.subspan(0, 3);
  refused("targets[1].taken.size() = 3", [](auto&) {});
}

}  // namespace

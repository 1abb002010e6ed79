// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The duplicate search against its oracle, under every host policy, and its rules one by one.

#include <turbomap/descriptor/real.hpp>

#include <thrust/execution_policy.h>

#include <array>

#include "duplicate_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::duplicate_options;
using turbomap::duplicate_outcome;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

TEST_CASE_TEMPLATE("pinhole keyframes, as the oracle says", Policy, TURBOMAP_TEST_POLICIES) {
  check_duplicate_tally(check_scenes(Policy{}, pinhole_rig(), seeded(10)), 10);
  check_duplicate_tally(check_scenes(Policy{}, pinhole_rig(50), seeded(20)), 10);
}
TEST_CASE_TEMPLATE("fisheye rigs of one to three cameras, as the oracle says", Policy, TURBOMAP_TEST_POLICIES) {
  check_duplicate_tally(check_scenes(Policy{}, fisheye_rigs(), seeded(30)), 10);
}
TEST_CASE("every camera model, and rigs of mixed ones") {
  check_duplicate_tally(check_scenes(sequential{}, mixed_rig(), seeded(40)), 5);
  check_duplicate_tally(check_scenes(sequential{}, double_sphere_rig(), seeded(50)), 5);
  check_duplicate_tally(check_scenes(sequential{}, brown_conrady_rig(), seeded(60)), 5);
  check_duplicate_tally(check_scenes(sequential{}, equisolid_rig(), seeded(70)), 5);
}
TEST_CASE("u_right does not count where the image is not rectilinear, nor without bf") {
  auto rig = fisheye_rig(2);
  rig.cameras[0].bf = 50;
  check_duplicate_tally(check_scenes(sequential{}, rig, seeded(75)), 5);
}
TEST_CASE("other descriptors") {
  duplicate_options options;
  options.max_distance = 30;
  check_duplicate_tally(
      check_scenes<turbomap::binary_descriptor<384>>(sequential{}, pinhole_rig(50), seeded(80), options), 5);
  options.max_distance = 1.5;
  check_duplicate_tally(
      check_scenes<turbomap::real_descriptor<float, 64>>(sequential{}, pinhole_rig(50), seeded(90), options), 5);
}

TEST_CASE("other thresholds") {
  duplicate_options options;
  options.radius = 11, options.min_view_cosine = 0.8, options.min_range_factor = 1, options.max_range_factor = 2;
  options.mono_chi2 = 20, options.stereo_chi2 = 3, options.max_distance = 20;
  options.finer_octaves = 2, options.coarser_octaves = 1;
  duplicate_recipe recipe = seeded(100);
  recipe.scale_factor = 1.5F, recipe.levels = 4;
  check_duplicate_tally(check_scenes(sequential{}, pinhole_rig(50), recipe, options), 5);
  recipe.levels = 1, recipe.scale_factor = 1, options.min_view_cosine = -0.5;
  const auto t = check_scenes(sequential{}, pinhole_rig(50), recipe, options);
  CHECK(t.differences == 0);
  CHECK(t.outcomes[0] > 10);
}

TEST_CASE_TEMPLATE("without ranges and normals, which may then be missing", Policy, TURBOMAP_TEST_TWO_POLICIES) {
  duplicate_options options;
  options.range_gate = false, options.min_view_cosine = -1;
  for (const int octave : {0, 3}) {
    options.window_octave = octave;
    duplicate_scene<orb, pinhole_camera> s({pinhole_rig(50)}, seeded(110));
    duplicate_tally with, without;
    check_duplicates(Policy{}, s, options, with);
    auto points = s.points();
    points.normal = nullptr, points.min_distance = points.max_distance = nullptr;
    check_duplicates(Policy{}, s, points, options, without);
    CHECK(with.differences + without.differences == 0);
    CHECK(with.outcomes == without.outcomes);
    CHECK(with.outcomes[0] > 20);
    CHECK(with.outcomes[6] + with.outcomes[7] == 0);
  }
}

TEST_CASE("any grid, and none") {
  for (const auto& [columns, rows] : {std::array{0, 0}, std::array{1, 1}, std::array{2, 300}, std::array{700, 7}}) {
    duplicate_recipe recipe = seeded(120);
    recipe.columns = columns, recipe.rows = rows;
    check_duplicate_tally(check_scenes(sequential{}, pinhole_rig(50), recipe), 5);
    check_duplicate_tally(check_scenes(turbomap_test::parallel{}, fisheye_rigs(), recipe), 5);
  }
}

TEST_CASE("quaternions that are not quite of unit length are scaled to it") {
  duplicate_recipe recipe = seeded(130);
  recipe.off_unit = 9e-4, recipe.origin = 20;
  check_duplicate_tally(check_scenes(sequential{}, pinhole_rig(50), recipe), 5);
  check_duplicate_tally(check_scenes(sequential{}, fisheye_rigs(), recipe), 5);
}

TEST_CASE("far from the origin of the world") {
  for (const double origin : {1e3, 1e6, 1e9}) {
    duplicate_recipe recipe = seeded(140);
    recipe.origin = origin, recipe.on_edge = 0.3;
    // Rounding is visible out there: the oracle is left to doubt, the plan is not.
    const auto t = check_scenes(sequential{}, pinhole_rig(50), recipe);
    CHECK(t.differences == 0);
    CHECK(t.outcomes[0] > 5);
    CHECK(check_scenes(sequential{}, fisheye_rigs(), recipe).differences == 0);
  }
}

TEST_CASE("points on the threshold: what is rejected early would not have matched") {
  duplicate_recipe recipe = seeded(150);
  recipe.on_edge = 0.7, recipe.points = 400;
  for (const double off_unit : {0.0, 5e-4}) {
    recipe.off_unit = off_unit;
    check_duplicate_tally(check_scenes(sequential{}, pinhole_rig(50), recipe, {}, 8), 5, 0.2);
    check_duplicate_tally(check_scenes(sequential{}, fisheye_rigs(), recipe, {}, 8), 5, 0.2);
  }
}

TEST_CASE_TEMPLATE("numbers that are not finite match nothing", Policy, TURBOMAP_TEST_TWO_POLICIES) {
  duplicate_recipe recipe = seeded(160);
  recipe.not_finite = 0.5;
  check_duplicate_tally(check_scenes(Policy{}, pinhole_rig(50), recipe), 5);
  check_duplicate_tally(check_scenes(Policy{}, fisheye_rigs(), recipe), 5);
}

TEST_CASE_TEMPLATE("nothing to do, and very little", Policy, TURBOMAP_TEST_POLICIES) {
  for (const auto& [targets, points, clutter] :
       {std::array{0, 0, 0}, std::array{3, 0, 50}, std::array{1, 1, 0}, std::array{1, 1, 1}, std::array{5, 64, 0},
        std::array{1, 65, 0}, std::array{2, 192, 3}}) {
    duplicate_recipe recipe = seeded(170);
    recipe.targets = targets, recipe.points = points, recipe.clutter = clutter;
    CHECK(check_scenes(Policy{}, pinhole_rig(50), recipe).differences == 0);
  }
  // Keyframes without a keypoint, and no keyframe for the points.
  duplicate_scene<orb, pinhole_camera> s({pinhole_rig(50)}, seeded(180));
  for (auto& f : s.frames) f.keypoints.clear(), s.repack(f);
  CHECK(find_under(Policy{}, s, s.points(), {}).plan.empty());
  s.frames.clear();
  CHECK(find_under(Policy{}, s, s.points(), {}).trials.empty());
}

TEST_CASE("a bare policy and a fresh result give the same plan") {
  duplicate_scene<orb, pinhole_camera> s({pinhole_rig(50)}, seeded(190));
  const auto targets = s.targets();
  const turbomap::span<const turbomap::duplicate_target<orb, pinhole_camera>> all(targets);
  const auto expected = find_under(sequential{}, s, s.points(), {}).plan;
  CHECK(!expected.empty());
  CHECK(same(turbomap::find_duplicates(thrust::seq, s.points(), all), expected));
  turbomap::context<sequential> ctx;
  CHECK(same(turbomap::find_duplicates(ctx, s.points(), all).plan(ctx), expected));
}

/// One camera at the origin, whose numbers are powers of two, and one point on its axis: nothing is rounded.
struct by_hand {
  duplicate_scene<orb, pinhole_camera> s{{rig()}, nothing()};
  duplicate_options options;

  static test_rig<pinhole_camera> rig() { return {{{pinhole_camera{128, 128, 64, 64}, {}, 16, {}}}, {0, 0, 128, 128}}; }
  static duplicate_recipe nothing() {
    duplicate_recipe recipe;
    recipe.points = recipe.clutter = 0, recipe.targets = 1, recipe.skip = -1, recipe.scale_factor = 2;
    recipe.columns = recipe.rows = 16;  // cells of 8 px
    return recipe;
  }
  by_hand() {
    s.frames[0].T_cw = {};
    s.position = {{0, 0, 4}};
    s.normal = {{0, 0, 1}};
    s.min_distance = {1}, s.max_distance = {7};  // octave 1, a window of 6 px
    s.descriptors.assign(32, 0);
    options.min_range_factor = options.max_range_factor = 1;
  }
  /// A keypoint whose descriptor has `bits` bits set.
  void add(float x, float y, int octave, int bits, float u_right = -1) {
    auto& f = s.frames[0];
    turbomap::keypoint k;
    k.x = x, k.y = y, k.octave = static_cast<std::uint8_t>(octave), k.u_right = u_right;
    f.keypoints.push_back(k);
    f.descriptors.resize(f.descriptors.size() + 32);
    for (int b = 0; b < bits; ++b)
      f.descriptors[f.descriptors.size() - 32 + static_cast<std::size_t>(b) / 8] |=
          static_cast<std::uint8_t>(1 << b % 8);
  }
  turbomap::duplicate_trial<std::int32_t> find() {
    s.repack(s.frames[0]);
    options.scales = s.scales();
    const auto found = find_under(sequential{}, s, s.points(), options);
    CHECK(same(found.plan, plan_of_trials(s, found)));
    return found.trials.at(0);
  }
  duplicate_outcome outcome() { return find().outcome; }
};

TEST_CASE("depth must be positive, numbers finite") {
  by_hand h;
  h.add(64, 64, 1, 0);
  CHECK(h.outcome() == duplicate_outcome::matched);
  for (const double z : {0.0, -4.0, nan, infinity, -infinity}) {
    h.s.position[0].z = z;
    CHECK(h.outcome() == duplicate_outcome::behind);
  }
  h.s.position[0] = {nan, 0, 4};
  CHECK(h.outcome() == duplicate_outcome::behind);
  h.s.position[0] = {0, 0, 1e-9};
  h.s.min_distance[0] = 0, h.s.max_distance[0] = 2e-9F;
  CHECK(h.outcome() == duplicate_outcome::matched);
}

TEST_CASE("the image is half open") {
  by_hand h;
  h.add(40, 40, 1, 0);
  h.options.min_view_cosine = 0;
  for (const auto& [x, y, inside] : {std::tuple{-2.0, 0.0, true},
                                     {-2.001, 0.0, false},
                                     {1.999, 0.0, true},
                                     {2.0, 0.0, false},
                                     {0.0, -2.0, true},
                                     {0.0, -2.001, false},
                                     {0.0, 2.0, false}}) {
    h.s.position[0] = {x, y, 4};
    CHECK(h.outcome() == (inside ? duplicate_outcome::no_keypoint : duplicate_outcome::outside));
  }
}

TEST_CASE("the ends of the range belong to it; its ends are rounded to float") {
  by_hand h;
  h.add(64, 64, 1, 0);
  h.options.min_range_factor = 0.5, h.options.max_range_factor = 2;
  h.s.min_distance[0] = 8;
  CHECK(h.outcome() == duplicate_outcome::matched);
  h.s.min_distance[0] = std::nextafter(8.0F, 9.0F);
  CHECK(h.outcome() == duplicate_outcome::out_of_range);
  h.s.min_distance[0] = 1, h.s.max_distance[0] = 2;
  CHECK(h.find().level == 0);
  h.s.max_distance[0] = std::nextafter(2.0F, 1.0F);
  CHECK(h.outcome() == duplicate_outcome::out_of_range);
  for (const float bad : {static_cast<float>(nan), static_cast<float>(infinity), -1.0F}) {
    h.s.max_distance[0] = bad;
    CHECK(h.outcome() == duplicate_outcome::out_of_range);
  }
  h.s.max_distance[0] = 8, h.s.min_distance[0] = static_cast<float>(nan);
  CHECK(h.outcome() == duplicate_outcome::out_of_range);
  // 0.8F * 5 is 4 in float, above 4 in double.
  h.s.min_distance[0] = 5, h.options.min_range_factor = 0.8;
  CHECK(h.outcome() == duplicate_outcome::matched);
}

TEST_CASE("the viewing angle is measured with the normal as it is") {
  by_hand h;
  h.add(64, 64, 1, 0);
  for (const auto& [z, seen] : {std::pair{0.5F, true}, {0.49999F, false}, {-1.0F, false}, {2.0F, true}}) {
    h.s.normal[0].z = z;
    CHECK(h.outcome() == (seen ? duplicate_outcome::matched : duplicate_outcome::oblique));
  }
  h.s.normal[0].x = static_cast<float>(nan);
  CHECK(h.outcome() == duplicate_outcome::oblique);
  h.options.min_view_cosine = -1;
  CHECK(h.outcome() == duplicate_outcome::matched);
}

TEST_CASE("the octave is the least that reaches the distance, within the pyramid") {
  for (const auto& [largest, level] :
       {std::pair{4.0F, 0}, {4.001F, 1}, {8.0F, 1}, {8.001F, 2}, {512.0F, 7}, {513.0F, 7}, {1e30F, 7}}) {
    by_hand h;
    h.s.max_distance[0] = largest;
    h.add(64, 64, level, 3);
    CHECK(h.find().level == level);
    CHECK(h.outcome() == duplicate_outcome::matched);
  }
  by_hand above;  // by one rounding
  above.s.position[0].z = std::nextafter(4.0, 0.0), above.s.max_distance[0] = 8;
  above.add(64, 64, 2, 3);
  CHECK(above.find().level == 2);
  CHECK(above.outcome() == duplicate_outcome::matched);
  for (const auto& [octave, consistent] : {std::pair{0, true}, {1, true}, {2, false}, {7, false}}) {
    by_hand h;
    h.add(64, 64, octave, 3);
    CHECK(h.outcome() == (consistent ? duplicate_outcome::matched : duplicate_outcome::no_consistent_keypoint));
    h.options.range_gate = false;
    CHECK(h.outcome() == duplicate_outcome::matched);
    CHECK(h.find().level == -1);
  }
}

TEST_CASE("octaves around the predicted one are asked for") {
  for (const auto& [octave, consistent] : {std::pair{0, true}, {1, true}, {2, true}, {3, true}, {4, false}}) {
    by_hand h;
    h.s.max_distance[0] = 16;  // octave 2
    h.options.finer_octaves = 2, h.options.coarser_octaves = 1;
    h.add(64, 64, octave, 3);
    CHECK(h.find().level == 2);
    CHECK(h.outcome() == (consistent ? duplicate_outcome::matched : duplicate_outcome::no_consistent_keypoint));
    h.options.finer_octaves = h.options.coarser_octaves = 0;
    CHECK((h.outcome() == duplicate_outcome::matched) == (octave == 2));
  }
}

TEST_CASE("the window is an open square") {
  for (const auto& [x, y, inside] : {std::tuple{70.0F, 64.0F, false},
                                     {69.9999F, 69.9999F, true},
                                     {58.0F, 64.0F, false},
                                     {58.0001F, 58.0001F, true},
                                     {64.0F, 70.0F, false},
                                     {64.0F, 58.0F, false},
                                     {64.0F, 69.9999F, true}}) {
    by_hand h;
    h.options.mono_chi2 = 1000;
    h.add(x, y, 1, 3);
    CHECK(h.outcome() == (inside ? duplicate_outcome::matched : duplicate_outcome::no_keypoint));
  }
  by_hand h;  // without a range the window is that of an octave of choice
  h.options.mono_chi2 = 1000, h.options.range_gate = false;
  h.add(64, 69, 1, 3);
  CHECK(h.outcome() == duplicate_outcome::no_keypoint);
  h.options.window_octave = 1;
  CHECK(h.outcome() == duplicate_outcome::matched);
}

TEST_CASE("the reprojection error has two residuals, or three with u_right") {
  // At octave 1 sigma2 is 4; the point's own u_right is 60.
  for (const auto& [dx, u_right, matched] : {std::tuple{4.0F, -1.0F, true},
                                             {4.5F, -1.0F, false},
                                             {4.0F, 60.0F, true},
                                             {4.5F, 60.0F, true},
                                             {4.0F, 64.0F, true},
                                             {4.0F, 64.5F, false},
                                             {0.0F, 70.0F, false},
                                             {0.0F, 0.0F, false}}) {
    by_hand h;
    h.options.mono_chi2 = 4, h.options.stereo_chi2 = 8;
    h.add(64 + dx, 64, 1, 3, u_right);
    CHECK(h.outcome() == (matched ? duplicate_outcome::matched : duplicate_outcome::no_consistent_keypoint));
  }
  by_hand h;  // a single camera does not look at it
  h.s.frames[0].cameras[0].bf = 0;
  h.add(64, 64, 1, 3, 5);
  CHECK(h.outcome() == duplicate_outcome::matched);
}

TEST_CASE("the least distance wins, up to the largest") {
  by_hand h;
  h.add(62, 64, 1, 9), h.add(65, 64, 1, 7), h.add(66, 64, 1, 8);
  auto best = h.find();
  CHECK(best.keypoint == 1);
  CHECK(best.distance == 7);
  h.options.max_distance = 7;
  CHECK(h.outcome() == duplicate_outcome::matched);
  h.options.max_distance = 6;
  best = h.find();
  CHECK(best.outcome == duplicate_outcome::too_different);
  CHECK(best.keypoint == 1);
  CHECK(best.distance == 7);
}

TEST_CASE("of equal distances the first counts: by cell column, cell row, index") {
  by_hand h;
  h.options.mono_chi2 = 1000;
  h.add(66, 61, 1, 7), h.add(64, 66, 1, 7), h.add(65, 64, 1, 7);  // columns are those of 60 .. 68
  CHECK(h.find().keypoint == 0);
  h.add(64, 59, 1, 7);  // the row above
  CHECK(h.find().keypoint == 3);
  h.add(59, 65, 1, 7);  // the column before
  CHECK(h.find().keypoint == 4);
  h.s.frames[0].keypoints.erase(h.s.frames[0].keypoints.begin());
  CHECK(h.find().keypoint == 3);
  auto target = h.s.targets();
  target[0].view.cells.columns = 0;  // no grid: by index
  const auto plan = turbomap::find_duplicates(
      thrust::seq, h.s.points(), turbomap::span<const turbomap::duplicate_target<orb, pinhole_camera>>(target),
      h.options);
  REQUIRE(plan.size() == 1);
  CHECK(plan[0].keypoint == 0);
}

TEST_CASE("trials without a keypoint look like those of the recordings") {
  by_hand h;
  h.add(40, 40, 1, 0);
  auto trial = h.find();
  CHECK(trial.outcome == duplicate_outcome::no_keypoint);
  CHECK(trial.level == 1);
  CHECK(trial.keypoint == -1);
  CHECK(trial.distance == 256);
  h.s.skip[0] = {1};
  trial = h.find();
  CHECK(trial.outcome == duplicate_outcome::skipped);
  CHECK(trial.level == -1);
  CHECK(trial.distance == 256);
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Matches joined into tracks, against the oracle and by hand.

#include <thrust/execution_policy.h>

#include <random>
#include <stdexcept>

#include "support/policies.hpp"
#include "tracks_cases.hpp"

namespace {

using namespace turbomap_test;
using turbomap::match_outcome;
using match = turbomap::correspondence<int>;

turbomap::track_list join(const std::vector<match>& matches, const std::vector<turbomap::match_cameras>& cameras = {},
                          int own = -1) {
  turbomap::track_joiner join;
  turbomap::track_list result;
  join(matches, cameras, own, result);
  return result;
}

TEST_CASE_TEMPLATE("tracks of searches are those of the oracle", Policy, TURBOMAP_TEST_POLICIES) {
  track_tally t;
  for (const motion how : every_motion) {
    scene_recipe recipe;
    recipe.seed = 300 + static_cast<unsigned>(how), recipe.how = how, recipe.neighbours = 5, recipe.mapped = 0.1;
    recipe.prototypes = 40;
    scene<orb, pinhole_camera> mono(pinhole_rig(), recipe);
    check_tracks(Policy{}, mono, {}, t);
    scene<orb, fisheye_camera> two(fisheye_rig(), recipe);
    check_tracks(Policy{}, two, {}, t);
    scene<orb, fisheye_camera> three(fisheye_rig(3), recipe);
    check_tracks(Policy{}, three, {}, t);
  }
  CHECK(t.tracks > 1000);
  CHECK(t.longest > 5);
  CHECK(t.contradictions > 50);
  CHECK(t.own > 20);
}

TEST_CASE("random matches, up to more keyframes and cameras than a word has bits") {
  std::mt19937 random(7);
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  for (int round = 0; round < 60; ++round) {
    CAPTURE(round);
    const int rig = 1 + round % 3, neighbours = round % 5 == 0 ? 40 : 1 + below(6), keypoints = 1 + below(40);
    const int own = rig > 1 && round % 2 == 0 ? neighbours - 1 : -1;
    const auto camera_of = [&](int keyframe, int keypoint) { return (keypoint * 7 + keyframe) % rig; };
    std::vector<match> matches;
    std::vector<turbomap::match_cameras> cameras;
    for (int n = 0; n < neighbours; ++n)
      for (int q = 0; q < keypoints; ++q) {
        const int c = below(keypoints), keyframe = n == own ? 0 : 1 + n;
        if (below(3) == 0) continue;
        matches.push_back({n, q, c, below(round % 4 == 0 ? 3 : 70000)});
        cameras.push_back(
            {static_cast<std::uint8_t>(camera_of(0, q)), static_cast<std::uint8_t>(camera_of(keyframe, c))});
      }
    if (rig == 1) cameras.clear();
    const auto got = join(matches, cameras, own);
    CHECK(same_tracks(tracks_oracle(matches, camera_of, own), got));
    for (std::size_t t = 0; t < got.size(); ++t)  // what a track promises
      for (int i = got.offsets[t] + 1; i < got.offsets[t + 1]; ++i) {
        const auto &a = got.views[static_cast<std::size_t>(i - 1)], &b = got.views[static_cast<std::size_t>(i)];
        CHECK((a.keyframe < b.keyframe || (a.keyframe == b.keyframe && a.camera < b.camera)));
      }
  }
}

TEST_CASE("by hand: the nearer claim of a keypoint wins, and what it leaves alone is no track") {
  const auto got = join({{0, 0, 5, 9}, {0, 3, 5, 4}, {1, 0, 2, 30}, {1, 3, 2, 30}, {2, 8, 1, 0}});
  CHECK(got.outcomes == std::vector<match_outcome>{match_outcome::contradicts, match_outcome::joined,
                                                   match_outcome::joined, match_outcome::contradicts,
                                                   match_outcome::joined});
  REQUIRE(got.size() == 3);
  CHECK(got.offsets == std::vector<std::int32_t>{0, 2, 4, 6});
  CHECK((got.views[0].keypoint == 0 && got.views[1].keyframe == 2 && got.views[1].keypoint == 2));
  CHECK((got.views[2].keypoint == 3 && got.views[3].keyframe == 1 && got.views[3].keypoint == 5));
  CHECK((got.views[4].keypoint == 8 && got.views[5].keyframe == 3 && got.views[5].keypoint == 1));
}

TEST_CASE("two cameras of the query join through a candidate that they share, and through each other") {
  // Query keypoints 0 (camera 0) and 1 (camera 1); keypoint 4 of neighbour 0 is in its camera 1.
  const auto shared = join({{0, 0, 4, 1}, {0, 1, 4, 2}}, {{0, 1}, {1, 1}});
  REQUIRE(shared.size() == 1);
  CHECK(shared.views.size() == 3);
  const auto own = join({{0, 0, 4, 1}, {1, 1, 0, 2}}, {{0, 1}, {1, 0}}, 1);  // neighbour 1 is the query
  REQUIRE(own.size() == 1);
  CHECK((own.views[0].camera == 0 && own.views[1].camera == 1 && own.views[1].keyframe == 0));
  CHECK((own.views[2].keyframe == 1 && own.views[2].keypoint == 4));
  const auto same_camera = join({{0, 0, 4, 1}, {0, 1, 4, 2}}, {{0, 1}, {0, 1}});
  CHECK(same_camera.views.size() == 2);
}

TEST_CASE("distances that are floating-point numbers") {
  turbomap::track_joiner joiner;
  turbomap::track_list got;
  using real_match = turbomap::correspondence<float>;
  const std::vector<real_match> matches{{0, 0, 1, 0.5F}, {0, 1, 1, 0.25F}, {0, 2, 1, -0.0F}};
  joiner(matches, {}, -1, got);
  REQUIRE(got.size() == 1);
  CHECK(got.views[0].keypoint == 2);
  using long_match = turbomap::correspondence<double>;
  const std::vector<long_match> wide{{0, 0, 1, 0.5}, {0, 1, 1, 0.25}, {0, 2, 1, 0.3}};
  joiner(wide, {}, -1, got);
  REQUIRE(got.size() == 1);
  CHECK(got.views[0].keypoint == 1);
}

TEST_CASE("nothing, and what cannot be") {
  CHECK(join({}).size() == 0);
  CHECK(join({}).offsets == std::vector<std::int32_t>{0});
  CHECK_THROWS_AS(join({{-1, 0, 0, 0}}), std::invalid_argument);
  CHECK_THROWS_AS(join({{0, -1, 0, 0}}), std::invalid_argument);
  CHECK_THROWS_AS(join({{0, 0, -1, 0}}), std::invalid_argument);
  CHECK_THROWS_AS(join({{0, 0, 0, 0}}, {{0, 0}, {0, 0}}), std::invalid_argument);
  scene_recipe recipe;
  for (const bool no_query : {true, false}) {
    recipe.query_keypoints = no_query ? 0 : 20, recipe.neighbours = no_query ? 2 : 0;
    scene<orb, fisheye_camera> s(fisheye_rig(), recipe);
    track_tally t;
    check_tracks(sequential{}, s, {}, t);
  }
}

}  // namespace

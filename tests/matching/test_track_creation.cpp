// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Points from tracks against their oracle; two views as a pair; bad input.

#include <turbomap/matching/given_correspondences.hpp>

#include <thrust/execution_policy.h>

#include <cstdint>
#include <limits>
#include <memory_resource>
#include <new>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "scenes/keyframe_samples.hpp"
#include "support/policies.hpp"
#include "track_creation_cases.hpp"

namespace {

using namespace turbomap_test;
using turbomap::creation_options;
using turbomap::creation_outcome;
using turbomap::search_options;

scene_recipe many_views(unsigned seed, motion how) {
  scene_recipe recipe;
  recipe.seed = seed, recipe.how = how, recipe.mapped = 0.1, recipe.neighbours = 6;
  recipe.query_keypoints = recipe.neighbour_keypoints = 200;
  recipe.prototypes = 60, recipe.landmarks = 0.9;
  return recipe;
}

template <class Policy, class Camera>
track_point_tally check_rig(const test_rig<Camera>& rig, unsigned seed, const creation_options& options, long least) {
  track_point_tally t;
  for (const motion how : {motion::sideways, motion::forward, motion::backward, motion::along_axis, motion::anything}) {
    scene<orb, Camera> s(rig, many_views(seed++, how));
    check_track_creation(Policy{}, s, search_options{}, options, t);
    check_track_creation(Policy{}, s, wide_gates(), options, t);
  }
  check_track_points(t, least);
  return t;
}

TEST_CASE_TEMPLATE("points of tracks are made as the oracle says", Policy, TURBOMAP_TEST_POLICIES) {
  const auto mono = check_rig<Policy>(pinhole_rig(), 1, {}, 100);
  const auto stereo = check_rig<Policy>(pinhole_rig(50), 11, {}, 200);
  const auto fish = check_rig<Policy>(fisheye_rig(), 21, {}, 100);
  const auto three = check_rig<Policy>(fisheye_rig(3), 31, {}, 50);
  CHECK(mono.of_many + stereo.of_many + fish.of_many + three.of_many > 300);
  CHECK(mono.lost_views + stereo.lost_views + fish.lost_views + three.lost_views > 30);
  for (const creation_outcome o :
       {creation_outcome::low_parallax, creation_outcome::behind_query, creation_outcome::behind_neighbour,
        creation_outcome::reprojection_query, creation_outcome::reprojection_neighbour, creation_outcome::scale}) {
    const auto i = static_cast<std::size_t>(o);
    CAPTURE(i);
    CHECK(mono.outcomes[i] + stereo.outcomes[i] + fish.outcomes[i] > 0);
  }
  CHECK((stereo.methods[2] > 0 && stereo.methods[3] > 0));
}

TEST_CASE_TEMPLATE("a point whose variance no float can hold is at infinity", Policy, TURBOMAP_TEST_POLICIES) {
  scene<orb, pinhole_camera> s(pinhole_rig(), many_views(1, motion::sideways));
  const auto near = create_tracks_under(Policy{}, s, wide_gates(), {});
  for (auto& f : s.frames) f.T_cw.tx *= 1e25, f.T_cw.ty *= 1e25, f.T_cw.tz *= 1e25;
  const auto far = create_tracks_under(Policy{}, s, wide_gates(), {});
  REQUIRE(far.points.size() == near.points.size());
  int accepted = 0, at_infinity = 0;
  for (std::size_t i = 0; i < far.points.size(); ++i) {
    accepted += near.points[i].outcome == creation_outcome::accepted ? 1 : 0;
    at_infinity += far.points[i].outcome == creation_outcome::at_infinity ? 1 : 0;
    CHECK(far.points[i].outcome != creation_outcome::accepted);
  }
  CHECK(accepted > 10);
  CHECK(at_infinity > 10);
}

TEST_CASE("no memory, at whichever allocation: no points are left, neither new nor old ones") {
  scene_recipe few = many_views(3, motion::sideways);
  few.neighbours = 2, few.query_keypoints = few.neighbour_keypoints = 40;
  scene<orb, pinhole_camera> first(pinhole_rig(), few), second(pinhole_rig(), many_views(4, motion::sideways));
  int failures = 0;
  for (bool done = false; !done; ++failures) {  // each allocation of the second call fails once
    CAPTURE(failures);
    counting_resource resource(std::pmr::new_delete_resource());
    turbomap::context<sequential> ctx(sequential{}, &resource, &resource);
    turbomap::track_creation<sequential> made(ctx);
    std::vector<turbomap::created_track> points;
    std::vector<std::uint8_t> kept;
    for (auto* const s : {&first, &second}) {
      const auto neighbours = s->neighbours();
      const auto found = turbomap::search_correspondences(
          ctx, s->query(), turbomap::span<const decltype(s->query())>(neighbours), search_options{});
      turbomap::match_tracks<orb, pinhole_camera, sequential> joined(ctx);
      turbomap::join_tracks(ctx, found, joined);
      if (s == &second) resource.refuse_from = resource.allocations + failures, resource.refusals = 1;
      try {
        turbomap::create_track_points(ctx, found, joined, creation_options{}, made);
        done = s == &second;
      } catch (const std::bad_alloc&) {
      }
      resource.refuse_from = -1;
      made.plan(ctx, points, kept);
      const bool has_failed = s == &second && !done;
      CHECK(points.size() == (has_failed ? 0 : joined.tracks().size()));
      CHECK(kept.size() == (has_failed ? 0 : joined.tracks().views.size()));
      REQUIRE(joined.tracks().size() > 0);
    }
  }
  CHECK(failures > 4);
}

TEST_CASE("other options, rigs of mixed models") {
  creation_options o;
  o.max_parallax_cosine = 0.9996, o.mono_chi2 = 2, o.stereo_chi2 = 20, o.scale_tolerance = 1, o.max_distance = 4;
  o.stereo_correlation = 31.0 / 32, o.refinement_steps = 1, o.refinement_tolerance = 0;
  const auto stereo = check_rig<sequential>(pinhole_rig(50), 41, o, 20);
  CHECK(stereo.outcomes[static_cast<std::size_t>(creation_outcome::too_far)] > 0);
  o.fewest_keyframes = 2;
  check_rig<sequential>(mixed_rig(), 51, o, 10);
  o.refinement_steps = 0;
  check_rig<sequential>(pinhole_rig(), 61, o, 10);
}

TEST_CASE_TEMPLATE("a point is seen by so many keyframes as were asked for", Policy, TURBOMAP_TEST_POLICIES) {
  long accepted[4] = {}, refused[4] = {};
  for (const int fewest : {1, 2, 3}) {
    creation_options o;
    o.fewest_keyframes = fewest, o.lookalike_ratio = 0;
    const auto t = check_rig<Policy>(fisheye_rig(), 71, o, 30);  // against the oracle
    accepted[fewest] = t.accepted;
    refused[fewest] = t.outcomes[static_cast<std::size_t>(creation_outcome::too_few_keyframes)];
  }
  CHECK(refused[1] == 0);
  CHECK(refused[2] > 5);
  CHECK(refused[3] > refused[2]);
  CHECK((accepted[1] > accepted[2] && accepted[2] > accepted[3]));
}

TEST_CASE_TEMPLATE("two keypoints of a rig are no point where another resembles one as much", Policy,
                   TURBOMAP_TEST_POLICIES) {
  auto pinholes = pinhole_rig();
  pinholes.cameras.push_back({pinholes.cameras[0].camera, beside(), 0, {}});
  const auto refused = [](const track_point_tally& t) {
    return t.outcomes[static_cast<std::size_t>(creation_outcome::lookalike)];
  };
  for (const bool straight : {false, true}) {
    CAPTURE(straight);
    const auto of = [&](double ratio) {  // against the oracle
      return refused(straight ? check_lookalikes(Policy{}, pinholes, ratio)
                              : check_lookalikes(Policy{}, fisheye_rig(), ratio));
    };
    const long never = of(0), more_alike = of(1), clearly = of(0.8);
    CHECK(never == 0);
    CHECK(more_alike > 50);
    CHECK(clearly > more_alike);
  }
  const auto real = check_lookalikes<turbomap::real_descriptor<float, 64>>(Policy{}, fisheye_rig(), 0.8);
  CHECK(refused(real) > 50);
}

TEST_CASE("a track of two views is decided as a pair") {
  long tracks = 0, accepted = 0, farther = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    auto recipe = many_views(seed, motion::sideways);
    recipe.neighbours = 1;
    scene<orb, pinhole_camera> s(pinhole_rig(seed % 2 == 0 ? 50 : 0), recipe);
    search_options search;
    creation_options creation;
    search.scales = creation.scales = s.scales();
    const auto pairs = create_under(sequential{}, s, search, creation);
    const auto got = create_tracks_under(sequential{}, s, search, creation);
    for (std::size_t t = 0; t < got.tracks.size(); ++t) {
      const auto at = static_cast<std::size_t>(got.tracks.offsets[t]);
      const auto pair =
          std::find_if(pairs.begin(), pairs.end(), [&](auto& p) { return p.query == got.tracks.views[at].keypoint; });
      REQUIRE(pair != pairs.end());
      CHECK(pair->outcome == got.points[t].outcome);
      CHECK(pair->method == got.points[t].method);
      ++tracks;
      if (pair->outcome != creation_outcome::accepted) continue;
      ++accepted;
      farther += turbomap::norm(pair->position - got.points[t].position) > 0 ? 1 : 0;  // refined
    }
  }
  CHECK(tracks > 100);
  CHECK(accepted > 50);
  CHECK(farther > 20);
}

template <class Policy, class Camera>
void check_known(const test_rig<Camera>& rig, unsigned seed, double chi2, int wanted, long& known, long& others,
                 int octaves = 255) {
  auto recipe = many_views(seed, motion::sideways);
  recipe.mapped = 0.3;
  scene<orb, Camera> s(rig, recipe);
  std::vector<turbomap::posed_keyframe<orb, Camera>> all{s.query()};
  for (const auto& n : s.neighbours()) all.push_back(n);
  std::vector<std::vector<std::int32_t>> numbers;
  std::vector<std::int32_t> flat, offsets;
  for (const auto& k : all) {
    offsets.push_back(static_cast<std::int32_t>(flat.size()));
    numbers.emplace_back();
    for (int i = 0; i < k.view.keypoint_count; ++i)
      numbers.back().push_back(k.has_point[static_cast<std::size_t>(i)] != 0 ? (i * 7 + static_cast<int>(seed)) % 40
                                                                             : -1);
    flat.insert(flat.end(), numbers.back().begin(), numbers.back().end());
  }
  creation_options creation;
  search_options search;
  search.scales = creation.scales = s.scales();
  search.across_rig = true;
  creation.known_chi2 = chi2, creation.known_views = wanted, creation.known_octaves = octaves;
  turbomap::context<Policy> ctx{Policy{}};
  const resident_scene<orb, Camera, Policy> keyframes(ctx, s);
  const auto found = turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours(), search);
  turbomap::match_tracks<orb, Camera, Policy> joined(ctx);
  turbomap::join_tracks(ctx, found, joined);
  turbomap::track_creation<Policy> made(ctx);
  turbomap::create_track_points(ctx, found, joined, creation, made, {flat, offsets});
  std::vector<turbomap::created_track> points, without;
  std::vector<std::uint8_t> kept;
  made.plan(ctx, points, kept);
  turbomap::create_track_points(ctx, found, joined, creation, made);
  made.plan(ctx, without, kept);
  const auto& tracks = joined.tracks();
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const auto begin = static_cast<std::size_t>(tracks.offsets[t]),
               end = static_cast<std::size_t>(tracks.offsets[t + 1]);
    const bool expected = known_oracle<orb, Camera>(all, numbers, {tracks.views.data() + begin, end - begin}, creation);
    CHECK((points[t].outcome == creation_outcome::known) == expected);
    CHECK(without[t].outcome != creation_outcome::known);
    if (!expected) CHECK(same(points[t], without[t]));
    (expected ? known : others) += 1;
  }
}

TEST_CASE_TEMPLATE("a landmark that has a point is left out", Policy, TURBOMAP_TEST_POLICIES) {
  long known = 0, others = 0, nobody = 0, near = 0, by_default = 0;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    check_known<Policy>(pinhole_rig(), seed, 700, 2, known, others);
    check_known<Policy>(fisheye_rig(), seed, 700, 2, known, others);
    check_known<Policy>(pinhole_rig(50), seed, 2000, 3, known, others);
    check_known<Policy>(pinhole_rig(), seed, 700, 1, known, others);
    check_known<Policy>(pinhole_rig(), seed, 1e6, 0, nobody, others);
    check_known<Policy>(pinhole_rig(), seed, 1e6, std::numeric_limits<int>::max(), nobody, others);
    check_known<Policy>(pinhole_rig(), seed, 700, 2, near, others, 1);
    check_known<Policy>(fisheye_rig(), seed, 700, 2, near, others, 1);
    check_known<Policy>(pinhole_rig(), seed, 700, 2, by_default, others, creation_options{}.known_octaves);
    check_known<Policy>(fisheye_rig(), seed, 700, 2, by_default, others, creation_options{}.known_octaves);
  }
  CHECK(by_default == near);  // the octaves in which fusion looks for a point
  CHECK(near > 20);
  CHECK(near < known);
  CHECK(known > 100);
  CHECK(others > 100);
  CHECK(nobody == 0);
}

/// A fisheye keyframe at (x, 0, 0) that looks along z, with one keypoint: where it sees (0.1, 0.1, 2), or where no ray ends.
scene_frame<orb, fisheye_camera> fisheye_frame(double x, bool has_ray = true) {
  auto rig = fisheye_rig(1);
  scene_frame<orb, fisheye_camera> f;
  f.cameras = rig.cameras, f.bounds = rig.bounds;
  turbomap::vec2<double> pixel{5000, 5000};
  if (has_ray) REQUIRE(fisheye().project(turbomap::vec3<double>{0.1 - x, 0.1, 2}, pixel));
  turbomap::keypoint k;
  k.x = static_cast<float>(pixel.x), k.y = static_cast<float>(pixel.y);
  f.keypoints = {k}, f.T_cw.tx = -x;
  f.descriptors.resize(static_cast<std::size_t>(orb::elements));
  turbomap::keyframe_packing_scratch scratch;
  f.pack(scratch, {1.2F, 8});
  return f;
}

TEST_CASE_TEMPLATE("a view whose pixel has no ray leaves its track, the others stay", Policy, TURBOMAP_TEST_POLICIES) {
  using posed = turbomap::posed_keyframe<orb, fisheye_camera>;
  for (std::size_t without = 0; without < 4; ++without) {
    CAPTURE(without);
    std::vector<scene_frame<orb, fisheye_camera>> frames;
    for (std::size_t i = 0; i < 4; ++i) frames.push_back(fisheye_frame(0.2 * static_cast<double>(i), i != without));
    std::vector<posed> keyframes;
    for (auto& f : frames) keyframes.push_back(f.posed());
    const std::vector<turbomap::correspondence<std::int32_t>> matches{{0, 0, 0, 5}, {1, 0, 0, 5}, {2, 0, 0, 5}};
    turbomap::context<Policy> ctx{Policy{}};
    turbomap::correspondences<orb, fisheye_camera, Policy> given(ctx);
    turbomap::given_correspondences(ctx, keyframes[0], turbomap::span<const posed>(keyframes.data() + 1, 3),
                                    turbomap::span<const turbomap::correspondence<std::int32_t>>(matches), {}, given);
    turbomap::match_tracks<orb, fisheye_camera, Policy> joined(ctx);
    turbomap::join_tracks(ctx, given, joined);
    turbomap::track_creation<Policy> made(ctx);
    turbomap::create_track_points(ctx, given, joined, {}, made);
    std::vector<turbomap::created_track> points;
    std::vector<std::uint8_t> kept;
    made.plan(ctx, points, kept);
    REQUIRE(points.size() == 1);
    CHECK(points[0].outcome == creation_outcome::accepted);
    CHECK(points[0].views == 3);
    REQUIRE(kept.size() == 4);
    for (std::size_t i = 0; i < 4; ++i) CHECK(kept[i] == (i == without ? 0 : 1));
    CHECK(turbomap::norm(points[0].position - turbomap::vec3<double>{0.1, 0.1, 2}) < 1e-3);
  }
}

TEST_CASE("nothing found, nothing created") {
  scene_recipe recipe;
  for (const bool no_query : {true, false}) {
    recipe.query_keypoints = no_query ? 0 : 20, recipe.neighbours = no_query ? 2 : 0;
    scene<orb, pinhole_camera> s(pinhole_rig(), recipe);
    CHECK(create_tracks_under(sequential{}, s, {}, {}).points.empty());
  }
}

TEST_CASE("matches that were moved from are none") {
  scene<orb, pinhole_camera> s(pinhole_rig(50), many_views(3, motion::sideways));
  turbomap::context<sequential> ctx{};
  const resident_scene<orb, pinhole_camera, sequential> keyframes(ctx, s);
  auto a = turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours());
  const auto expected = a.plan(ctx).size();
  REQUIRE(expected > 0);
  auto b = std::move(a);
  CHECK(a.size() == 0);  // NOLINT(bugprone-use-after-move): what is asked
  CHECK(a.plan(ctx).empty());
  CHECK(b.plan(ctx).size() == expected);
  a = std::move(b);
  CHECK(b.size() == 0);  // NOLINT(bugprone-use-after-move)
  CHECK(b.plan(ctx).empty());
  CHECK(a.plan(ctx).size() == expected);
}

TEST_CASE("bad options and tracks of another search are refused, and the last points stay") {
  scene<orb, pinhole_camera> s(pinhole_rig(50), many_views(3, motion::sideways));
  turbomap::context<sequential> ctx{};
  const resident_scene<orb, pinhole_camera, sequential> keyframes(ctx, s);
  const auto found = turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours());
  turbomap::match_tracks<orb, pinhole_camera, sequential> joined(ctx);
  turbomap::join_tracks(ctx, found, joined);
  turbomap::track_creation<sequential> made(ctx);
  turbomap::create_track_points(ctx, found, joined, {}, made);
  std::vector<turbomap::created_track> before, after;
  std::vector<std::uint8_t> kept;
  made.plan(ctx, before, kept);
  REQUIRE(!before.empty());
  const auto refused = [&](const char* name, auto set) {
    CAPTURE(name);
    for (const double value : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
      creation_options o;
      set(o, value);
      std::string message;
      try {
        turbomap::create_track_points(ctx, found, joined, o, made);
      } catch (const std::invalid_argument& e) {
        message = e.what();
      }
      CHECK(message.find(std::string("options.") + name + " = ") != std::string::npos);
    }
    made.plan(ctx, after, kept);
    CHECK(same(before, after));
  };
  refused("mono_chi2", [](creation_options& o, double v) { o.mono_chi2 = v; });
  refused("refinement_tolerance", [](creation_options& o, double v) { o.refinement_tolerance = v; });
  refused("known_chi2", [](creation_options& o, double v) { o.known_chi2 = v; });
  refused("known_views", [](creation_options& o, double) { o.known_views = -1; });
  refused("known_octaves", [](creation_options& o, double) { o.known_octaves = -1; });
  refused("fewest_keyframes", [](creation_options& o, double) { o.fewest_keyframes = 0; });
  refused("lookalike_ratio", [](creation_options& o, double v) { o.lookalike_ratio = v; });
  refused("lookalike_ratio", [](creation_options& o, double v) { o.lookalike_ratio = 1 - v; });  // 2, NaN
  refused("refinement_steps", [](creation_options& o, double) { o.refinement_steps = -1; });
  refused("stereo_correlation", [](creation_options& o, double v) { o.stereo_correlation = v; });
  const std::vector<std::int32_t> offsets(2);
  CHECK_THROWS_AS(turbomap::create_track_points(ctx, found, joined, {}, made, {offsets, offsets}),
                  std::invalid_argument);
  // Of each keyframe, where its numbers begin: one for each of its keypoints must be there.
  std::vector<std::int32_t> begins(1, 0);
  for (const std::int32_t count : found.keypoint_counts()) begins.push_back(begins.back() + count);
  const std::vector<std::int32_t> numbers(static_cast<std::size_t>(begins.back()), -1);
  begins.pop_back();
  turbomap::create_track_points(ctx, found, joined, {}, made, {numbers, begins});
  made.plan(ctx, after, kept);
  CHECK(same(before, after));
  const auto known_is_refused = [&](turbomap::span<const std::int32_t> given) {
    CHECK_THROWS_WITH_AS(turbomap::create_track_points(ctx, found, joined, {}, made, {given, begins}),
                         doctest::Contains("known.offsets[]"), std::invalid_argument);
  };
  known_is_refused({numbers.data(), numbers.size() - 1});
  for (const std::int32_t begin : {-1, std::numeric_limits<std::int32_t>::max()}) {
    begins[0] = begin;
    known_is_refused(numbers);
  }
  made.plan(ctx, after, kept);
  CHECK(same(before, after));
  const auto fewer = turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours().subspan(0, 1));
  CHECK_THROWS_AS(turbomap::create_track_points(ctx, fewer, joined, {}, made), std::invalid_argument);
  CHECK(joined.are_of(found));
  CHECK_FALSE(joined.are_of(fewer));
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Several points at once: no point that a camera sees is lost, most others are, and what is known of those that are left is right; and
// their windows hold what the prefilter finds in them one by one.

#include <cmath>
#include <vector>

#include "projection_cases.hpp"

namespace {

using namespace turbomap_test;
using turbomap::decision;

/// What became of the points of some scenes.
struct lane_tally {
  long seen = 0, unseen = 0;              ///< by the decision
  long seen_lost = 0, unseen_kept = 0;    ///< of those
  long skipped_kept = 0, twice = 0;       ///< none is looked at
  long asked = 0, placed = 0, wrong = 0;  ///< nothing known, where it is known, and not right
  long hopeful = 0, windows_differ = 0;   ///< a keypoint may be its match, by the prefilter, and of all windows at once
  bool known = true;                      ///< all cameras
};

/// Whether the decision came as far as the keypoints.
bool is_seen(projection_outcome outcome) {
  return outcome != projection_outcome::skipped && outcome != projection_outcome::behind &&
         outcome != projection_outcome::outside && outcome != projection_outcome::out_of_range &&
         outcome != projection_outcome::oblique;
}

template <class Camera>
void tally_scene(const duplicate_scene<orb, Camera>& s, projection_options options, lane_tally& t) {
  options.scales = s.scales(), options.one_to_one = false;
  const auto points = s.points();
  const auto trials = find_under(sequential{}, s, points, options).trials;
  turbomap::context<sequential> ctx{sequential{}};
  const resident_targets<orb, Camera, sequential> resident(ctx, s);
  turbomap::projections<orb, Camera, sequential> result(ctx);
  ctx.begin_call();
  const auto search = turbomap::set_up_projection_search(ctx, points, resident.targets(), options, result.buffers());
  turbomap::launch_prepare_cameras(ctx.policy(), search);
  constexpr int block = 24;
  for (int r = 0; r < search.request_count; ++r) {
    const turbomap::projection_camera& camera = search.cameras[r];
    const auto& model = search.keyframes[camera.of.target].cameras[camera.of.camera].camera;
    turbomap::projection_lanes<orb, Camera, block> lanes(search, camera);
    t.known = t.known && lanes.is_known();
    if (!lanes.is_known()) continue;
    const turbomap::projection_prefilter<orb, Camera> prefilter(search, camera);
    turbomap::projection_windows<orb, Camera, block> windows(search, camera);
    std::vector<int> kept(static_cast<std::size_t>(points.count)), hopeful, found;
    const auto ask = [&](int p) { ++kept[static_cast<std::size_t>(p)], ++t.asked; };
    const auto at = [&](int p, const turbomap::vec2<double>& pixel, double z, double distance) {
      ++kept[static_cast<std::size_t>(p)], ++t.placed;
      const auto X = turbomap::cast<decision>(points.position[p]), X_c = camera.T_cw * X;
      turbomap::vec2<decision> expected{};
      const bool defined = model.project(X_c, expected);
      const double far = turbomap::norm(X - camera.centre).value;
      const bool right = std::abs(pixel.x - expected.x.value) < 1e-6 && std::abs(pixel.y - expected.y.value) < 1e-6 &&
                         std::abs(z - X_c.z.value) < 1e-10 * far && std::abs(distance - far) < 1e-10 * far;
      t.wrong += defined && !right ? 1 : 0;
      const int level = prefilter.level_of(p, distance);
      if (level < -1 || !windows.is_known()) return;
      if (prefilter.may_match_at(p, pixel, z, level)) hopeful.push_back(p);
      windows.add(p, pixel, z, level);
    };
    for (int first = 0; first < points.count; first += block) {
      lanes.find(first, first + block < points.count ? first + block : points.count, ask, at);
      windows.find([&](int p) { found.push_back(p); });
    }
    t.hopeful += static_cast<long>(hopeful.size()), t.windows_differ += hopeful == found ? 0 : 1;
    for (std::size_t p = 0; p < kept.size(); ++p) {
      const projection_outcome outcome = trials[static_cast<std::size_t>(r) * kept.size() + p].outcome;
      const long is_kept = kept[p] > 0 ? 1 : 0;
      t.twice += kept[p] > 1 ? 1 : 0;
      if (outcome == projection_outcome::skipped)
        t.skipped_kept += is_kept;
      else if (is_seen(outcome))
        ++t.seen, t.seen_lost += 1 - is_kept;
      else
        ++t.unseen, t.unseen_kept += is_kept;
    }
  }
}
template <class Camera>
lane_tally tally_scenes(const std::vector<test_rig<Camera>>& rigs, duplicate_recipe recipe,
                        const projection_options& options) {
  lane_tally t;
  for (int i = 0; i < 4; ++i, ++recipe.seed) tally_scene(duplicate_scene<orb, Camera>(rigs, recipe), options, t);
  return t;
}
void check_lanes(const lane_tally& t) {
  CHECK(t.known);
  CHECK(t.seen > 300);
  CHECK(t.unseen > 300);
  CHECK(t.seen_lost == 0);
  CHECK(t.unseen_kept * 50 < t.unseen);
  CHECK(t.skipped_kept == 0);
  CHECK(t.twice == 0);
  CHECK(t.wrong == 0);
  CHECK(t.asked * 20 < t.placed);
  CHECK(t.hopeful > 100);
  CHECK(t.windows_differ == 0);
}

TEST_CASE("pinhole, fisheye and mixed rigs: what is seen is kept, little else, and it is where it is projected") {
  check_lanes(tally_scenes(std::vector{pinhole_rig(50)}, crowded(10), wide()));
  check_lanes(tally_scenes(fisheye_rigs(), crowded(20), wide()));
  check_lanes(tally_scenes(std::vector{mixed_rig()}, crowded(30), wide()));
}
TEST_CASE("without ranges and normals, and with points on the thresholds") {
  projection_options options = wide();
  options.range_gate = false, options.min_view_cosine = -1;
  check_lanes(tally_scenes(fisheye_rigs(), crowded(40), options));
  duplicate_recipe recipe = crowded(50);
  recipe.on_edge = 0.5, recipe.off_unit = 5e-4;
  CHECK(tally_scenes(std::vector{pinhole_rig(50)}, recipe, wide()).seen_lost == 0);
  CHECK(tally_scenes(fisheye_rigs(), recipe, wide()).seen_lost == 0);
}
TEST_CASE("a point on the optical axis of a fisheye camera, and one at its focal plane, are not decided on") {
  duplicate_recipe recipe = seeded(60);
  recipe.points = 5, recipe.targets = 1, recipe.skip = -1;
  duplicate_scene<orb, fisheye_camera> s({fisheye_rig(1)}, recipe);
  s.frames[0].T_cw = {};
  s.position = {{0, 0, 4}, {1e-9, 0, 4}, {0.5, 0.25, 4}, {1, 1, 1e-9}, {0.5, 0.25, -4}};
  projection_options options = wide();
  options.range_gate = false, options.min_view_cosine = -1;
  lane_tally t;
  tally_scene(s, options, t);
  CHECK(t.asked == 3);
  CHECK(t.placed == 1);
  CHECK(t.wrong == 0);
}
TEST_CASE("other models are left to the prefilter") {
  lane_tally t;
  tally_scene(duplicate_scene<orb, turbomap::double_sphere<double>>({double_sphere_rig()}, crowded(70)), wide(), t);
  CHECK(!t.known);
  CHECK(t.seen + t.unseen == 0);
}

}  // namespace

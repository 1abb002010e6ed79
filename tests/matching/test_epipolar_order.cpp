// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The epipolar order is exact: what it leaves out could not have matched. Nothing is excused here.

#include <cmath>
#include <iterator>
#include <limits>
#include <random>
#include <vector>

#include "matching_cases.hpp"

namespace {

using namespace turbomap_test;
using turbomap::epipolar_order_layout;
using turbomap::epipolar_table;
using turbomap::plane_interval;
using turbomap::search_options;

constexpr float two_pi = 2 * epipolar_order_layout::pi;

double between(std::mt19937& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

TEST_CASE("the angle of a plane is right to 1e-4, its width is never too small") {
  std::mt19937 random(1);
  for (int i = 0; i < 200000; ++i) {
    const double a = between(random, 0, 6.283185), r = std::pow(10, between(random, -3, 0));
    const auto x = static_cast<float>(r * std::cos(a)), y = static_cast<float>(r * std::sin(a));
    const float angle = turbomap::plane_angle(y, x);
    const double off = std::remainder(angle - std::atan2(double{y}, double{x}), 2 * 3.14159265358979);
    REQUIRE(std::abs(off) < 1e-4);
    REQUIRE(angle >= 0);
    REQUIRE(angle <= two_pi);
  }
  for (const auto& [y, x] : {std::pair{0.F, 1.F}, {0.F, -1.F}, {1.F, 0.F}, {-1.F, 0.F}, {-0.F, 1.F}})
    CHECK(std::abs(std::remainder(turbomap::plane_angle(y, x) - std::atan2(y, x), two_pi)) < 1e-4);
  for (int i = 0; i <= 10000; ++i) {
    const float s = static_cast<float>(i) / 10000;
    REQUIRE(double{turbomap::asin_bound(s)} >= std::asin(double{s}) - 1e-7);
  }
}

/// The arrays of some codes.
struct code_list {
  explicit code_list(std::size_t room) : angles(room), half_widths(room), least(room) {}
  turbomap::plane_codes view() { return {angles.data(), half_widths.data(), least.data()}; }

  std::vector<std::uint16_t> angles, half_widths;
  std::vector<std::int16_t> least;
};

TEST_CASE("codes round outwards, and those of a batch are those of one by one") {
  std::mt19937 random(4);
  const float infinity = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  const float special[] = {0,   -1,         4,          1e30F,   -1e30F, infinity, -infinity,
                           nan, 6.2831855F, 6.2831850F, 3.9997F, -4,     1e-9F};
  constexpr int lanes = 8;
  using lane_pack = turbomap::pack<float, lanes>;
  for (int round = 0; round < 20000; ++round) {
    const auto any = [&](double low, double high) {
      return random() % 4 == 0 ? special[random() % std::size(special)]
                               : static_cast<float>(between(random, low, high));
    };
    float angle[lanes], half_width[lanes], least[lanes], most[lanes];
    for (int l = 0; l < lanes; ++l) {
      half_width[l] = any(-0.1, 7);
      // Of a plane that is known, a number; see plane_measure.
      angle[l] = half_width[l] < 0 ? any(0, two_pi) : static_cast<float>(between(random, 0, two_pi));
      least[l] = any(-4.5, 4.5), most[l] = any(-4.5, 4.5);
    }
    turbomap::plane_code_batch batch;
    batch.set(0, turbomap::plane_code_numbers<lane_pack>::of(lane_pack::load(angle), lane_pack::load(half_width),
                                                             lane_pack::load(least), lane_pack::load(most)));
    for (int l = 0; l < lanes; ++l) {
      const auto one = turbomap::plane_code::of(angle[l], half_width[l], least[l], most[l]);
      const auto same = batch[l];
      CAPTURE(angle[l]);
      CAPTURE(half_width[l]);
      CAPTURE(least[l]);
      CAPTURE(most[l]);
      REQUIRE(same.angle == one.angle);
      REQUIRE(same.half_width == one.half_width);
      REQUIRE(same.least == one.least);
      REQUIRE(same.most == one.most);
      constexpr double units = 65536 / 6.283185307179586, steps = 8192;
      if (half_width[l] < 0 || std::isnan(half_width[l])) REQUIRE(one.half_width == one.unbounded);
      if (half_width[l] >= 0) {
        REQUIRE((one.half_width == one.unbounded || one.half_width >= double{half_width[l]} * units + 0.99));
        REQUIRE(std::abs(one.angle - double{angle[l]} * units) <= 1.01);
      }
      // NaN is no limit.
      if (!(least[l] * steps > -32768 + 2)) REQUIRE(one.least == -32768);
      if (least[l] * steps > -32768 + 2) REQUIRE((one.least <= double{least[l]} * steps && one.least < one.nowhere));
      if (!(most[l] * steps < one.nowhere - 3)) REQUIRE(one.most == one.nowhere - 1);
      if (most[l] * steps < one.nowhere - 3) REQUIRE(one.most >= double{most[l]} * steps);
    }
  }
}

TEST_CASE("windows and lists hold every candidate whose interval meets that of the query") {
  std::mt19937 random(2);
  long listed = 0, in_windows = 0;
  for (int round = 0; round < 1000; ++round) {
    const int n = 1 + static_cast<int>(random() % 200);
    const double widest = between(random, -3, 0.8);  // of the round, so that all kinds are there
    std::vector<plane_interval> intervals;
    std::vector<std::int32_t> names, candidates(static_cast<std::size_t>(n));
    std::vector<std::int32_t> offsets(static_cast<std::size_t>(epipolar_order_layout::offset_count()));
    const auto interval = [&random, widest] {
      const auto angle = static_cast<float>(between(random, 0, two_pi));
      const bool unbounded = random() % 10 == 0;
      const bool edge = random() % 5 == 0;
      plane_interval at{edge ? (random() % 2 ? 0.0F : two_pi * 0.9999999F) : angle,
                        unbounded ? -1.0F : static_cast<float>(std::pow(10, between(random, widest - 1, widest)))};
      const auto to = static_cast<float>(between(random, 0, 3.1416)), off = static_cast<float>(between(random, 0, 0.1));
      if (random() % 4 != 0) at.least = to - off, at.most = to + off;
      if (random() % 20 == 0) at.least = -1e30F, at.most = 1e30F;
      return at;
    };
    for (int i = 0; i < n; ++i) {
      intervals.push_back(interval());
      names.push_back(1000 + i);
    }
    std::uint16_t sorted_width = 0;
    const auto room = static_cast<std::size_t>(n + turbomap::plane_codes::padding);
    code_list sorted(room), unsorted(room);
    for (int i = 0; i < n; ++i) unsorted.view().set(i, epipolar_table::code_of(intervals[static_cast<std::size_t>(i)]));
    const epipolar_table table{offsets.data(), candidates.data(), sorted.view(), &sorted_width};
    table.build(names.data(), unsorted.view(), n);
    for (int bucket = 0; bucket < epipolar_order_layout::total_buckets(); ++bucket)
      REQUIRE(offsets[static_cast<std::size_t>(bucket)] <= offsets[static_cast<std::size_t>(bucket) + 1]);
    for (int i = 0; i < 50; ++i) {
      const plane_interval q = interval();
      std::vector<int> visits(static_cast<std::size_t>(n)), lists(static_cast<std::size_t>(n));
      std::vector<std::int32_t> list(room);
      const turbomap::plane_code code = epipolar_table::code_of(q);
      table.windows(code, [&](std::int32_t first, std::int32_t last) {
        REQUIRE((first >= 0 && last <= n));
        for (std::int32_t c = first; c < last; ++c)
          ++visits[static_cast<std::size_t>(candidates[static_cast<std::size_t>(c)] - 1000)];
        in_windows += last - first;
        const int count = table.codes.list_meeting(code, first, last, list.data(), 0);
        REQUIRE(count <= n);
        listed += count;
        for (int k = 0; k < count; ++k) {
          const std::int32_t place = list[static_cast<std::size_t>(k)];
          REQUIRE((place >= first && place < n));
          REQUIRE((k == 0 || place > list[static_cast<std::size_t>(k) - 1]));
          lists[static_cast<std::size_t>(candidates[static_cast<std::size_t>(place)] - 1000)] = 1;
        }
      });
      for (std::size_t c = 0; c < intervals.size(); ++c) {
        const float apart = std::abs(std::remainder(intervals[c].angle - q.angle, two_pi));
        const bool meets =
            q.half_width < 0 || intervals[c].half_width < 0 || apart < q.half_width + intervals[c].half_width;
        REQUIRE(visits[c] <= 1);
        if (meets) REQUIRE(visits[c] == 1);
        if (meets && intervals[c].least <= q.most) REQUIRE(lists[c] == 1);
        // Rounding is of a few units: what is clearly apart is left out.
        constexpr float unit = 5e-4F;
        const bool apart_in_plane = !meets && apart > q.half_width + intervals[c].half_width + unit;
        if (apart_in_plane || intervals[c].least > q.most + 2 * unit) REQUIRE(lists[c] == 0);
      }
    }
  }
  CHECK(listed < in_windows);
}

/// Options from the defaults to the absurd.
search_options random_options(std::mt19937& random) {
  search_options o;
  const double exponent = between(random, -1, 2.5);
  if (random() % 3 != 0) o.line_chi2 = std::pow(10, exponent), o.reprojection_chi2 = std::pow(10, exponent);
  if (random() % 8 == 0) o.line_chi2 = o.reprojection_chi2 = 1e12;
  if (random() % 3 == 0) o.max_parallax_cosine = between(random, -1, 1);
  if (random() % 3 == 0) o.epipole_radius = between(random, 0, 100);
  if (random() % 2 == 0) o.max_distance = 256;
  o.ties = every_tie_rule[random() % 2];
  return o;
}

scene_recipe random_recipe(std::mt19937& random, unsigned seed) {
  scene_recipe r;
  r.seed = seed;
  r.how = every_motion[random() % 7];
  if (random() % 3 == 0) r.how = motion::anything;
  r.neighbours = 1 + static_cast<int>(random() % 2);
  r.query_keypoints = 10 + static_cast<int>(random() % 60);
  r.neighbour_keypoints = 10 + static_cast<int>(random() % 90);
  constexpr int levels[] = {1, 4, 8, 12};
  constexpr float factors[] = {1.05F, 1.2F, 1.5F, 2.0F};
  r.levels = levels[random() % 4];
  r.scale_factor = factors[random() % 4];
  r.at_epipole = random() % 2 == 0 ? 0.5 : 0.05;
  r.mapped = random() % 2 == 0 ? 0.2 : 0;
  r.prototypes = 1 + static_cast<int>(random() % 30);
  r.noise = static_cast<int>(random() % 40);
  return r;
}

/// A keypoint and its plane: as the search measures it, many at once, as filters do, one by one, and in double precision
/// without the library's functions.
struct measured_keypoint {
  std::int32_t keypoint;
  turbomap::plane_code together;
  plane_interval alone;
  double angle;
};

/// Measures the keypoints of one camera. \param R  from the camera's frame to that of the planes, which is the neighbour's
template <class Measure, class View>
std::vector<measured_keypoint> measure_keypoints(const Measure& measure, const View& view, const float* scale,
                                                 const turbomap::pair_geometry& g,
                                                 const turbomap::mat3<turbomap::decision>* R,
                                                 const std::vector<std::int32_t>& keypoints) {
  std::vector<measured_keypoint> result;
  for (std::size_t first = 0; first < keypoints.size(); first += turbomap::ray_batch::size) {
    turbomap::ray_batch rays;
    int count = 0;
    for (std::size_t k = first; k < keypoints.size() && count < turbomap::ray_batch::size; ++k, ++count) {
      const auto ray = view.bearing[keypoints[k]];
      const float spread = measure.spread(ray.z, scale[view.octave[keypoints[k]]]);
      rays.set(count, ray, spread);
      auto b = turbomap::cast<turbomap::decision>(ray);
      if (R != nullptr) b = *R * b;
      const auto along = [&b](const turbomap::vec3<float>& axis) {
        return b.x.value * axis.x + b.y.value * axis.y + b.z.value * axis.z;
      };
      const double angle = std::atan2(along(g.plane_y), along(g.plane_x));
      result.push_back({keypoints[k], {}, measure(ray, spread), g.straight ? 2 * angle : angle});
    }
    turbomap::plane_code_batch codes;
    measure(rays, count, codes);
    for (int i = 0; i < count; ++i) result[first + static_cast<std::size_t>(i)].together = codes[i];
  }
  return result;
}

struct order_tally {
  long passed = 0;    ///< pairs that pass the test
  long left_out = 0;  ///< of them, those the order would have left out: it must be none
  long off = 0;       ///< angles that are wrong by more than the slack: none
};

/// Compares all keypoints of a scene with each other, and their planes.
template <class Descriptor, class Camera>
order_tally count_left_out(scene<Descriptor, Camera>& s, const search_options& options) {
  turbomap::context<sequential> ctx{};
  const auto neighbours = s.neighbours();
  const auto found = turbomap::search_correspondences(
      ctx, s.query(), turbomap::span<const turbomap::posed_keyframe<Descriptor, Camera>>(neighbours), options);
  const auto& search = found.view();
  turbomap::ordered_tables<Descriptor, Camera> tables{};
  tables.search = search;
  order_tally t;
  const auto check_angle = [&t](const measured_keypoint& k, bool straight) {
    const float slack = (straight ? 2 : 1) * epipolar_order_layout::slack;
    const auto off = [&k](double angle) { return std::abs(std::remainder(angle - k.angle, 2 * 3.14159265358979)); };
    if (k.alone.half_width >= 0 && !(off(k.alone.angle) < slack)) ++t.off;
    constexpr double unit = 2 * 3.14159265358979 / 65536;
    if (k.together.half_width != turbomap::plane_code::unbounded &&
        !(off(k.together.angle * unit) < slack + 1.01 * unit))
      ++t.off;
  };
  const auto meet = [](const plane_interval& a, const plane_interval& b) {
    const float apart = std::abs(std::remainder(a.angle - b.angle, two_pi));
    const bool in_plane = a.half_width < 0 || b.half_width < 0 || apart <= a.half_width + b.half_width;
    return in_plane && b.least <= a.most;  // b: the candidate
  };
  for (int n = 0; n < search.neighbour_count; ++n)
    for (int a = 0; a < search.query_cameras; ++a)
      for (int b = 0; b < search.neighbour(n).camera_count; ++b) {
        const auto& g = search.pair(n, a, b);
        std::vector<std::int32_t> queries, candidates;
        for (int i = 0; i < search.slot_count; ++i)
          if (search.query().camera_of(search.queries[i]) == a) queries.push_back(search.queries[i]);
        for (int k = search.candidate_begin[n]; k < search.candidate_end[n]; ++k)
          if (search.neighbour(n).camera_of(search.candidates[k]) == b) candidates.push_back(search.candidates[k]);
        const auto mine =
            measure_keypoints(tables.query_measure(g, a), search.query(), search.scale, g, &g.T_ba.R, queries);
        const auto theirs = measure_keypoints(tables.candidate_measure(g, n, b), search.neighbour(n), search.scale, g,
                                              nullptr, candidates);
        for (const auto& q : mine) check_angle(q, g.straight);
        for (const auto& c : theirs) check_angle(c, g.straight);
        for (const auto& q : mine) {
          turbomap::candidate_scan<Descriptor, Camera> scan(search, n, q.keypoint);
          for (const auto& c : theirs) {
            if (!scan.consistent(c.keypoint)) continue;
            ++t.passed;
            // Filters have a table of either side.
            if (!q.together.meets(c.together) || !epipolar_table::code_of(q.alone).meets(c.together) ||
                !q.together.meets(epipolar_table::code_of(c.alone)) || !meet(q.alone, c.alone))
              ++t.left_out;
          }
        }
      }
  return t;
}

/// Many random configurations of one rig: the two searches agree to the last index, and no pair that passes the test lies
/// outside of its window.
template <class Descriptor = orb, class Camera>
void fuzz(const test_rig<Camera>& rig, unsigned first_seed, int rounds) {
  std::mt19937 random(first_seed);
  turbomap::context<sequential> ctx{};
  turbomap::correspondences<Descriptor, Camera, sequential> exhaustive(ctx), ordered(ctx);
  test_rig<Camera> measured = rig;
  for (auto& c : measured.cameras) c.resolution = turbomap::measure_resolution(c.camera, rig.bounds);
  long matches = 0, passed = 0;
  int different = 0;
  for (int round = 0; round < rounds; ++round) {
    const unsigned seed = first_seed + static_cast<unsigned>(round);
    CAPTURE(seed);
    scene<Descriptor, Camera> s(measured, random_recipe(random, seed));
    search_options options = random_options(random);
    options.scales = s.scales();
    const auto neighbours = s.neighbours();
    const turbomap::span<const turbomap::posed_keyframe<Descriptor, Camera>> all(neighbours);
    options.candidate_set = turbomap::candidates::exhaustive;
    turbomap::search_correspondences(ctx, s.query(), all, options, exhaustive);
    options.candidate_set = turbomap::candidates::epipolar_ordered;
    turbomap::search_correspondences(ctx, s.query(), all, options, ordered);
    const auto expected = exhaustive.plan(ctx);
    matches += static_cast<long>(expected.size());
    if (!same(ordered.plan(ctx), expected)) ++different;
    if (round % 8 == 0) {
      const order_tally t = count_left_out(s, options);
      passed += t.passed;
      CHECK(t.left_out == 0);
      CHECK(t.off == 0);
    }
  }
  CHECK(different == 0);
  CHECK(matches > rounds);
  CHECK(passed > rounds);
}

TEST_CASE("ordered equals exhaustive: pinhole") {
  fuzz(pinhole_rig(), 1000, 2000);
  fuzz(pinhole_rig(50), 3000, 600);
  fuzz(pinhole_rig(0, 90), 4000, 800);  // 150 degrees and more across
  fuzz(pinhole_rig(0, 3000), 5000, 400);
}
TEST_CASE("ordered equals exhaustive: fisheye") {
  fuzz(fisheye_rig(1), 6000, 600);
  fuzz(fisheye_rig(2), 7000, 600);
  fuzz(fisheye_rig(3), 8000, 300);
}
TEST_CASE("ordered equals exhaustive: other models") {
  fuzz(mixed_rig(), 9000, 500);
  fuzz(double_sphere_rig(), 10000, 400);
  fuzz(brown_conrady_rig(), 11000, 400);
  fuzz(equisolid_rig(), 12000, 100);
}
TEST_CASE("ordered equals exhaustive: a lens that folds just beyond its image") {
  const turbomap::brown_conrady<float> lens{298.2647F, 282.9152F, 111.63F,  279.46F, -0.15547F,
                                            -0.08125F, 0.00199F,  0.00300F, 0.02911F};
  test_rig<turbomap::brown_conrady<float>> rig{{{lens, {}, 0, {}}}, {0, 0, 311, 644}};
  rig.cameras[0].resolution = turbomap::measure_resolution(lens, rig.bounds);
  turbomap::context<sequential> ctx{};
  turbomap::correspondences<orb, turbomap::brown_conrady<float>, sequential> exhaustive(ctx), ordered(ctx);
  std::size_t matches = 0;
  int different = 0;
  for (unsigned round = 0; round < 400; ++round) {
    scene_recipe recipe;
    recipe.seed = 1000 + round, recipe.how = round % 5 == 0 ? motion::anything : every_motion[round % 3];
    recipe.neighbours = 2, recipe.query_keypoints = recipe.neighbour_keypoints = 300;
    recipe.levels = 8, recipe.scale_factor = 1.2F, recipe.noise = 10;
    recipe.at_epipole = 0.02, recipe.mapped = 0, recipe.prototypes = 60;
    scene<orb, turbomap::brown_conrady<float>> s(rig, recipe);
    search_options options;
    options.scales = s.scales();
    const auto neighbours = s.neighbours();
    const turbomap::span<const turbomap::posed_keyframe<orb, turbomap::brown_conrady<float>>> all(neighbours);
    options.candidate_set = turbomap::candidates::exhaustive;
    turbomap::search_correspondences(ctx, s.query(), all, options, exhaustive);
    options.candidate_set = turbomap::candidates::epipolar_ordered;
    turbomap::search_correspondences(ctx, s.query(), all, options, ordered);
    const auto expected = exhaustive.plan(ctx);
    matches += expected.size();
    different += same(ordered.plan(ctx), expected) ? 0 : 1;
  }
  CHECK(different == 0);
  CHECK(matches > 50000);
}
TEST_CASE("windows of more candidates than are listed at once") {
  // Where a keypoint may be off by as much as one likes, every plane is unbounded: a window holds all candidates.
  for (unsigned seed = 0; seed < 4; ++seed) {
    scene_recipe recipe;
    recipe.seed = seed, recipe.neighbours = 1, recipe.noise = 30;
    recipe.query_keypoints = 60, recipe.neighbour_keypoints = 2600;
    scene<orb, fisheye_camera> s(fisheye_rig(1), recipe);
    search_options options;
    options.scales = s.scales();
    options.max_distance = seed % 2 == 0 ? 256 : 100;
    options.reprojection_chi2 = 1e12;
    options.candidate_set = turbomap::candidates::exhaustive;
    const auto expected = search_under(sequential{}, s, options);
    options.candidate_set = turbomap::candidates::epipolar_ordered;
    CHECK(!expected.empty());
    CHECK(same(search_under(sequential{}, s, options), expected));
  }
}
TEST_CASE("octaves beyond the levels of the options") {
  // Nothing forbids it in a view that users made themselves: the tables of scales go on.
  for (unsigned seed = 0; seed < 60; ++seed) {
    scene_recipe recipe;
    recipe.seed = seed, recipe.levels = 12, recipe.scale_factor = 1.5F, recipe.noise = 40, recipe.at_epipole = 0.3;
    recipe.query_keypoints = recipe.neighbour_keypoints = 80;
    scene<orb, fisheye_camera> s(fisheye_rig(), recipe);
    search_options options;
    options.scales = {1.5F, 2};
    options.max_distance = 256;
    options.candidate_set = turbomap::candidates::exhaustive;
    const auto expected = search_under(sequential{}, s, options);
    options.candidate_set = turbomap::candidates::epipolar_ordered;
    CHECK(same(search_under(sequential{}, s, options), expected));
    CHECK(count_left_out(s, options).left_out == 0);
  }
}

}  // namespace

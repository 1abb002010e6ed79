// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// One bad row, kernel or option costs that row, or is refused; it does not spoil the adjustment of all others.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory_resource>
#include <stdexcept>
#include <vector>

#include "adjustment_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_end;
using turbomap::adjustment_options;
using turbomap::damping_rule;
using turbomap::precision;
using turbomap::span;
using turbomap_test::sequential;
constexpr double inf_value = std::numeric_limits<double>::infinity();
constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

adjustment_options long_run(damping_rule damping) {
  adjustment_options options = in_float64();
  options.max_iterations = 60, options.damping = damping;
  return options;
}

TEST_CASE_TEMPLATE("too much damping is no convergence", Policy, TURBOMAP_TEST_POLICIES) {
  const auto s = make_adjustment_scene(scene_kind::stereo, 5, 1, 40, 3);
  for (const auto damping : {damping_rule::identity, damping_rule::diagonal}) {
    adjustment_options options = long_run(damping);
    const double optimum = adjust_scene(Policy{}, s, options).summary.cost_final;
    options.initial_lambda = 1e100;
    const auto a = adjust_scene(Policy{}, s, options);
    CHECK(a.summary.cost_final == doctest::Approx(optimum).epsilon(1e-9));
    CHECK(a.summary.accepted > 0);
  }
}

TEST_CASE("thresholds that are not numbers are refused by name") {
  const auto s = make_adjustment_scene(scene_kind::stereo, 3, 1, 10, 3);
  for (const double bad : {-1.0, std::nan(""), HUGE_VAL}) {
    adjustment_options options = in_float64();
    options.min_predicted_decrease = bad;
    CHECK_THROWS_WITH_AS(adjust_scene(sequential{}, s, options), doctest::Contains("options.min_predicted_decrease"),
                         std::invalid_argument);
  }
  adjustment_options options = in_float64();
  options.time_budget_ms = std::nan("");
  CHECK_THROWS_WITH_AS(adjust_scene(sequential{}, s, options), doctest::Contains("options.time_budget_ms"),
                       std::invalid_argument);
}

TEST_CASE("at the optimum an adjustment has converged, whatever the damping") {
  auto s = make_adjustment_scene(scene_kind::stereo, 5, 1, 40, 3);
  const auto a = adjust_scene(sequential{}, s, long_run(damping_rule::diagonal));
  s.poses = a.poses, s.points = a.points;
  for (const double lambda : {0.0, 1.0, 1e100}) {
    adjustment_options options = long_run(damping_rule::diagonal);
    options.initial_lambda = lambda, options.min_predicted_decrease = 1e-9;
    const auto again = adjust_scene(sequential{}, s, options);
    CHECK(again.summary.end == adjustment_end::converged);
    CHECK(again.summary.accepted == 0);
  }
}

TEST_CASE("the default damping does not depend on the unit of length") {
  const auto s = make_adjustment_scene(scene_kind::stereo, 5, 1, 40, 3);
  auto mm = s;
  for (auto* poses : {&mm.poses, &mm.true_poses})
    for (auto& T : *poses) T.tx *= 1000, T.ty *= 1000, T.tz *= 1000;
  for (auto& p : mm.points) p = {1000 * p.x, 1000 * p.y, 1000 * p.z};
  mm.rig[0].bf *= 1000;
  adjustment_options options;
  options.numbers = precision::float64;
  const auto in_m = adjust_scene(sequential{}, s, options), in_mm = adjust_scene(sequential{}, mm, options);
  CHECK(in_mm.summary.cost_final == doctest::Approx(in_m.summary.cost_final).epsilon(1e-6));
}

template <class Kernel>
void check_refused(const Kernel& mono, const Kernel& stereo, const char* words) {
  const auto s = make_adjustment_scene(scene_kind::stereo, 3, 1, 10, 3);
  const auto g = s.group();
  turbomap::reprojections<scene_camera, Kernel> rows;
  rows.rig = g.rig, rows.frame = g.frame, rows.landmark = g.landmark, rows.pixel = g.pixel;
  rows.information = g.information, rows.camera = g.camera;
  rows.mono_kernel = mono, rows.stereo_kernel = stereo;
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::bundle_problem<sequential, pose_frame, decltype(rows)> problem(ctx);
  CHECK_THROWS_WITH_AS(problem.assign(ctx, s.frame_input(), s.landmark_input(), rows), doctest::Contains(words),
                       std::invalid_argument);
}
struct spoilt_kernel {
  double weight_at_one = 1;
  TURBOMAP_HD void operator()(double chi2, double& rho, double& weight) const {
    rho = chi2, weight = chi2 == 1 ? weight_at_one : 1;
  }
};

TEST_CASE("kernels that give no cost or weight are refused by name") {
  using turbomap::cauchy;
  using turbomap::huber;
  using turbomap::tukey;
  for (const double bad : {inf_value, nan_value, 0.0, -1.0}) {
    check_refused(huber{bad}, huber{}, "mono_kernel");
    check_refused(huber{}, huber{bad}, "stereo_kernel");
    check_refused(cauchy{bad}, cauchy{}, "mono_kernel");
    check_refused(tukey{}, tukey{bad}, "stereo_kernel");
  }
  check_refused(spoilt_kernel{nan_value}, spoilt_kernel{}, "mono_kernel");
  check_refused(spoilt_kernel{}, spoilt_kernel{-1}, "stereo_kernel");
}

TEST_CASE_TEMPLATE("a landmark at a camera, or next to it, leaves all others to be adjusted", Policy,
                   TURBOMAP_TEST_TWO_POLICIES) {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig})
    for (const auto damping : {damping_rule::identity, damping_rule::diagonal})
      for (const auto numbers : {precision::float64, precision::mixed})
        for (const double away : {0.0, 1e-9, 1e-4}) {
          CAPTURE(static_cast<int>(kind));
          CAPTURE(away);
          auto s = make_adjustment_scene(kind, 5, 2, 40, 3);
          adjustment_options options = long_run(damping);
          options.numbers = numbers;
          const auto without = adjust_scene(Policy{}, s, options);
          const vec3<double> centre = turbomap::camera_centre(turbomap::to_isometry<double>(s.poses[4]));
          s.points.push_back({centre.x + away / 3, centre.y, centre.z + away});
          for (const std::int32_t f : {3, 4}) {  // fixed ones
            s.frame.push_back(f), s.landmark.push_back(40), s.pixel.push_back({370, 250, -1});
            s.information.push_back(1), s.camera.push_back(0);
          }
          const auto free = adjust_scene(Policy{}, s, options);
          CHECK(free.summary.accepted > 0);
          const double its_own = free.summary.cost_initial - without.summary.cost_initial;
          CHECK(free.summary.cost_final < without.summary.cost_final + 1.01 * its_own);
          // Where it cannot leave, it takes no part at all.
          std::vector<std::uint8_t> fixed(41, 0);
          fixed[40] = 1;
          turbomap::context<Policy> ctx{Policy{}};
          turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
          problem.assign(ctx, s.frame_input(), {s.landmark_input().positions, {fixed.data(), 41}}, s.group());
          const auto summary = turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, options);
          CHECK(summary.undefined == 1);
          std::vector<rigid_transform<double>> poses;
          problem.frames(ctx, poses);
          CHECK(distance(adjusted{{}, poses, {}}, adjusted{{}, without.poses, {}}) <
                (numbers == precision::float64 ? 1e-6 : 1e-3));
        }
}

/// The distance of two frames: a norm, whose derivative at 0 is not a number in dual numbers.
struct range_factor {
  static constexpr int size = 1;
  struct row {};
  template <class S>
  TURBOMAP_HD bool residual(const rigid_transform<S>& a, const rigid_transform<S>& b, const row&, S* e) const {
    using turbomap::operator-;
    e[0] = turbomap::norm(turbomap::camera_centre(turbomap::to_isometry<S>(a)) -
                          turbomap::camera_centre(turbomap::to_isometry<S>(b)));
    return true;
  }
};
struct place_factor {
  static constexpr int size = 3;
  struct row {
    vec3<double> place;
  };
  template <class S>
  TURBOMAP_HD bool residual(const rigid_transform<S>& T, const row& r, S* e) const {
    const auto c = turbomap::camera_centre(turbomap::to_isometry<S>(T));
    e[0] = c.x - S(r.place.x), e[1] = c.y - S(r.place.y), e[2] = c.z - S(r.place.z);
    return true;
  }
};
/// A landmark's distance from a frame: the same.
struct depth_factor {
  static constexpr int size = 1;
  struct row {
    double distance;
  };
  template <class S>
  TURBOMAP_HD bool residual(const rigid_transform<S>& T, const vec3<S>& X, const row& r, S* e) const {
    using turbomap::operator-;
    e[0] = turbomap::norm(X - turbomap::camera_centre(turbomap::to_isometry<S>(T))) - S(r.distance);
    return true;
  }
};

TEST_CASE_TEMPLATE("a derivative that is not a number is left out", Policy, TURBOMAP_TEST_TWO_POLICIES) {
  std::vector<rigid_transform<double>> T(3);
  const std::vector<std::int32_t> a{0}, b{1}, all{0, 1, 2}, lone{2}, landmark{0};
  const std::vector<range_factor::row> ranges(1);
  const std::vector<place_factor::row> places{{{0, 0, 0}}, {{1, 0, 0}}, {{0, 2, 0}}};
  const std::vector<depth_factor::row> depths{{0.5}};
  const std::vector<vec3<double>> X(1);
  turbomap::context<Policy> ctx{Policy{}};
  turbomap::bundle_problem<Policy, pose_frame, turbomap::frame_pair_factors<range_factor>,
                           turbomap::frame_factors<place_factor>, turbomap::landmark_factors<depth_factor>>
      problem(ctx);
  problem.assign(ctx, {span<const rigid_transform<double>>(T), {}}, {span<const vec3<double>>(X), {}},
                 {{}, {a.data(), 1}, {b.data(), 1}, {ranges.data(), 1}, {}, 1e6},
                 {{}, {all.data(), 3}, {places.data(), 3}, {}, 1e6},
                 {{}, {lone.data(), 1}, {landmark.data(), 1}, {depths.data(), 1}, {}, 1e6});
  const auto summary = turbomap::adjust<float64_methods>(ctx, problem, long_run(damping_rule::diagonal));
  CHECK(summary.accepted > 0);
  CHECK(summary.cost_final == doctest::Approx(1.0 / 3).epsilon(1e-6));  // (x0, x1): x0^2 + (x1 - 1)^2 + (x1 - x0)^2
}

TEST_CASE("a stereo row in the plane z = 0 of a fisheye is not defined, and the others are") {
  auto s = make_adjustment_scene(scene_kind::fisheye_rig, 5, 2, 40, 3);
  s.rig[0].bf = 40;
  s.poses[4] = {};
  for (std::size_t i = 0; i < s.frame.size(); ++i)
    if (s.frame[i] == 4) s.information[i] = 0;
  const auto without = adjust_scene(sequential{}, s, long_run(damping_rule::diagonal));
  s.points.push_back({2, 0.5, 0});  // exactly in the plane of a fixed frame at the origin
  s.frame.push_back(4), s.landmark.push_back(40), s.pixel.push_back({600, 300, 400}), s.information.push_back(1);
  s.camera.push_back(0);
  const auto a = adjust_scene(sequential{}, s, long_run(damping_rule::diagonal));
  CHECK(a.summary.end != adjustment_end::not_finite);
  CHECK(a.summary.accepted > 0);
  CHECK(a.summary.undefined == 1);
  CHECK(distance(adjusted{{}, a.poses, {}}, adjusted{{}, without.poses, {}}) < 1e-6);
}

TEST_CASE("quaternions that are not of unit length are refused by name") {
  auto s = make_adjustment_scene(scene_kind::mono, 3, 1, 10, 3);
  for (const double scale : {2.0, 0.0, 0.99, 1e200}) {  // the last: a square that is no number
    auto bad = s;
    auto& T = bad.poses[1];
    T.qx *= scale, T.qy *= scale, T.qz *= scale, T.qw *= scale;
    CHECK_THROWS_WITH_AS(adjust_scene(sequential{}, bad, in_float64()), doctest::Contains("quaternion"),
                         std::invalid_argument);
  }
  auto overflowing = s;  // finite, each of them; their sum is not
  overflowing.poses[1].qx = overflowing.poses[1].qy = 1.5e308;
  CHECK_THROWS_WITH_AS(adjust_scene(sequential{}, overflowing, in_float64()), doctest::Contains("quaternion"),
                       std::invalid_argument);
  auto& T = s.poses[1];
  T.qx = static_cast<float>(T.qx), T.qy = static_cast<float>(T.qy), T.qz = static_cast<float>(T.qz);
  CHECK(adjust_scene(sequential{}, s, in_float64()).summary.accepted > 0);
}

TEST_CASE("indices are refused wherever they are outside, information where it is below 0, not for a sign alone") {
  const auto good = make_adjustment_scene(scene_kind::mono, 3, 1, 10, 3);
  constexpr int least = std::numeric_limits<int>::min(), most = std::numeric_limits<int>::max();
  for (const int index : {-1, 10, 11, least, least + 1, least + 9, most}) {
    CAPTURE(index);
    for (const std::size_t row : {std::size_t{0}, std::size_t{17}, good.landmark.size() - 1}) {
      auto bad = good;
      bad.landmark[row] = index;
      CHECK_THROWS_WITH_AS(adjust_scene(sequential{}, bad, in_float64()), doctest::Contains("landmark"),
                           std::invalid_argument);
    }
  }
  auto none = good;
  none.points.clear();
  CHECK_THROWS_WITH_AS(adjust_scene(sequential{}, none, in_float64()), doctest::Contains("landmark = "),
                       std::invalid_argument);
  auto s = good;
  s.information[4] = -0.0;  // off
  CHECK(adjust_scene(sequential{}, s, in_float64()).summary.accepted > 0);
  s.information[5] = -nan_value;
  CHECK(adjust_scene(sequential{}, s, in_float64()).summary.end == adjustment_end::not_finite);
  s.information[6] = -1e-300;
  CHECK_THROWS_WITH_AS(adjust_scene(sequential{}, s, in_float64()), doctest::Contains("information = -1"),
                       std::invalid_argument);
}

TEST_CASE(
    "which rows are stereo: by the list, else by a u_right that is a number, in a camera that has a right image") {
  auto s = make_adjustment_scene(scene_kind::stereo, 4, 1, 12, 2);
  s.rig.resize(1), s.rig.push_back(s.rig[0]), s.rig[1].bf = 0;
  const std::size_t n = s.frame.size();
  for (std::size_t i = 0; i < n; ++i) s.camera[i] = static_cast<std::uint8_t>(i % 3 == 0);
  constexpr double right[] = {250, 0, -1, nan_value, inf_value, -0.0, -inf_value};
  for (std::size_t i = 0; i < n; ++i) s.pixel[i].z = right[i % 7];
  using group_type = turbomap::reprojections<scene_camera>;
  using kept_type = turbomap::resident_group<group_type, pose_frame, turbomap::host_memory>;
  const auto kinds = [&](const group_type& g) {
    kept_type kept(std::pmr::get_default_resource(), std::pmr::get_default_resource());
    turbomap::structure_inputs inputs;
    kept.describe(g, inputs);
    return std::vector<int>(kept.kinds(), kept.kinds() + n);
  };
  std::vector<int> by_number, by_list, first_camera;
  std::vector<std::uint8_t> list;
  for (std::size_t i = 0; i < n; ++i) {
    const int c = s.camera[i];
    const bool is_number = right[i % 7] >= 0 && right[i % 7] < inf_value;
    list.push_back(static_cast<std::uint8_t>(i % 5 == 0 ? 7 : 0));
    by_number.push_back(2 * c + (is_number && c == 0 ? 1 : 0));
    by_list.push_back(2 * c + (i % 5 == 0 ? 1 : 0)), first_camera.push_back(is_number ? 1 : 0);
  }
  auto g = s.group();
  CHECK(kinds(g) == by_number);
  g.stereo = span<const std::uint8_t>(list);
  CHECK(kinds(g) == by_list);
  g.stereo = {}, g.camera = {};
  CHECK(kinds(g) == first_camera);
}

TEST_CASE("a translation of finite numbers whose sum overflows is finite") {
  auto s = make_adjustment_scene(scene_kind::mono, 3, 1, 10, 3);
  s.fixed.resize(s.poses.size() + 1, 1);
  s.poses.push_back(s.poses[0]);  // seen by nothing
  s.poses.back().tx = s.poses.back().ty = 1.5e308;
  CHECK(adjust_scene(sequential{}, s, in_float64()).summary.end != adjustment_end::not_finite);
}

TEST_CASE("pairs are counted before they are listed") {
  turbomap::adjustment_structure s;
  s.landmarks = 3;
  s.landmark_slot.assign(1, 0);
  for (int l = 1; l <= 3; ++l) s.landmark_slot.push_back(60000 * l);
  CHECK(turbomap::block_finder::count_pairs(s) == 3 * (std::int64_t{60000} * 59999 / 2));
  CHECK_THROWS_WITH_AS(turbomap::block_finder{}.find(s), doctest::Contains("pairs"), std::invalid_argument);

  const auto scene = make_adjustment_scene(scene_kind::stereo, 9, 2, 80, 3);
  adjustment_options options = in_float64();
  options.pair_limit = 10;
  CHECK(adjust_scene(sequential{}, scene, options).summary.each[0].linear_iterations > 0);
  options.pair_limit = -1;
  CHECK_THROWS_WITH_AS(adjust_scene(sequential{}, scene, options), doctest::Contains("options.pair_limit"),
                       std::invalid_argument);
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// One bad row, kernel or option costs that row, or is refused; it does not spoil the adjustment of all others. Under every host
// policy, where one computes; test_bad_rows.cu asks the same of a device.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory_resource>
#include <stdexcept>
#include <vector>

#include "bad_rows_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_end;
using turbomap::adjustment_options;
using turbomap::span;
using turbomap_test::sequential;
constexpr double inf_value = std::numeric_limits<double>::infinity();
constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

TEST_CASE_TEMPLATE("too much damping is no convergence", Policy, TURBOMAP_TEST_POLICIES) {
  check_too_much_damping(Policy{});
}
TEST_CASE_TEMPLATE("at the optimum an adjustment has converged, whatever the damping", Policy, TURBOMAP_TEST_POLICIES) {
  check_at_optimum(Policy{});
}
TEST_CASE_TEMPLATE("the default damping does not depend on the unit of length", Policy, TURBOMAP_TEST_POLICIES) {
  check_unit_of_length(Policy{});
}
TEST_CASE_TEMPLATE("under identity the first lambda scales with the information, also where an unknown is held", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_first_lambda(Policy{});
}
TEST_CASE_TEMPLATE("kernels that give no cost or weight are refused by name", Policy, TURBOMAP_TEST_POLICIES) {
  check_kernels_refused(Policy{});
}
TEST_CASE_TEMPLATE("a landmark at a camera, or next to it, leaves all others to be adjusted", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_landmark_at_camera(Policy{});
}
TEST_CASE_TEMPLATE("a derivative that is not a number is left out", Policy, TURBOMAP_TEST_POLICIES) {
  check_derivative_not_a_number(Policy{});
}
TEST_CASE_TEMPLATE("a camera whose derivative is not finite somewhere: one cost, with and without derivatives", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_derivative_of_camera(Policy{});
}
TEST_CASE_TEMPLATE("a stereo row in the plane z = 0 of a fisheye is not defined, and the others are", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_stereo_row_in_plane(Policy{});
}
TEST_CASE_TEMPLATE("quaternions that are not of unit length are refused by name", Policy, TURBOMAP_TEST_POLICIES) {
  check_quaternions(Policy{});
}
TEST_CASE_TEMPLATE(
    "indices are refused wherever they are outside, information where it is below 0, not for a sign alone", Policy,
    TURBOMAP_TEST_POLICIES) {
  check_indices_and_information(Policy{});
}
TEST_CASE_TEMPLATE("a translation of finite numbers whose sum overflows is finite", Policy, TURBOMAP_TEST_POLICIES) {
  check_overflowing_sum(Policy{});
}

TEST_CASE("thresholds that are not numbers are refused by name") {
  const auto s = make_adjustment_scene(scene_kind::stereo, 3, 1, 10, 3);
  for (const double bad : {-1.0, std::nan(""), HUGE_VAL}) {
    adjustment_options options = in_float64();
    options.min_predicted_decrease = bad;
    CHECK_THROWS_WITH_AS(adjust_scene(sequential{}, s, options), doctest::Contains("options.min_predicted_decrease"),
                         std::invalid_argument);
  }
  const auto refuse = [&](const char* name, auto set) {
    adjustment_options bad = in_float64();
    set(bad);
    CHECK_THROWS_WITH_AS(adjust_scene(sequential{}, s, bad), doctest::Contains(name), std::invalid_argument);
  };
  for (const double bad : {-1.0, nan_value, inf_value})
    refuse("options.min_relative_decrease", [&](auto& o) { o.min_relative_decrease = bad; });
  for (const double bad : {-1.0, nan_value, inf_value})
    refuse("options.initial_lambda", [&](auto& o) { o.initial_lambda = bad; });
  for (const double bad : {-1.0, nan_value}) refuse("options.sparse_fill", [&](auto& o) { o.sparse_fill = bad; });
  refuse("options.damping", [](auto& o) { o.damping = static_cast<turbomap::damping_rule>(7); });
  adjustment_options options = in_float64();
  options.time_budget_ms = std::nan("");
  CHECK_THROWS_WITH_AS(adjust_scene(sequential{}, s, options), doctest::Contains("options.time_budget_ms"),
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

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Bad rows, kernels and options on a device: what bad_rows_cases.hpp asks for.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include "bad_rows_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("too much damping is no convergence") { check_too_much_damping(stream{}.policy()); }
TEST_CASE("at the optimum an adjustment has converged, whatever the damping") { check_at_optimum(stream{}.policy()); }
TEST_CASE("the default damping does not depend on the unit of length") { check_unit_of_length(stream{}.policy()); }
TEST_CASE("under identity the first lambda scales with the information, also where an unknown is held") {
  check_first_lambda(stream{}.policy());
}
TEST_CASE("kernels that give no cost or weight are refused by name") { check_kernels_refused(stream{}.policy()); }
TEST_CASE("a landmark at a camera, or next to it, leaves all others to be adjusted") {
  check_landmark_at_camera(stream{}.policy());
}
TEST_CASE("a derivative that is not a number is left out") { check_derivative_not_a_number(stream{}.policy()); }
TEST_CASE("a camera whose derivative is not finite somewhere: one cost, with and without derivatives") {
  check_derivative_of_camera(stream{}.policy());
}
TEST_CASE("a stereo row in the plane z = 0 of a fisheye is not defined, and the others are") {
  check_stereo_row_in_plane(stream{}.policy());
}
TEST_CASE("quaternions that are not of unit length are refused by name") { check_quaternions(stream{}.policy()); }
TEST_CASE("indices are refused wherever they are outside, information where it is below 0, not for a sign alone") {
  check_indices_and_information(stream{}.policy());
}
TEST_CASE("a translation of finite numbers whose sum overflows is finite") { check_overflowing_sum(stream{}.policy()); }

}  // namespace

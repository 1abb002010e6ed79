// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The filters of correspondences on a device: as under thrust::seq to the last bit, and as the oracle says.

#include <thrust/system/cuda/execution_policy.h>

#include "filter_windows_cases.hpp"
#include "filters_cases.hpp"

namespace {

using namespace turbomap_test;
using cuda = std::decay_t<decltype(thrust::cuda::par)>;

TEST_CASE("pinhole matches") { check_all_filters<cuda>(pinhole_rig(50), crowded(10), permissive(), 5); }
TEST_CASE("fisheye matches") { check_all_filters<cuda>(fisheye_rig(), crowded(20), permissive(), 5); }
TEST_CASE("given matches of keypoints in different groups") { check_given_matches_of_other_groups<cuda>(); }
TEST_CASE("distances of floats") {
  auto options = permissive();
  options.max_distance = 1.5;
  check_all_filters<cuda, turbomap::real_descriptor<float, 64>>(pinhole_rig(), crowded(30), options, 5);
}
TEST_CASE("rotations: equal ones, the wrap at a full turn") { check_rotation_edges<cuda>(); }
TEST_CASE("claims: none, one, equal distances") { check_one_to_one_edges<cuda>(); }
TEST_CASE("nothing to filter") { check_empty_filters<cuda>(); }
TEST_CASE("options out of range, angles missing") { check_filter_options<cuda>(); }
TEST_CASE("no allocation in the steady state") {
  check_filter_allocations<cuda>(turbomap::default_resource(turbomap::device_memory{}));
}

}  // namespace

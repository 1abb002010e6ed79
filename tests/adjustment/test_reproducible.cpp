// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Digests of adjustments of inputs that every compiler makes alike: under every host policy they are the same, and, compiled with
/// TURBOMAP_REPRODUCIBLE and without contraction, from every compiler and on every processor: tests/same_bits.sh compares them.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "adjustment_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::precision;
using turbomap::reduced_solver;

/// Its numbers are multiples of 2^-20, and no camera or frame is turned.
adjustment_scene rounded(adjustment_scene s) {
  const auto round = [](double& x) { x = std::nearbyint(x * 1048576) / 1048576; };
  const auto round_point = [&](vec3<double>& p) { round(p.x), round(p.y), round(p.z); };
  const auto round_pose = [&](rigid_transform<double>& T) {
    round(T.tx), round(T.ty), round(T.tz);
    T.qx = T.qy = T.qz = 0, T.qw = 1;
  };
  for (auto& p : s.points) round_point(p);
  for (auto& p : s.pixel) round_point(p);
  for (auto& i : s.information) round(i);
  for (auto& T : s.poses) round_pose(T);
  for (auto& c : s.rig) round_pose(c.T_camera_body);
  return s;
}

template <class Policy>
std::uint64_t digest_of(const Policy& policy, const adjustment_scene& s, const turbomap::adjustment_options& options) {
  const adjusted a = adjust_scene(policy, s, options);
  CHECK(a.summary.accepted > 2);
  std::uint64_t digest = 14695981039346656037U;  // FNV-1a
  const auto add = [&digest](const auto& list) {
    const auto* const bytes = reinterpret_cast<const unsigned char*>(list.data());
    for (std::size_t i = 0; i < list.size() * sizeof list[0]; ++i) digest = (digest ^ bytes[i]) * 1099511628211U;
  };
  add(a.poses), add(a.points);
  return digest;
}

TEST_CASE("results, to be compared with those of other compilers and processors") {
  for (const auto& [kind, name] :
       {std::pair{scene_kind::stereo, "stereo"}, std::pair{scene_kind::fisheye_rig, "fisheye-rig"}}) {
    const auto s = rounded(make_adjustment_scene(kind, 12, 4, 300, 11));
    for (const auto numbers : {precision::float64, precision::mixed})
      for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg}) {
        auto options = in_float64();
        options.numbers = numbers, options.solver = solver, options.max_iterations = 6;
        const std::uint64_t digest = digest_of(sequential{}, s, options);
        std::printf("turbomap-reproducible %s-%d-%d %016llx\n", name, static_cast<int>(numbers),
                    static_cast<int>(solver), static_cast<unsigned long long>(digest));
        for_each_parallel_policy([&](auto policy) { CHECK(digest_of(policy, s, options) == digest); });
      }
  }
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Digests of whole maps, all that is computed of them included: the loop with its adjustment, then an adjustment of the whole map.
/// Under every host policy they are the same. tests/same_runs.sh compares them between processes.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>

#include "local_mapper_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;

template <class Policy, class Camera>
std::uint64_t digest_of_map(const Policy& policy, const mapping_case<Camera>& c, int keyframes) {
  using map_type = mapped_by<Camera>;
  const mapping_scene<Camera> scene(c.rig, c.recipe);
  mapping_run<map_type, Policy, turbomap::local_adjustment<map_type, Policy>> run(scene, c.options, {}, policy);
  run.steps(keyframes);
  turbomap::global_adjustment_options global;
  global.solve.max_iterations = 5;
  CHECK(run.mapper.adjust_globally(run.keyframes().back(), global).solve.accepted > 0);
  CHECK(run.quality().points > 100);
  std::uint64_t digest = 14695981039346656037U;  // FNV-1a
  for (const char byte : content(run.map)) digest = (digest ^ static_cast<unsigned char>(byte)) * 1099511628211U;
  return digest;
}

template <class Camera>
void print_digests(const char* scene, const mapping_case<Camera>& c, int keyframes) {
  const auto print = [&](const char* policy, std::uint64_t digest) {
    std::printf("turbomap-run %s-%s %016llx\n", scene, policy, static_cast<unsigned long long>(digest));
    return digest;
  };
  const std::uint64_t expected = print("seq", digest_of_map(sequential{}, c, keyframes));
#if defined(TURBOMAP_WITH_OPENMP)
  CHECK(print("omp", digest_of_map(omp_policy{}, c, keyframes)) == expected);
#endif
#if defined(TURBOMAP_WITH_TBB)
  CHECK(print("tbb", digest_of_map(tbb_policy{}, c, keyframes)) == expected);
#endif
  CHECK(expected != 0);
}

TEST_CASE("whole maps, to be compared with those of other processes") {
  const auto here = std::make_unique<int>();
  std::printf("turbomap-address %p\n", static_cast<void*>(here.get()));  // processes that compare have others
  mapping_recipe back = noisy(5);
  back.turn_back = 6;
  print_digests("stereo", stereo_case(back), 12);
  print_digests("fisheye-rig", rig_case(noisy(6)), 7);
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The host policies that this build tests: sequential always, OpenMP and TBB where cmake found them. A policy that is
/// not there is in no list, so nothing says that it passed.

#include <tuple>
#include <type_traits>

#include <thrust/execution_policy.h>
#if defined(TURBOMAP_WITH_OPENMP)
#include <thrust/system/omp/execution_policy.h>
#endif
#if defined(TURBOMAP_WITH_TBB)
#include <thrust/system/tbb/execution_policy.h>
#endif

namespace turbomap_test {

using sequential = std::decay_t<decltype(thrust::seq)>;

#if defined(TURBOMAP_WITH_OPENMP)
using omp_policy = std::decay_t<decltype(thrust::omp::par)>;
#endif
#if defined(TURBOMAP_WITH_TBB)
using tbb_policy = std::decay_t<decltype(thrust::tbb::par)>;
#endif

// TEST_CASE_TEMPLATE takes types, not a list of types: hence macros. The second is for tests whose templates are slow to
// compile.
#if defined(TURBOMAP_WITH_OPENMP) && defined(TURBOMAP_WITH_TBB)
using parallel_policies = std::tuple<omp_policy, tbb_policy>;
#define TURBOMAP_TEST_POLICIES turbomap_test::sequential, turbomap_test::omp_policy, turbomap_test::tbb_policy
#define TURBOMAP_TEST_TWO_POLICIES turbomap_test::sequential, turbomap_test::omp_policy
#elif defined(TURBOMAP_WITH_OPENMP)
using parallel_policies = std::tuple<omp_policy>;
#define TURBOMAP_TEST_POLICIES turbomap_test::sequential, turbomap_test::omp_policy
#define TURBOMAP_TEST_TWO_POLICIES TURBOMAP_TEST_POLICIES
#elif defined(TURBOMAP_WITH_TBB)
using parallel_policies = std::tuple<tbb_policy>;
#define TURBOMAP_TEST_POLICIES turbomap_test::sequential, turbomap_test::tbb_policy
#define TURBOMAP_TEST_TWO_POLICIES TURBOMAP_TEST_POLICIES
#else
using parallel_policies = std::tuple<>;
#define TURBOMAP_TEST_POLICIES turbomap_test::sequential
#define TURBOMAP_TEST_TWO_POLICIES TURBOMAP_TEST_POLICIES
#endif

/// A parallel policy, for tests of which one is enough; sequential where there is none.
using parallel = std::tuple_element_t<0, decltype(std::tuple_cat(parallel_policies{}, std::tuple<sequential>{}))>;

/// Calls `test` with each parallel policy.
template <class Test>
void for_each_parallel_policy(const Test& test) {
  std::apply([&](auto... policy) { (test(policy), ...); }, parallel_policies{});
}

}  // namespace turbomap_test

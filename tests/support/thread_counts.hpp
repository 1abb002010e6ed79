// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Other numbers of threads for the policies that share work among threads, also more than the machine has: results must not
/// depend on who computes what.

#include <cstddef>

#include "under_tsan.hpp"

#if defined(TURBOMAP_WITH_OPENMP)
#include <omp.h>
#endif
#if defined(TURBOMAP_WITH_TBB)
#include <tbb/global_control.h>
#include <tbb/task_arena.h>
#endif

namespace turbomap_test {

#if defined(TURBOMAP_WITH_OPENMP)
/// OpenMP has so many threads as long as this lives.
struct openmp_threads {
  int before = omp_get_max_threads();
  explicit openmp_threads(int threads) { omp_set_num_threads(threads); }
  openmp_threads(const openmp_threads&) = delete;
  openmp_threads& operator=(const openmp_threads&) = delete;
  ~openmp_threads() { omp_set_num_threads(before); }
};
#endif

/// Calls `test` with each number of threads; under the thread sanitizer with one.
template <class Test>
void for_each_thread_count(const Test& test) {
#if defined(TURBOMAP_TEST_UNDER_TSAN)
  test(1);
#else
  for (const int threads : {1, 2, 3, 7}) {
#if defined(TURBOMAP_WITH_OPENMP)
    const openmp_threads openmp(threads);
#endif
#if defined(TURBOMAP_WITH_TBB)
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    tbb::task_arena arena(threads);
    arena.execute([&] { test(threads); });
#else
    test(threads);
#endif
  }
#endif
}

}  // namespace turbomap_test

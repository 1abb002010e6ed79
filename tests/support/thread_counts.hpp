// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Other numbers of threads for the policies that share work among threads, also more than the machine has: results must not
/// depend on who computes what.

#include <cstddef>

#if defined(TURBOMAP_WITH_OPENMP)
#include <omp.h>
#endif
#if defined(TURBOMAP_WITH_TBB)
#include <tbb/global_control.h>
#endif

namespace turbomap_test {

/// Calls `test` with each number of threads. OpenMP has so many then; TBB at most, because it goes by the processor's.
template <class Test>
void for_each_thread_count(const Test& test) {
#if defined(TURBOMAP_WITH_OPENMP)
  const int before = omp_get_max_threads();
#endif
  for (const int threads : {1, 2, 3, 7}) {
#if defined(TURBOMAP_WITH_OPENMP)
    omp_set_num_threads(threads);
#endif
#if defined(TURBOMAP_WITH_TBB)
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
#endif
    test(threads);
  }
#if defined(TURBOMAP_WITH_OPENMP)
  omp_set_num_threads(before);
#endif
}

}  // namespace turbomap_test

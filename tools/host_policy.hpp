// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The execution policy of a program's option --policy: seq, omp or tbb, chosen when the program runs.

#include <stdexcept>
#include <string>

#include <thrust/execution_policy.h>
#include <thrust/for_each.h>
#include <thrust/system/cpp/execution_policy.h>
#if defined(TURBOMAP_WITH_OPENMP)
#include <thrust/system/omp/execution_policy.h>
#endif
#if defined(TURBOMAP_WITH_TBB)
#include <thrust/system/tbb/execution_policy.h>
#endif

namespace turbomap_program {

/// A host policy that hands each loop to the policy of that name, so that a program compiles the templates of all stages,
/// cameras and solvers once and not per policy. It costs one branch per loop.
class host_policy : public thrust::cpp::execution_policy<host_policy> {
 public:
  /// Throws std::invalid_argument where this program was built without the policy.
  explicit host_policy(const std::string& name) {
    if (name == "seq") return;
#if defined(TURBOMAP_WITH_OPENMP)
    if (name == "omp") {
      kind_ = kind::omp;
      return;
    }
#endif
#if defined(TURBOMAP_WITH_TBB)
    if (name == "tbb") {
      kind_ = kind::tbb;
      return;
    }
#endif
    throw std::invalid_argument("--policy " + name + ": this program was built without it");
  }

  /// What Thrust calls, found by argument-dependent lookup.
  template <class Iterator, class Size, class Function>
  friend Iterator for_each_n([[maybe_unused]] host_policy& policy, Iterator first, Size n, Function f) {
#if defined(TURBOMAP_WITH_OPENMP)
    if (policy.kind_ == kind::omp) return thrust::for_each_n(thrust::omp::par, first, n, f);
#endif
#if defined(TURBOMAP_WITH_TBB)
    if (policy.kind_ == kind::tbb) return thrust::for_each_n(thrust::tbb::par, first, n, f);
#endif
    return thrust::for_each_n(thrust::seq, first, n, f);
  }

 private:
  enum class kind { seq, omp, tbb };
  kind kind_ = kind::seq;
};

}  // namespace turbomap_program

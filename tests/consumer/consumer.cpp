// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A C++ user; where the compiler knows OpenMP, in parallel too.

#include "mapper.hpp"

#include <thrust/execution_policy.h>
#if defined(_OPENMP)
#include <thrust/system/omp/execution_policy.h>
#endif

template <class Policy>
my::plans map_under(const Policy& policy) {
  my::mapper<Policy> mapper(policy);
  for (const my::frame& f : my::make_frames()) mapper.insert(f);
  return mapper.map();
}

int main() {
  const my::plans plans = map_under(thrust::seq);
  bool ok = my::plausible(plans);
#if defined(_OPENMP)
  ok = ok && my::equal(plans, map_under(thrust::omp::par));
#endif
  return ok ? 0 : 1;
}

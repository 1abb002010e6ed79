// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-replay under the policy thrust::omp::par.

#include <thrust/system/omp/execution_policy.h>

#include "run.hpp"

namespace turbomap_replay {

outcome run_omp(const arguments& arguments) { return run(thrust::omp::par, arguments); }

}  // namespace turbomap_replay

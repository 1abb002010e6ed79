// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-bundle under the OpenMP policy.

#include <thrust/system/omp/execution_policy.h>

#include "run.hpp"

namespace turbomap_bundle {

outcome run_omp(const arguments& arguments) { return run(thrust::omp::par, arguments); }

}  // namespace turbomap_bundle

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-bundle under the TBB policy.

#include <thrust/system/tbb/execution_policy.h>

#include "run.hpp"

namespace turbomap_bundle {

outcome run_tbb(const arguments& arguments) { return run(thrust::tbb::par, arguments); }

}  // namespace turbomap_bundle

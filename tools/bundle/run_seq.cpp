// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-bundle under the sequential policy.

#include <thrust/execution_policy.h>

#include "run.hpp"

namespace turbomap_bundle {

outcome run_seq(const arguments& arguments) { return run(thrust::seq, arguments); }

}  // namespace turbomap_bundle

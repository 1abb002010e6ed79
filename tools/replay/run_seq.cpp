// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-replay under the policy thrust::seq.

#include <thrust/execution_policy.h>

#include "run.hpp"

namespace turbomap_replay {

outcome run_seq(const arguments& arguments) { return run(thrust::seq, arguments); }

}  // namespace turbomap_replay

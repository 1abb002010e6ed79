// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The adjustments of turbomap-bench under a host policy: a unit of its own, since the other stages take long enough to compile.

#include "run_adjustment.hpp"
#include "adjustment_stages.hpp"
#include "host_policy.hpp"

namespace turbomap_bench {

nlohmann::json run_adjustments_on_host(const turbomap::recording& recording, const arguments& a) {
  return run_adjustments(turbomap_program::host_policy(a.policy), recording, a);
}

}  // namespace turbomap_bench

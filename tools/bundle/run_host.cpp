// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-bundle under a host policy.

#include "host_policy.hpp"
#include "run.hpp"

namespace turbomap_bundle {

outcome run_host(const arguments& arguments) { return run(turbomap_program::host_policy(arguments.policy), arguments); }

}  // namespace turbomap_bundle

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Numbers that make a test longer than it is in CI.

#include <cstdlib>

namespace turbomap_test {

/// The number in an environment variable, or another one where it is not set.
inline double environment(const char* name, double otherwise) {
  const char* const given = std::getenv(name);
  return given == nullptr ? otherwise : std::atof(given);
}

}  // namespace turbomap_test

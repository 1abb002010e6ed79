// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The larger of two numbers, for tests that look for the largest error: one that is not a number must not be lost.

#include <turbomap/config.hpp>

namespace turbomap_test {

/// The larger one; NaN where one of them is.
TURBOMAP_HD inline double larger_or_nan(double a, double b) { return a != a || a > b ? a : b; }

}  // namespace turbomap_test

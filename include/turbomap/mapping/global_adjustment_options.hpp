// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Options of the stage that adjusts all of a map, as plain data.

#include "local_adjustment_options.hpp"

namespace turbomap {

/// Options of global_adjustment. Those that choose the window (shared points) have no effect.
struct global_adjustment_options : local_adjustment_options {
  global_adjustment_options() {
    solve.max_iterations = 50;  // drift of a whole round goes out slowly: far more than a local window needs. Ours
    solve.min_relative_decrease = 1e-6, solve.slow_iterations = 3;  // 1e-4 left a third of a bend. Ours
  }
};

}  // namespace turbomap

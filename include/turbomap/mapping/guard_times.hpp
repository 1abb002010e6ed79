// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// For how long the guard of the user's map was held, as plain data.

#include <cstddef>

namespace turbomap {

/// How often, in all and at most at once the guard of a map was held, in milliseconds.
struct guard_times {
  std::size_t count = 0;      ///< how often
  double total_ms = 0;        ///< in all
  double longest_ms = 0;      ///< at most at once
  std::size_t over_1_ms = 0;  ///< how often for more than a millisecond

  /// It was held once more.
  void add(double ms) {
    ++count;
    total_ms += ms;
    longest_ms = ms > longest_ms ? ms : longest_ms;
    over_1_ms += ms > 1 ? 1 : 0;
  }
};

}  // namespace turbomap

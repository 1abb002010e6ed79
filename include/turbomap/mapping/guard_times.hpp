// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// For how long the guard of the user's map was held, as plain data.

#include <cstddef>

namespace turbomap {

/// How many points a stage reads while it holds the guard once. Of a map whose points are seen by five to ten keyframes, one
/// core of 2025 reads so many in less than 0.5 ms.
constexpr int default_points_read_per_guard = 1024;

/// How often, in all and at most at once the guard of a map was held, in milliseconds.
struct guard_times {
  std::size_t count = 0;      ///< how often
  double total_ms = 0;        ///< in all
  double longest_ms = 0;      ///< at most at once
  std::size_t over_1_ms = 0;  ///< how often for more than a millisecond
  double commit_ms = 0;       ///< of total_ms: by creation and fusion, to apply what they found; 0 of others

  /// It was held once more. \param commits  to apply what creation or fusion found
  void add(double ms, bool commits = false) {
    ++count;
    total_ms += ms;
    commit_ms += commits ? ms : 0;
    longest_ms = ms > longest_ms ? ms : longest_ms;
    over_1_ms += ms > 1 ? 1 : 0;
  }
};

}  // namespace turbomap

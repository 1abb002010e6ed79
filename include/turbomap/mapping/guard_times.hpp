// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// For how long the guard of the user's map was held, as plain data.

#include <cstddef>
#include <cstdint>

namespace turbomap {

/// How many points a stage reads while it holds the guard once. Of a map whose points are seen by five to ten keyframes, one
/// core of 2025 reads so many in less than 0.5 ms.
constexpr int default_points_read_per_guard = 1024;

/// How often, in all and at most at once the guard of a map was held, in milliseconds, and how many of the times were how long.
struct guard_times {
  std::size_t count = 0;      ///< how often
  double total_ms = 0;        ///< in all
  double longest_ms = 0;      ///< at most at once
  std::size_t over_1_ms = 0;  ///< how often for more than a millisecond
  double commit_ms = 0;       ///< of total_ms: by creation and fusion, to apply what they found; 0 of others

  /// Times by length, so that quantiles need no memory that could run out under the guard: eight bins from each power of two to
  /// the next, from 2^-7 to 32 ms, one below and one for all that is longer.
  static constexpr int per_octave = 8;
  static constexpr int octaves = 12;                     ///< powers of two that have bins
  static constexpr int bins = 2 + per_octave * octaves;  ///< all of them
  std::uint32_t times[bins] = {};                        ///< how often, by bin

  /// It was held once more. \param commits  to apply what creation or fusion found
  void add(double ms, bool commits = false) {
    ++count;
    total_ms += ms;
    commit_ms += commits ? ms : 0;
    longest_ms = ms > longest_ms ? ms : longest_ms;
    over_1_ms += ms > 1 ? 1 : 0;
    ++times[bin_of(ms)];
  }
  /// It was held as often as the other says, too.
  guard_times& operator+=(const guard_times& other) {
    count += other.count;
    total_ms += other.total_ms;
    commit_ms += other.commit_ms;
    longest_ms = other.longest_ms > longest_ms ? other.longest_ms : longest_ms;
    over_1_ms += other.over_1_ms;
    for (int b = 0; b < bins; ++b) times[b] += other.times[b];
    return *this;
  }
  /// A length, ms, that element floor(q (count - 1)) of the sorted times does not exceed, and not above longest_ms: 0.99 the 99th
  /// percentile. Too large by an eighth at most, from 2^-7 ms to 32 ms. 0 of no times.
  double quantile(double q) const {
    if (count == 0) return 0;
    const auto element = static_cast<std::size_t>(q * static_cast<double>(count - 1));
    std::size_t below = 0;
    for (int b = 0; b + 1 < bins; ++b) {
      below += times[b];
      if (below > element) return end_of(b) < longest_ms ? end_of(b) : longest_ms;
    }
    return longest_ms;
  }

 private:
  static constexpr double shortest_ms = 1.0 / 128;

  static int bin_of(double ms) {
    if (!(ms >= shortest_ms)) return 0;
    if (ms >= end_of(bins - 2)) return bins - 1;
    int b = 1;
    double begin = shortest_ms;  // of the octave
    for (; ms >= 2 * begin; begin *= 2) b += per_octave;
    return b + static_cast<int>((ms / begin - 1) * per_octave);
  }
  /// No time of a bin is as long.
  static double end_of(int bin) {
    return shortest_ms * (1 << bin / per_octave) * (1 + static_cast<double>(bin % per_octave) / per_octave);
  }
};

}  // namespace turbomap

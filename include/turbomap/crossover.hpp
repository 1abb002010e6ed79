// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How large a piece of work must be to be faster on a device than on the host, as data that can be measured, kept in a file
/// (io/crossover_file.hpp) and given. A device needs 0.03 ms (search) to 0.5 ms (adjustment) for a call, however small; below
/// the crossover the host is done before.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace turbomap {

/// What is compared, and what its amount counts.
enum class work_kind : std::uint8_t {
  search,      ///< pairs: query keypoints times keypoints of all neighbours
  adjustment,  ///< observations (rows of all factors)
  motion_only  ///< observations of all frames
};
inline constexpr std::size_t work_kinds = 3;  ///< how many there are.

/// Where a piece of work runs.
enum class work_side : std::uint8_t { host, device };

/// From which amount on each kind of work runs on the device.
struct crossover {
  /// By work_kind; infinity: never on the device, 0: always.
  double least[work_kinds] = {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
                              std::numeric_limits<double>::infinity()};

  /// Where so much work of a kind is to run.
  work_side side(work_kind kind, double amount) const {
    return amount >= least[static_cast<std::size_t>(kind)] ? work_side::device : work_side::host;
  }
};

/// Finds crossovers from the times of calls: of each kind and size (by powers of two) a few on each side.
class crossover_measurement {
 public:
  /// Of each side and size; the fastest counts, so the first, which allocates, does not.
  static constexpr int samples = 4;

  /// Where the next call of this size is to run: until both sides have their samples, on the one that has fewer; then on the
  /// faster one. The host where they are equal.
  work_side next(work_kind kind, double amount) const {
    const size_class& s = sizes_[static_cast<std::size_t>(kind)][size_of(amount)];
    if (s.host.count < samples || s.device.count < samples)
      return s.device.count < s.host.count ? work_side::device : work_side::host;
    return s.device.seconds < s.host.seconds ? work_side::device : work_side::host;
  }
  /// What a call took; infinity: it failed. As the fastest counts, a failure does so only while all calls of its side and size
  /// fail.
  void record(work_kind kind, double amount, work_side where, double seconds) {
    size_class& s = sizes_[static_cast<std::size_t>(kind)][size_of(amount)];
    times& t = where == work_side::device ? s.device : s.host;
    ++t.count;
    if (seconds < t.seconds) t.seconds = seconds;
  }
  /// The least size from which on the device was faster in every size that both sides have been measured in.
  crossover result() const {
    crossover c;
    for (std::size_t k = 0; k < work_kinds; ++k)
      for (int i = sizes - 1; i >= 0; --i) {
        const size_class& s = sizes_[k][i];
        if (s.host.count == 0 || s.device.count == 0) continue;
        if (!(s.device.seconds < s.host.seconds)) break;
        c.least[k] = std::ldexp(1.0, i);
      }
    return c;
  }

 private:
  static constexpr int sizes = 48;
  struct times {
    double seconds = std::numeric_limits<double>::infinity();
    std::int64_t count = 0;
  };
  struct size_class {
    times host, device;
  };
  /// i of amounts in [2^i, 2^(i + 1)); 0 for less, and for what is no number.
  static int size_of(double amount) {
    if (!(amount >= 2)) return 0;
    const int i = std::ilogb(amount);
    return i < sizes ? i : sizes - 1;
  }

  size_class sizes_[work_kinds][sizes];
};

}  // namespace turbomap

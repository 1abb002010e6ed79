// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How large a piece of work must be to be faster on a device than on the host, as data that can be measured, kept in a file and
/// given. A device needs 0.03 ms (search) to 0.5 ms (adjustment) for a call, however small; below the crossover the host is done
/// before.

#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <system_error>

#include "error.hpp"

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

namespace plain_detail {

inline constexpr const char* work_names[work_kinds] = {"search", "adjustment", "motion_only"};
inline constexpr const char* crossover_title = "turbomap crossover 1";

/// "name number" and the end of the line or file. Whatever the locale.
inline bool parse_crossover_line(const char* line, const char* name, double& least) {
  const std::size_t length = std::strlen(name);
  if (std::strncmp(line, name, length) != 0 || line[length] != ' ') return false;
  const char* const number = line + length + 1;
  const char* const end = number + std::strcspn(number, "\n");
  const auto [rest, error] = std::from_chars(number, end, least);
  return error == std::errc() && rest == end && least >= 0;
}

}  // namespace plain_detail

/// Writes a text file of four lines, whatever the locale. Throws std::runtime_error where it cannot.
inline void write_crossover(const std::string& file, const crossover& c) {
  std::FILE* const out = std::fopen(file.c_str(), "w");
  bool good = out != nullptr && std::fprintf(out, "%s\n", plain_detail::crossover_title) > 0;
  for (std::size_t k = 0; good && k < work_kinds; ++k) {
    char number[32] = {};  // the shortest form that reads back as it is: 24 characters at most
    std::to_chars(number, number + sizeof number - 1, c.least[k]);
    good = std::fprintf(out, "%s %s\n", plain_detail::work_names[k], number) > 0;
  }
  if (out != nullptr) good = std::fclose(out) == 0 && good;
  if (!good) throw std::runtime_error("turbomap: " + file + ": cannot be written");
}

/// Reads what write_crossover() wrote. Throws bad_file where it is not there or holds anything else.
inline crossover read_crossover(const std::string& file) {
  std::FILE* const in = std::fopen(file.c_str(), "r");
  if (in == nullptr) throw bad_file("turbomap: " + file + ": cannot be read");
  char line[64];
  crossover c;
  bool good = std::fgets(line, sizeof line, in) != nullptr &&
              std::string(line) == std::string(plain_detail::crossover_title) + "\n";
  for (std::size_t k = 0; good && k < work_kinds; ++k)
    good = std::fgets(line, sizeof line, in) != nullptr &&
           plain_detail::parse_crossover_line(line, plain_detail::work_names[k], c.least[k]);
  good = good && std::fgets(line, sizeof line, in) == nullptr;
  std::fclose(in);
  if (!good) throw bad_file("turbomap: " + file + ": is not a file of crossovers");
  return c;
}

/// Finds crossovers from the times of calls: of each kind and size (by powers of two) a few on each side.
class crossover_measurement {
 public:
  /// Of each side and size; the fastest counts, so the first, which allocates, does not.
  static constexpr int samples = 4;

  /// Where the next call of this size is to run: until both sides have their samples, on the one that has fewer; then on the
  /// faster one. The host where they are equal.
  work_side next(work_kind kind, double amount) const {
    const size_class& s = of(kind, amount);
    if (s.host.count < samples || s.device.count < samples)
      return s.device.count < s.host.count ? work_side::device : work_side::host;
    return s.device.seconds < s.host.seconds ? work_side::device : work_side::host;
  }
  /// What a call took; infinity: it failed. As the fastest counts, a failure does so only while all calls of its side and size
  /// fail.
  void record(work_kind kind, double amount, work_side where, double seconds) {
    size_class& s = const_cast<size_class&>(of(kind, amount));
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
  /// Of amounts in [2^i, 2^(i + 1)).
  const size_class& of(work_kind kind, double amount) const {
    int i = 0;
    while (i + 1 < sizes && amount >= std::ldexp(1.0, i + 1)) ++i;
    return sizes_[static_cast<std::size_t>(kind)][i];
  }

  size_class sizes_[work_kinds][sizes];
};

}  // namespace turbomap

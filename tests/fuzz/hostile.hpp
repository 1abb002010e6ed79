// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the fuzz targets of algorithms share. The fuzzer's bytes are choices: which random problem, and which of its numbers
/// are replaced by hostile ones. An algorithm may refuse a problem by std::invalid_argument; otherwise it keeps its promises.

#include <cstddef>
#include <cstdint>
#include <exception>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>

#include <turbomap/types.hpp>

#include "fuzz.hpp"

namespace turbomap_fuzz {

/// The fuzzer's bytes, one decision after the other; zeros once they have ended.
class choices {
 public:
  choices(const std::uint8_t* data, std::size_t size) : data_(data), left_(size) {}

  bool empty() const { return left_ == 0; }
  unsigned byte() { return left_ == 0 ? 0 : (--left_, *data_++); }
  unsigned word() {
    const unsigned high = byte();
    return 256 * high + byte();
  }
  bool flag() { return byte() % 2 == 1; }
  std::size_t below(std::size_t n) { return n == 0 ? 0 : (n <= 256 ? byte() : word()) % n; }
  /// Ordinary in three of four cases, else at an end of what numbers can be.
  double number(double scale) {
    static constexpr double ends[] = {0,
                                      -0.0,
                                      1e-300,
                                      -1e-300,
                                      1e-40,
                                      1e-12,
                                      1e-6,
                                      -1e-6,
                                      1,
                                      -1,
                                      1e6,
                                      -1e6,
                                      1e12,
                                      1e18,
                                      -1e18,
                                      3e38,
                                      -3e38,
                                      1e150,
                                      -1e150,
                                      1e300,
                                      1e-5,
                                      -1e300,
                                      std::numeric_limits<double>::infinity(),
                                      std::numeric_limits<double>::quiet_NaN()};
    const unsigned kind = byte();
    if (kind % 4 == 3) return ends[kind / 4 % std::size(ends)];
    return scale * (static_cast<double>(word()) / 32768 - 1);
  }
  float single(double scale) {
    const double x = number(scale);
    if (x > 3.4e38) return std::numeric_limits<float>::infinity();
    if (x < -3.4e38) return -std::numeric_limits<float>::infinity();
    return static_cast<float>(x);
  }
  turbomap::vec3<double> vector(double scale) {
    const double x = number(scale), y = number(scale);
    return {x, y, number(scale)};
  }

 private:
  const std::uint8_t* data_;
  std::size_t left_;
};

/// Another pose: any translation; a rotation that may be none.
inline void spoil(turbomap::rigid_transform<double>& T, choices& c) {
  double* const all[] = {&T.tx, &T.ty, &T.tz, &T.qx, &T.qy, &T.qz, &T.qw};
  const std::size_t which = c.below(9);
  if (which < 7) {
    *all[which] = c.number(which < 3 ? 10 : 1);
  } else if (which == 7) {
    const auto t = c.vector(10);
    T.tx = t.x, T.ty = t.y, T.tz = t.z;
  } else {  // half a turn about an axis
    T.qx = T.qy = T.qz = T.qw = 0;
    *all[3 + c.below(3)] = 1;
  }
}

/// Calls work(); true: it returned. std::invalid_argument is an answer, any other exception a finding.
template <class Work>
bool allowed(Work work) {
  try {
    work();
    return true;
  } catch (const std::invalid_argument&) {
    return false;
  } catch (const std::exception& error) {
    fail(std::string("an algorithm threw ") + error.what());
  }
}

inline bool is_unit(const turbomap::rigid_transform<double>& T) { return is_pose(T, 1e-2); }

}  // namespace turbomap_fuzz

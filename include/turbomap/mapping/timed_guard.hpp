// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The user's guard of the map, and for how long we held it.

#include <chrono>
#include <cstddef>

#include "../config.hpp"
#include "../map/map_traits.hpp"

namespace turbomap {

/// How often, in all and at most at once the guard of a map was held, in milliseconds.
struct guard_times {
  std::size_t count = 0;
  double total_ms = 0;
  double longest_ms = 0;

  void add(double ms) {
    ++count;
    total_ms += ms;
    longest_ms = ms > longest_ms ? ms : longest_ms;
  }
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Holds map_guard(map) while it lives. Waiting for the guard does not count.
template <class Map>
class timed_guard {
 public:
  timed_guard(Map& map, guard_times& times) : guard_(map_guard(map)), times_(times), begin_(clock::now()) {}
  timed_guard(const timed_guard&) = delete;
  timed_guard& operator=(const timed_guard&) = delete;
  ~timed_guard() { times_.add(std::chrono::duration<double, std::milli>(clock::now() - begin_).count()); }

 private:
  using clock = std::chrono::steady_clock;
  decltype(map_guard(std::declval<Map&>())) guard_;
  guard_times& times_;
  clock::time_point begin_;
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Tells on stderr how far long work is: a bar where stderr is a terminal, elsewhere a plain line now and then.

#include <chrono>
#include <cstddef>
#include <cstdio>
#include <string>
#include <utility>

#include <unistd.h>

namespace turbomap_program {

/// One piece of work of `count` steps. The bar is wiped out at the end, so that what is printed later begins on a clean line.
class progress {
  using clock = std::chrono::steady_clock;

 public:
  progress(std::string what, std::size_t count, std::FILE* to = stderr)
      : what_(std::move(what)), count_(count), to_(to), terminal_(isatty(fileno(to)) != 0) {
    if (terminal_) draw();
  }
  ~progress() {
    if (terminal_) std::fprintf(to_, "\r\033[K"), std::fflush(to_);
  }
  progress(const progress&) = delete;
  progress& operator=(const progress&) = delete;

  /// One more step is done.
  void advance() {
    ++done_;
    const auto now = clock::now();
    if (now - told_ < (terminal_ ? between_bars : between_lines)) return;
    told_ = now;
    if (terminal_)
      draw();
    else
      std::fprintf(to_, "%s: %zu of %zu\n", what_.c_str(), done_, count_);
  }

 private:
  static constexpr clock::duration between_bars = std::chrono::milliseconds(50);
  static constexpr clock::duration between_lines = std::chrono::seconds(10);
  static constexpr std::size_t width = 40;  ///< characters of a full bar

  void draw() const {
    const std::size_t full = count_ == 0 ? width : width * done_ / count_;
    std::fprintf(to_, "\r%s [%s%s] %zu/%zu", what_.c_str(), std::string(full, '#').c_str(),
                 std::string(width - full, '.').c_str(), done_, count_);
    std::fflush(to_);
  }

  std::string what_;
  std::size_t count_, done_ = 0;
  std::FILE* to_;
  bool terminal_;
  clock::time_point told_ = clock::now();
};

}  // namespace turbomap_program

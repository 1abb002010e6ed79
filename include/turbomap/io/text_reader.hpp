// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Numbers of a text file, one after the other, in the C locale whatever the program's is. The file is read in one go.

#include <charconv>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <system_error>
#include <type_traits>

#include "../config.hpp"
#include "../error.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Takes numbers separated by white space, across lines; failures name file, line and reason.
class text_reader {
 public:
  explicit text_reader(const std::filesystem::path& file) : file_(file.string()) {
    std::error_code ignored;
    std::ifstream stream(file, std::ios::binary);
    if (!stream || std::filesystem::is_directory(file, ignored))
      throw bad_file("turbomap: " + file_ + ": cannot be opened");
    text_.assign(std::istreambuf_iterator<char>(stream), {});
  }

  /// The next number: an integer that T holds, or a finite floating-point one. `what` names it in the failure.
  template <class T>
  T take(const char* what) {
    skip_space(true);
    if (at_ == text_.size()) fail(std::string("the file ends before ") + what);
    const char *begin = text_.data() + at_, *end = text_.data() + word_end();
    if (*begin == '+') ++begin;
    T value{};
    const auto [rest, error] = std::from_chars(begin, end, value);
    bool good = error == std::errc() && rest == end;
    if constexpr (std::is_floating_point_v<T>) {
      if (error == std::errc::result_out_of_range && rest == end) good = subnormal(begin, end, value);
      good = good && std::isfinite(value);
    }
    if (!good) fail("'" + text_.substr(at_, word_end() - at_) + "' is no " + what);
    at_ = static_cast<std::size_t>(end - text_.data());
    return value;
  }
  /// Whether nothing but white space is left; on the line, or in the file.
  bool line_ends() {
    skip_space(false);
    return at_ == text_.size() || text_[at_] == '\n';
  }
  bool file_ends() {
    skip_space(true);
    return at_ == text_.size();
  }
  /// Characters that are left: no more than half as many numbers follow, so counts can be checked before they are
  /// trusted.
  std::size_t left() const { return text_.size() - at_; }

  [[noreturn]] void fail(const std::string& reason) const {
    throw bad_file("turbomap: " + file_ + ": line " + std::to_string(line_) + ": " + reason);
  }

 private:
  static bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }
  void skip_space(bool across_lines) {
    for (; at_ < text_.size() && is_space(text_[at_]); ++at_) {
      if (text_[at_] != '\n') continue;
      if (!across_lines) return;
      ++line_;
    }
  }
  std::size_t word_end() const {
    std::size_t end = at_;
    while (end < text_.size() && !is_space(text_[end])) ++end;
    return end;
  }
  /// from_chars refuses what is too small as it does what is too large; the former is as good as zero.
  template <class T>
  static bool subnormal(const char* begin, const char* end, T& value) {
    for (const char* c = begin; c != end; ++c)
      if ((*c == 'e' || *c == 'E') && c + 1 != end) return value = T(0), c[1] == '-';
    return false;
  }

  std::string file_, text_;
  std::size_t at_ = 0, line_ = 1;
};

}  // namespace detail

TURBOMAP_END_NAMESPACE

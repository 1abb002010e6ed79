// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What all readers of text share: a file read in one go, and one number. A number is written as in C, with a decimal
/// point, whatever the locale of the program is.

#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>
#include <type_traits>

#include "../config.hpp"
#include "../error.hpp"
#include "file_handle.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The bytes of a file or of anything that can be read to its end. Throws bad_file, also for a directory.
inline std::string read_text_file(const std::filesystem::path& file) {
  const file_handle stream(std::fopen(file.string().c_str(), "rb"));
  if (!stream) throw bad_file("turbomap: " + file.string() + ": cannot be opened");
  std::string text;
  char part[1 << 16];
  for (std::size_t got; (got = std::fread(part, 1, sizeof part, stream.get())) > 0;) text.append(part, got);
  // A directory can be opened, but not read.
  if (std::ferror(stream.get()) != 0) throw bad_file("turbomap: " + file.string() + ": cannot be opened or read");
  return text;
}

/// from_chars refuses what is too small as it does what is too large; the former is as good as zero. Whether a number that
/// it refused is the former: its first digit other than 0 stands behind the point, once the exponent has moved it.
inline bool is_too_small(const char* begin, const char* end) {
  std::ptrdiff_t places = 0;  // before the point from that digit on, or, negative, zeros between the point and it
  bool point = false, found = false;
  const char* c = begin;
  for (; c != end && *c != 'e' && *c != 'E'; ++c) {
    if (*c == '.') {
      point = true;
    } else if (*c != '-') {
      found = found || *c != '0';
      places += found && !point ? 1 : !found && point ? -1 : 0;
    }
  }
  int exponent = 0;
  if (c != end && ++c != end) {
    const bool negative = *c == '-';
    if (*c == '+') ++c;
    if (std::from_chars(c, end, exponent).ec == std::errc::result_out_of_range) return negative;
  }
  return places + exponent <= 0;
}

/// The number that fills [begin, end): an integer that T holds, or a finite floating-point one. False: it is none.
template <class T>
bool parse_number(const char* begin, const char* end, T& value) {
  if (begin != end && *begin == '+' && begin + 1 != end && begin[1] != '-') ++begin;  // from_chars does not know it
  const auto [rest, error] = std::from_chars(begin, end, value);
  if constexpr (std::is_floating_point_v<T>) {
    if (error == std::errc::result_out_of_range && rest == end && is_too_small(begin, end)) return value = T(0), true;
  }
  if (error != std::errc() || rest != end) return false;  // value is as it was, perhaps never set
  if constexpr (std::is_floating_point_v<T>) return std::isfinite(value);
  return true;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

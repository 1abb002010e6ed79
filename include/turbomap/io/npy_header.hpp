// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The header of a `.npy` file: a literal of three keys (descr, fortran_order, shape), parsed strictly. Also the one
/// function that refuses a file, so that every message has the same form.

#include <cstddef>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Throws bad_file "turbomap: FILE: array NAME: REASON".
[[noreturn]] inline void reject_array(const std::filesystem::path& file, const std::string& array,
                                      const std::string& reason) {
  throw bad_file("turbomap: " + file.string() + ": array " + array + ": " + reason);
}

struct npy_header {
  std::string descr;
  std::vector<std::size_t> shape;
};

inline constexpr std::size_t too_many_elements = std::numeric_limits<std::size_t>::max();

/// Product of the shape, or too_many_elements when that many elements have no size in bytes.
inline std::size_t element_count(const std::vector<std::size_t>& shape, std::size_t element_size) {
  std::size_t count = 1;
  for (const std::size_t extent : shape) {
    if (extent != 0 && count > too_many_elements / element_size / extent) return too_many_elements;
    count *= extent;
  }
  return count;
}

inline std::string shape_text(const std::vector<std::size_t>& shape) {
  std::string text = "(";
  for (std::size_t i = 0; i < shape.size(); ++i) text += (i ? ", " : "") + std::to_string(shape[i]);
  return text + (shape.size() == 1 ? ",)" : ")");
}

/// A cursor over the header's literal; every step either takes what it expects or refuses the file.
class npy_header_parser {
 public:
  npy_header_parser(const std::filesystem::path& file, const std::string& array, const std::string& text)
      : file_(file), array_(array), text_(text) {}

  npy_header parse() {
    npy_header header;
    bool descr = false, order = false, shape = false;
    take('{');
    while (!next_is('}')) {
      const std::string key = string();
      take(':');
      if (key == "descr" && !descr) {
        header.descr = string(), descr = true;
      } else if (key == "fortran_order" && !order) {
        if (word() != "False") fail("is in Fortran order");
        order = true;
      } else if (key == "shape" && !shape) {
        header.shape = tuple(), shape = true;
      } else {
        fail("has an unknown or repeated header key '" + key + "'");
      }
      if (!next_is('}')) take(',');
    }
    take('}');
    if (!descr || !order || !shape) fail("lacks one of descr, fortran_order, shape in its header");
    skip_spaces();
    if (at_ != text_.size()) fail("has text after its header");
    return header;
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const { reject_array(file_, array_, reason); }
  void skip_spaces() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) ++at_;
  }
  bool next_is(char c) {
    skip_spaces();
    return at_ < text_.size() && text_[at_] == c;
  }
  void take(char c) {
    if (!next_is(c)) fail(std::string("has a malformed header: '") + c + "' expected at byte " + std::to_string(at_));
    ++at_;
  }
  std::string string() {
    take('\'');
    const std::size_t end = text_.find('\'', at_);
    if (end == std::string::npos) fail("has a malformed header: a string does not end");
    std::string value = text_.substr(at_, end - at_);
    at_ = end + 1;
    return value;
  }
  std::string word() {
    skip_spaces();
    const std::size_t begin = at_;
    while (at_ < text_.size() && ((text_[at_] >= 'a' && text_[at_] <= 'z') || (text_[at_] >= 'A' && text_[at_] <= 'Z')))
      ++at_;
    return text_.substr(begin, at_ - begin);
  }
  std::vector<std::size_t> tuple() {
    std::vector<std::size_t> shape;
    take('(');
    while (!next_is(')')) {
      if (at_ >= text_.size() || text_[at_] < '0' || text_[at_] > '9') fail("has a malformed shape in its header");
      std::size_t value = 0;
      for (; at_ < text_.size() && text_[at_] >= '0' && text_[at_] <= '9'; ++at_) {
        if (value > (too_many_elements - 9) / 10) fail("has an extent in its header that is too large");
        value = 10 * value + static_cast<std::size_t>(text_[at_] - '0');
      }
      shape.push_back(value);
      if (!next_is(')')) take(',');
    }
    take(')');
    return shape;
  }

  const std::filesystem::path& file_;
  const std::string& array_;
  const std::string& text_;
  std::size_t at_ = 0;
};

inline npy_header parse_npy_header(const std::filesystem::path& file, const std::string& array,
                                   const std::string& text) {
  return npy_header_parser(file, array, text).parse();
}

/// Magic, version (1.0; 2.0 when the literal is too long for it) and the literal, padded so that the data begin at a
/// multiple of 64 bytes.
inline std::string npy_header_bytes(const std::string& descr, const std::vector<std::size_t>& shape) {
  std::string text = "{'descr': '" + descr + "', 'fortran_order': False, 'shape': " + shape_text(shape) + ", }";
  const bool is_long = text.size() + 64 > 0xFFFF;
  const std::size_t before = is_long ? 12 : 10;
  text.append((64 - (before + text.size() + 1) % 64) % 64, ' ');
  text += '\n';
  std::string bytes("\x93NUMPY", 6);
  bytes += static_cast<char>(is_long ? 2 : 1);
  bytes += '\0';
  for (std::size_t i = 8; i < before; ++i) bytes += static_cast<char>(text.size() >> 8 * (i - 8) & 0xFF);
  return bytes + text;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

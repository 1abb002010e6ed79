// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Numbers and words of a text file, one after the other.

#include <cstddef>
#include <filesystem>
#include <string>

#include "../config.hpp"
#include "../error.hpp"
#include "text_file.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Takes numbers and words separated by white space; failures name file, line and reason.
class text_reader {
 public:
  explicit text_reader(const std::filesystem::path& file) : file_(file.string()), text_(read_text_file(file)) {}

  /// The next number, on this line or a later one: an integer that T holds, or a finite floating-point one. `what` names
  /// it in the failure.
  template <class T>
  T take(const char* what) {
    skip_space(true);
    if (at_ == text_.size()) fail(std::string("the file ends before ") + what);
    return number<T>(what);
  }
  /// The next number, or word, of this line.
  template <class T>
  T take_on_line(const char* what) {
    if (line_ends()) fail(std::string("there is no ") + what);
    return number<T>(what);
  }
  std::string take_word(const char* what) {
    if (line_ends()) fail(std::string("there is no ") + what);
    return take_until(word_end());
  }
  /// What is left of the line, without white space at its ends.
  std::string take_rest(const char* what) {
    if (line_ends()) fail(std::string("there is no ") + what);
    std::size_t end = at_;
    for (std::size_t i = at_; i < text_.size() && text_[i] != '\n'; ++i)
      if (!is_space(text_[i])) end = i + 1;
    return take_until(end);
  }
  /// The first character of what is left of the line, '\n' when nothing is.
  char peek() { return line_ends() ? '\n' : text_[at_]; }
  /// Goes to the beginning of the next line, whatever is left of this one; false: there is none.
  bool next_line() {
    while (at_ < text_.size() && text_[at_] != '\n') ++at_;
    if (at_ < text_.size()) ++at_, ++line_;
    return at_ < text_.size();
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
  std::string take_until(std::size_t end) {
    std::string taken = text_.substr(at_, end - at_);
    at_ = end;
    return taken;
  }
  template <class T>
  T number(const char* what) {
    T value{};
    const std::size_t end = word_end();
    if (!parse_number(text_.data() + at_, text_.data() + end, value))
      fail("'" + text_.substr(at_, end - at_) + "' is no " + what);
    at_ = end;
    return value;
  }

  std::string file_, text_;
  std::size_t at_ = 0, line_ = 1;
};

}  // namespace detail

TURBOMAP_END_NAMESPACE

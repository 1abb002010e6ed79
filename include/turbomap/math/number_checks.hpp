// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What most numbers among the arguments must be, whatever they stand for, with the same messages everywhere; and what an
/// argument is called in messages.

#include <cstddef>
#include <string>

#include "../config.hpp"
#include "../error.hpp"
#include "functions.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// What an argument is called in messages: "query", or "neighbours[3]". Text is made only where something is wrong.
class argument_name {
 public:
  /// \param name  must outlive this: a literal
  argument_name(const char* name) : name_(name) {}
  /// Element `index` of an array. \param array  must outlive this: a literal
  argument_name(const char* array, std::size_t index) : name_(array), index_(index), is_element_(true) {}

  /// The name as it is printed.
  std::string text() const {
    std::string name = name_;
    if (is_element_) name.append("[").append(printed(index_)).append("]");
    return name;
  }
  /// The name of a member of it.
  std::string operator+(const char* member) const { return text().append(member); }

 private:
  const char* name_;
  std::size_t index_ = 0;
  bool is_element_ = false;
};

/// Throws std::invalid_argument when `value` is not finite and positive.
inline void check_positive(const char* name, double value) {
  require(value > 0 && detail::is_finite(value), name, value, "must be finite and positive");
}
/// Throws std::invalid_argument when `value` is not finite or negative.
inline void check_not_negative(const char* name, double value) {
  require(value >= 0 && detail::is_finite(value), name, value, "must be finite and not negative");
}
/// Throws std::invalid_argument when two errors cannot be so correlated.
inline void check_correlation(const char* name, double value) {
  require(value >= 0 && value < 1, name, value, "must be at least 0 and below 1");
}
/// Throws std::invalid_argument when a scale factor, or a factor of tolerance, is not finite or below 1.
inline void check_factor(const char* name, double value) {
  require(value >= 1 && detail::is_finite(value), name, value, "must be finite and at least 1");
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The exceptions of the library and the one precondition function. Nothing here prints or ends the program.

#include <cstddef>
#include <cstdio>
#include <new>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace turbomap {

/// A call of the CUDA run-time failed.
struct device_error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The memory resource of an execution policy has no room left. Whatever was being grown is as it was before the call.
class out_of_memory : public std::bad_alloc {
 public:
  out_of_memory(const char* where, std::size_t bytes)
      : what_(std::string("turbomap: out of ") + where + " memory: " + std::to_string(bytes) +
              " bytes were asked for") {}
  const char* what() const noexcept override { return what_.c_str(); }

 private:
  std::string what_;
};

/// A handle names a keyframe that has been erased, or never was in this store.
struct stale_handle : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

/// A file does not hold what it should: the message names file, array and reason.
struct bad_file : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// \name A value as messages print it
/// Real numbers with nine digits, which tell any two floats apart.
/// @{
inline std::string printed(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}
inline std::string printed(const char* value) { return value; }
inline std::string printed(const std::string& value) { return value; }
template <class Integer, class = std::enable_if_t<std::is_integral_v<Integer>>>
std::string printed(Integer value) {
  return std::to_string(value);
}
/// @}

/// Throws std::invalid_argument "turbomap: ARGUMENT = VALUE: RULE".
template <class Value>
[[noreturn]] void reject(const std::string& argument, const Value& value, const char* rule) {
  throw std::invalid_argument("turbomap: " + argument + " = " + printed(value) + ": " + rule);
}

/// The library's precondition: when `holds` is false, throws std::invalid_argument naming the argument, its value and the
/// rule it breaks, e.g. require(n > 0, "neighbours", n, "must not be empty").
template <class Value>
void require(bool holds, const char* argument, const Value& value, const char* rule) {
  if (!holds) reject(argument, value, rule);
}

}  // namespace turbomap

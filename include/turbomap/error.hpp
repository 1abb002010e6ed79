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
  /// \param where  which memory: a word of the message
  /// \param bytes  that were asked for
  out_of_memory(const char* where, std::size_t bytes) noexcept {
    std::snprintf(what_, sizeof what_, "turbomap: out of %s memory: %zu bytes were asked for", where, bytes);
  }
  /// The message.
  const char* what() const noexcept override { return what_; }

 private:
  char what_[96];
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
/// With nine digits.
inline std::string printed(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}
/// In decimals.
inline std::string printed(long long value) {
  char text[32];
  std::snprintf(text, sizeof text, "%lld", value);
  return text;
}
/// In decimals.
inline std::string printed(unsigned long long value) {
  char text[32];
  std::snprintf(text, sizeof text, "%llu", value);
  return text;
}
/// As it is.
inline std::string printed(const char* value) { return value; }
/// As it is.
inline std::string printed(const std::string& value) { return value; }
/// In decimals.
template <class Integer, class = std::enable_if_t<std::is_integral_v<Integer>>>
std::string printed(Integer value) {
  return printed(static_cast<std::conditional_t<std::is_signed_v<Integer>, long long, unsigned long long>>(value));
}
/// @}

/// Throws std::invalid_argument "turbomap: ARGUMENT = VALUE: RULE".
[[noreturn, gnu::cold]] inline void reject_printed(const char* argument, const std::string& value, const char* rule) {
  std::string text = "turbomap: ";
  text.append(argument).append(" = ").append(value).append(": ").append(rule);
  throw std::invalid_argument(text);
}
/// The same, of a value that is not printed yet.
template <class Value>
[[noreturn, gnu::cold]] void reject(const char* argument, const Value& value, const char* rule) {
  reject_printed(argument, printed(value), rule);
}
/// The same.
template <class Value>
[[noreturn, gnu::cold]] void reject(const std::string& argument, const Value& value, const char* rule) {
  reject(argument.c_str(), value, rule);
}

/// The library's precondition: when `holds` is false, throws std::invalid_argument naming the argument, its value and the
/// rule it breaks, e.g. require(n > 0, "neighbours", n, "must not be empty").
template <class Value>
void require(bool holds, const char* argument, const Value& value, const char* rule) {
  if (!holds) reject(argument, value, rule);
}

}  // namespace turbomap

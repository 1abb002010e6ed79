// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The exceptions of the library and the one precondition function. Nothing here prints or ends the program.

#include <cstddef>
#include <new>
#include <sstream>
#include <stdexcept>
#include <string>

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

/// Throws std::invalid_argument "turbomap: ARGUMENT = VALUE: RULE".
template <class Value>
[[noreturn]] void reject(const char* argument, const Value& value, const char* rule) {
  std::ostringstream text;
  text.precision(9);
  text << "turbomap: " << argument << " = " << value << ": " << rule;
  throw std::invalid_argument(text.str());
}

/// The library's precondition: when `holds` is false, throws std::invalid_argument naming the argument, its value and the
/// rule it breaks, e.g. require(n > 0, "neighbours", n, "must not be empty").
template <class Value>
void require(bool holds, const char* argument, const Value& value, const char* rule) {
  if (!holds) reject(argument, value, rule);
}

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How a program says what is wrong with its input.

#include <algorithm>
#include <cstdio>
#include <string>

namespace turbomap_program {

/// Prints one line on stderr, whatever the message was. \return the exit status, 2
inline int fail(const char* program, std::string message) {
  std::replace(message.begin(), message.end(), '\n', ' ');
  std::fprintf(stderr, "%s: %s\n", program, message.c_str());
  return 2;
}

}  // namespace turbomap_program

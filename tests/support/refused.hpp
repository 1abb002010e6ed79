// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The check that a reader names the array and the reason.

#include <string>

#include <doctest/doctest.h>

#include "files.hpp"

namespace turbomap_test {

/// The message names the array and says the reason.
inline void refused(const std::string& message, const std::string& array, const std::string& reason) {
  CAPTURE(message);
  CHECK(has(message, array + ".npy: array " + array + ": "));
  CHECK(has(message, reason));
}

}  // namespace turbomap_test

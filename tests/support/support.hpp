// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What tests share with tests/main.cpp: how a test case says that it could not run, and where recorded data are.

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

namespace turbomap_test {

/// Says that the running test case (or a part of it) cannot run here and why; the caller then returns from the case. The
/// reason is printed. A program all of whose test cases were skipped ends with status 77, which ctest reports as 'Skipped'.
/// Call it from the thread that runs the test case.
void skip(const std::string& reason);

/// The folder of recorded data: the environment variable TURBOMAP_DATA_DIR, or, where that is not set, nothing.
inline std::optional<std::filesystem::path> data_directory() {
  const char* value = std::getenv("TURBOMAP_DATA_DIR");
  if (value == nullptr || *value == '\0') return std::nullopt;
  return std::filesystem::path(value);
}

/// `relative` inside the folder of recorded data. Where it is not there, skips the running test case and returns nothing:
///     const auto path = turbomap_test::data("recordings/tum_room1_stereo");
///     if (!path) return;
inline std::optional<std::filesystem::path> data(const std::string& relative) {
  const auto directory = data_directory();
  if (!directory) {
    skip("TURBOMAP_DATA_DIR is not set; it should hold " + relative);
    return std::nullopt;
  }
  auto path = *directory / relative;
  if (!std::filesystem::exists(path)) {
    skip(path.string() + " is not there");
    return std::nullopt;
  }
  return path;
}

}  // namespace turbomap_test

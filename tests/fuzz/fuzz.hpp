// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the fuzz targets share. The target of a reader gives the fuzzer's bytes to it as files (targets of algorithms:
/// hostile.hpp). Allowed is that the reader throws bad_file, or that what it returns keeps the reader's promises; all else,
/// another exception too, ends the program, and libFuzzer keeps the input.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include <turbomap/error.hpp>
#include <turbomap/types.hpp>

#include "support/files.hpp"

namespace turbomap_fuzz {

using bytes = std::string_view;

[[noreturn]] inline void fail(const std::string& what) {
  std::fprintf(stderr, "turbomap-fuzz: %s\n", what.c_str());
  std::abort();
}
inline void expect(bool holds, const char* promise) {
  if (!holds) fail(std::string("broken promise: ") + promise);
}

/// This process's folder, in memory where the system has such a file system.
inline const std::filesystem::path& folder() {
  static const turbomap_test::temporary_directory made = [] {
    if (std::getenv("TMPDIR") == nullptr && std::filesystem::exists("/dev/shm")) setenv("TMPDIR", "/dev/shm", 0);
    return turbomap_test::temporary_directory();
  }();
  return made.path();
}
/// Writes a file there and returns where it is.
inline std::filesystem::path put(const std::string& name, bytes content) {
  const auto file = folder() / name;
  std::ofstream(file, std::ios::binary).write(content.data(), static_cast<std::streamsize>(content.size()));
  return file;
}
/// The parts of an input that stands for several files, separated by lines "==".
inline std::vector<bytes> parts(bytes input, std::size_t count) {
  std::vector<bytes> all;
  for (std::size_t at = 0; at != bytes::npos && all.size() + 1 < count;) {
    const std::size_t end = input.find("\n==\n", at);
    if (end == bytes::npos) break;
    all.push_back(input.substr(at, end + 1 - at));
    input.remove_prefix(end + 4), at = 0;
  }
  all.push_back(input);
  all.resize(count);
  return all;
}

/// Calls read(); true: it returned. bad_file is an answer, any other exception a finding.
template <class Read>
bool reads(Read read) {
  try {
    read();
    return true;
  } catch (const turbomap::bad_file&) {
    return false;
  } catch (const std::exception& error) {
    fail(std::string("a reader threw ") + error.what());
  }
}

inline bool finite(std::initializer_list<double> values) {
  for (const double x : values)
    if (!std::isfinite(x)) return false;
  return true;
}
template <class T>
bool is_pose(const turbomap::rigid_transform<T>& pose, double tolerance) {
  const double norm2 =
      double(pose.qx) * pose.qx + double(pose.qy) * pose.qy + double(pose.qz) * pose.qz + double(pose.qw) * pose.qw;
  return std::abs(norm2 - 1) < tolerance && finite({double(pose.tx), double(pose.ty), double(pose.tz)});
}

}  // namespace turbomap_fuzz

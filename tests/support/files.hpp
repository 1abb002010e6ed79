// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What tests of files share: a folder that goes away, bytes of a file to break, and the message of a bad_file.

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include <turbomap/error.hpp>

namespace turbomap_test {

/// A new empty folder, removed with everything in it at the end of the scope.
class temporary_directory {
 public:
  temporary_directory() {
    std::random_device random;
    const auto number = (std::uint64_t(random()) << 32) | random();
    path_ = std::filesystem::temp_directory_path() / ("turbomap_test_" + std::to_string(number));
    std::filesystem::create_directories(path_);
  }
  ~temporary_directory() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  temporary_directory(const temporary_directory&) = delete;
  temporary_directory& operator=(const temporary_directory&) = delete;
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

inline std::string file_bytes(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}
inline void write_bytes(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

/// The message of the bad_file that `call` throws; "nothing thrown" when it throws none.
template <class Call>
std::string bad_file_message(Call call) {
  try {
    call();
  } catch (const turbomap::bad_file& error) {
    return error.what();
  }
  return "nothing thrown";
}
inline bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace turbomap_test

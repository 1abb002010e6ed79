// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What tests of files share: a folder that goes away, bytes of a file to break, the message of a bad_file, a program
/// that writes numbers with a comma.

#include <clocale>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <locale>
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
/// As long as it lives, the program's locale has a decimal comma and thousands in groups, as many have: C++'s always, C's
/// where the machine has one of the usual names.
class comma_locale {
 public:
  comma_locale() : old_(std::locale::global(std::locale(std::locale::classic(), new facet))) {
    for (const char* name : {"de_DE.UTF-8", "fr_FR.UTF-8", "de_DE", "fr_FR"})
      if (std::setlocale(LC_NUMERIC, name) != nullptr) break;
  }
  ~comma_locale() {
    std::locale::global(old_);
    std::setlocale(LC_NUMERIC, "C");
  }
  comma_locale(const comma_locale&) = delete;
  comma_locale& operator=(const comma_locale&) = delete;

 private:
  struct facet : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };
  std::locale old_;
};

inline bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Open files that close themselves, and files that are replaced whole: what is written lies beside the file until it
/// is complete, and is then renamed. So a full disk or a killed process leaves the file that was there.

#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>

#include "../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

struct close_file {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using file_handle = std::unique_ptr<std::FILE, close_file>;

/// A file that takes the place of `file` in finish(), in one step (a rename, which POSIX makes atomic); until then it is
/// FILE.part. Without finish() nothing has happened. What is no plain file (a pipe, a device) is written directly.
/// Nothing is forced onto the disk: what a power failure leaves is the file system's affair.
class file_replacement {
 public:
  explicit file_replacement(const std::filesystem::path& file) : target_(file), part_(file) {
    std::error_code failed;
    const auto status = std::filesystem::status(file, failed);  // of what a symbolic link points at
    beside_ = status.type() == std::filesystem::file_type::not_found || std::filesystem::is_regular_file(status);
    if (beside_) {
      while (std::filesystem::is_symlink(target_, failed)) {  // links stay, also to a file that is not there yet
        const auto linked = std::filesystem::read_symlink(target_, failed);
        if (failed) break;
        target_ = target_.parent_path() / linked;
      }
      part_ = target_;
      part_ += ".part";
    }
    file_.reset(std::fopen(part_.string().c_str(), "wb"));
  }
  ~file_replacement() {
    if (file_) abandon();
  }
  file_replacement(const file_replacement&) = delete;
  file_replacement& operator=(const file_replacement&) = delete;

  bool is_open() const { return file_ != nullptr; }
  void write(const void* bytes, std::size_t size) {
    if (size != 0) good_ = good_ && std::fwrite(bytes, 1, size, file_.get()) == size;
  }
  /// Closes the file and puts it in its place; false: it could not be written, and the old one is there.
  [[nodiscard]] bool finish() {
    good_ = std::fclose(file_.release()) == 0 && good_;  // a full disk may show only here
    if (!beside_) return good_;
    std::error_code failed;
    if (good_) std::filesystem::rename(part_, target_, failed);
    if (good_ && !failed) return true;
    abandon();
    return false;
  }

 private:
  void abandon() {
    file_.reset();
    std::error_code ignored;
    if (beside_) std::filesystem::remove(part_, ignored);
  }

  std::filesystem::path target_, part_;
  file_handle file_;
  bool beside_ = true, good_ = true;
};

/// Replaces a text file; false: it could not be written.
inline bool replace_text_file(const std::filesystem::path& file, const std::string& text) {
  file_replacement out(file);
  if (!out.is_open()) return false;
  out.write(text.data(), text.size());
  return out.finish();
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

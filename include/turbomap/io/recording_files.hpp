// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How the files of a recording are replaced all at once, although they are many. The new files are written to
/// DIRECTORY/incoming.part. Renaming that to DIRECTORY/incoming is the one step that makes the new recording valid; POSIX
/// makes it atomic. Afterwards the files are moved to DIRECTORY one by one. Whatever happens before that step leaves the
/// old recording; after it, readers take what is in `incoming` from there and the rest from DIRECTORY, so that they find
/// the new one however far the moves came. The next writer finishes them. An empty file in `incoming` stands for an array
/// that the new recording does not have.
///
/// Holds for a full disk and a killed process, with one writer at a time. Nothing is forced onto the disk: what a power
/// failure leaves is the file system's affair.

#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "file_handle.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Where a file of the recording in `directory` lies; empty: the recording does not have it.
inline std::filesystem::path recording_file(const std::filesystem::path& directory, const std::string& name) {
  std::error_code failed;
  const auto incoming = directory / "incoming" / name;
  const auto size = std::filesystem::file_size(incoming, failed);
  if (failed) return directory / name;
  return size == 0 ? std::filesystem::path() : incoming;
}

/// The files of a recording that is being written; without commit() the directory stays as it was.
class incoming_recording {
 public:
  /// Makes the directory and finishes what a writer that was interrupted left.
  explicit incoming_recording(const std::filesystem::path& directory) : directory_(directory) {
    std::error_code failed;
    is_new_ = std::filesystem::create_directories(directory, failed);
    if (failed) fail("cannot be made: " + failed.message());
    move_files();
    std::filesystem::remove_all(part(), failed);
    std::filesystem::create_directory(part(), failed);
    if (failed) fail("cannot be written to: " + failed.message());
  }
  ~incoming_recording() {
    std::error_code ignored;
    if (!committed_) std::filesystem::remove_all(part(), ignored);
    if (!committed_ && is_new_) std::filesystem::remove(directory_, ignored);  // when nothing else is in it
  }
  incoming_recording(const incoming_recording&) = delete;
  incoming_recording& operator=(const incoming_recording&) = delete;

  /// Where to write the file of this name.
  std::filesystem::path file(const std::string& name) const { return part() / name; }
  /// The recording does not have the file of this name.
  void leave_out(const std::string& name) const {
    const file_handle empty(std::fopen(file(name).string().c_str(), "wb"));
    if (!empty) fail("cannot be written to");
  }
  /// What has been written is the recording.
  void commit() {
    std::error_code failed;
    std::filesystem::rename(part(), directory_ / "incoming", failed);
    if (failed) fail("the new recording cannot be put in its place: " + failed.message());
    committed_ = true;
    move_files();
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const {
    throw bad_file("turbomap: " + directory_.string() + ": " + reason);
  }
  std::filesystem::path part() const { return directory_ / "incoming.part"; }

  /// From `incoming` to the directory. It can be interrupted anywhere and done again.
  void move_files() const {
    std::error_code failed;
    const auto incoming = directory_ / "incoming";
    if (!std::filesystem::exists(incoming, failed)) return;
    std::vector<std::filesystem::path> files;
    for (std::filesystem::directory_iterator i(incoming, failed), end; !failed && i != end; i.increment(failed))
      files.push_back(i->path());
    for (const auto& from : files) {
      if (failed) break;
      const auto to = directory_ / from.filename();
      if (std::filesystem::file_size(from, failed) != 0 && !failed) {
        std::filesystem::rename(from, to, failed);
      } else if (!failed) {
        std::filesystem::remove(to, failed);
        if (!failed) std::filesystem::remove(from, failed);
      }
    }
    if (!failed) std::filesystem::remove(incoming, failed);
    if (failed) fail("the files of 'incoming' cannot be moved here: " + failed.message());
  }

  std::filesystem::path directory_;
  bool is_new_ = false, committed_ = false;
};

}  // namespace detail

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Shrinks a recording while a command fails on it in the same way: runs the command on recordings of ever fewer keyframes.

#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <numeric>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include <sys/wait.h>

#include <turbomap/io/recording_writer.hpp>

#include "keep_keyframes.hpp"
#include "minimise.hpp"

namespace turbomap_reduce {

/// The path as one word of a shell command.
inline std::string quoted(const std::filesystem::path& path) {
  std::string text = "'";
  for (const char c : path.string()) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

/// The exit status of a shell command, in which each `{}` stands for the recording; 128 and its number for a signal.
inline int status_of(const std::string& command, const std::filesystem::path& recording) {
  std::string text;
  for (std::size_t at = 0; at < command.size();) {
    const bool here = command.compare(at, 2, "{}") == 0;
    text += here ? quoted(recording) : std::string(1, command[at]);
    at += here ? 2 : 1;
  }
  const int result = std::system(text.c_str());
  if (result == -1) throw std::runtime_error("no shell could be started");
  return WIFEXITED(result) ? WEXITSTATUS(result) : 128 + WTERMSIG(result);
}

/// Throws std::invalid_argument where a folder holds what no recording written by this program does: it will be removed.
inline void require_replaceable(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder)) return;
  if (!std::filesystem::is_directory(folder))
    throw std::invalid_argument(folder.string() + " is there, and is no folder");
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const auto file = entry.path();
    if (!entry.is_regular_file() || (file.filename() != "meta.json" && file.extension() != ".npy"))
      throw std::invalid_argument(file.string() + " is there, and would be removed");
  }
}

/// The directory without a slash at the end, and the one beside it that a command runs on.
struct places {
  explicit places(const std::filesystem::path& named)
      : out(named.has_filename() ? named : named.parent_path()), candidate(out.string() + ".candidate") {}

  std::filesystem::path out, candidate;
};

/// Throws std::invalid_argument where no directory is named, or the recording would be removed: it is one of the two that are written.
inline void require_elsewhere(const std::filesystem::path& recording, const std::filesystem::path& named) {
  if (named.empty()) throw std::invalid_argument("--out: names no directory");
  const places written(named);
  std::error_code not_there;
  for (const auto& folder : {written.out, written.candidate})
    if (std::filesystem::equivalent(recording, folder, not_there))
      throw std::invalid_argument("--out: " + folder.string() + " is the recording itself");
}

struct reduction {
  std::vector<std::size_t> kept;  ///< keyframes of the recording that was given
  int status = 0;                 ///< with which the command ends on them
  std::size_t runs = 0;           ///< of the command
};

/// Writes to the directory `named` the recording of the fewest keyframes found on which the command ends with `status`
/// (negative: with what it ends with on the whole). The directory holds the smallest so far at any time, also of a reduction that
/// is interrupted; beside it NAMED.candidate is written and removed. `tell(reduction)` is called whenever it became smaller.
/// Throws std::invalid_argument when the command does not fail on the whole, or where something else is in one of the two, and
/// std::runtime_error when the command is interrupted (SIGINT, SIGQUIT; unless that is the status): while it runs, its caller is not.
template <class Tell>
reduction reduce(const turbomap::recording& whole, const std::string& command, const std::filesystem::path& named,
                 int status, Tell tell) {
  const places written(named);
  const auto &out = written.out, &candidate = written.candidate;
  require_replaceable(out), require_replaceable(candidate);
  reduction found;
  const auto run = [&](const std::vector<std::size_t>& kept) {
    std::filesystem::remove_all(candidate);
    turbomap::write_recording(candidate, keep_keyframes(whole, kept));
    ++found.runs;
    const int ended = status_of(command, candidate);
    if ((ended == 128 + SIGINT || ended == 128 + SIGQUIT) && ended != status) {
      std::filesystem::remove_all(candidate);
      throw std::runtime_error("the command was interrupted");
    }
    return ended;
  };
  const auto take = [&](const std::vector<std::size_t>& kept) {
    std::filesystem::remove_all(out);
    std::filesystem::rename(candidate, out);
    found.kept = kept;
    tell(found);
  };
  std::vector<std::size_t> all(whole.keyframe_count());
  std::iota(all.begin(), all.end(), std::size_t{0});
  found.status = run(all);
  if (found.status == 0 || (status >= 0 && found.status != status)) {
    std::filesystem::remove_all(candidate);
    throw std::invalid_argument("the command ends with status " + std::to_string(found.status) +
                                " on the whole recording: there is nothing to keep");
  }
  take(all);
  minimise(all.size(), [&](const std::vector<std::size_t>& kept) {
    const bool fails = run(kept) == found.status;
    if (fails) take(kept);
    return fails;
  });
  std::filesystem::remove_all(candidate);
  return found;
}

}  // namespace turbomap_reduce

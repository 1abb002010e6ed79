// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reading a recording of local mapping: a directory with meta.json and one `.npy` file per array.

#include <cstddef>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "npy.hpp"
#include "recording_arrays.hpp"
#include "recording_data.hpp"
#include "recording_files.hpp"
#include "recording_meta.hpp"
#include "recording_validate.hpp"
#include "timing_table.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Reads and validates a whole recording, without its snapshots (read_snapshot) and times (read_timing). Throws
/// bad_file naming file, array and reason. One read per file; about a tenth of a second for 60 MB.
inline recording read_recording(const std::filesystem::path& directory) {
  std::error_code failed;
  if (!std::filesystem::is_directory(directory, failed))
    throw bad_file("turbomap: " + directory.string() + ": is not a directory with a recording");
  recording r;
  r.meta = read_recording_meta(detail::recording_file(directory, "meta.json"));
  visit_arrays(r, [&](const char* name, auto& rows, recording_rows, presence must) {
    const auto file = detail::recording_file(directory, std::string(name) + ".npy");
    std::error_code ignored;
    if (must == presence::optional && (file.empty() || !std::filesystem::exists(file, ignored))) return;
    using row = typename std::remove_reference_t<decltype(rows)>::value_type;
    rows = read_npy_rows<row>(file);
  });
  validate(r, directory);
  return r;
}

/// Where the snapshot of an iteration lies: `snap_` and the iteration in four digits.
inline std::filesystem::path snapshot_directory(const std::filesystem::path& directory, std::int32_t iteration) {
  const std::string number = std::to_string(iteration);
  return directory / ("snap_" + std::string(number.size() < 4 ? 4 - number.size() : 0, '0') + number);
}

/// The recorded system's own times: from the quiet run when there was one, else from the recording one; an empty table
/// when there is neither. Throws bad_file for a malformed one, and for one without the columns that timing_table::steady()
/// chooses rows by.
inline timing_table read_timing(const std::filesystem::path& directory) {
  std::error_code ignored;
  for (const char* name : {"timing_quiet.csv", "timing.csv"})
    if (std::filesystem::exists(directory / name, ignored)) {
      timing_table table = read_timing_table(directory / name);
      for (const char* column : {"iter", "snapshot"})
        if (!table.has(column))
          throw bad_file("turbomap: " + (directory / name).string() + ": line 1: has no column '" + column + "'");
      return table;
    }
  return {};
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The table of times that a recorded system measured, one row per iteration of local mapping (timing.csv).

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "text_file.hpp"

namespace turbomap {

/// Named columns of numbers. Times are milliseconds.
struct timing_table {
  std::vector<std::string> names;            ///< names of the columns, as the header line has them
  std::vector<std::vector<double>> columns;  ///< columns[c][row]

  /// Whether there is no column.
  bool empty() const { return names.empty(); }
  /// Number of rows; all columns have as many.
  std::size_t row_count() const { return columns.empty() ? 0 : columns.front().size(); }
  /// Whether there is a column of this name. Linear in the number of columns.
  bool has(const std::string& name) const { return std::find(names.begin(), names.end(), name) != names.end(); }
  /// The column of this name; throws std::invalid_argument when there is none.
  const std::vector<double>& column(const std::string& name) const {
    const auto found = std::find(names.begin(), names.end(), name);
    require(found != names.end(), "timing column", name, "must be a column of the table");
    return columns[static_cast<std::size_t>(found - names.begin())];
  }
  /// The rows that statistics are made of: iter > 10 (the map is small before) and snapshot = 0 (recording overhead).
  std::vector<double> steady(const std::string& name) const {
    const auto &values = column(name), &iteration = column("iter"), &snapshot = column("snapshot");
    std::vector<double> kept;
    for (std::size_t i = 0; i < values.size(); ++i)
      if (iteration[i] > 10 && snapshot[i] == 0) kept.push_back(values[i]);
    return kept;
  }
  /// Mean of steady(name); NaN when no row counts.
  double mean(const std::string& name) const {
    const auto kept = steady(name);
    double sum = 0;
    for (const double value : kept) sum += value;
    return sum / static_cast<double>(kept.size());
  }
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Reads a table of numbers with one header line, separated by commas. Throws bad_file naming file, line and reason.
/// Linear in the size of the file.
inline timing_table read_timing_table(const std::filesystem::path& file) {
  const std::string text = detail::read_text_file(file);
  const auto fail = [&](std::size_t line, const std::string& reason) {
    throw bad_file("turbomap: " + file.string() + ": line " + std::to_string(line) + ": " + reason);
  };
  timing_table table;
  std::size_t line = 0;
  for (std::size_t at = 0; at < text.size();) {
    std::size_t end = std::min(text.find('\n', at), text.size());
    const std::size_t next = end + 1;
    if (end > at && text[end - 1] == '\r') --end;
    ++line;
    std::size_t column = 0;
    for (std::size_t cell = at; cell <= end; ++column) {
      std::size_t stop = cell;  // not text.find(), which looks beyond the line
      while (stop != end && text[stop] != ',') ++stop;
      if (line == 1) {
        table.names.push_back(text.substr(cell, stop - cell));
        table.columns.emplace_back();
      } else {
        double value = 0;
        if (column >= table.columns.size()) fail(line, "has more cells than the header");
        if (!detail::parse_number(text.data() + cell, text.data() + stop, value))
          fail(line, "'" + text.substr(cell, stop - cell) + "' is not a number");
        table.columns[column].push_back(value);
      }
      cell = stop + 1;
    }
    if (column != table.columns.size()) fail(line, "has fewer cells than the header");
    if (line == 1) {
      std::vector<std::string> sorted = table.names;
      std::sort(sorted.begin(), sorted.end());
      const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
      if (twice != sorted.end()) fail(line, "has two columns '" + *twice + "'");
    }
    at = next;
  }
  if (table.empty()) fail(1, "the table has no header");
  return table;
}

TURBOMAP_END_NAMESPACE

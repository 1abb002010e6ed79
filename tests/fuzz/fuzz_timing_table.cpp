// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Tables of times.

#include <set>

#include <turbomap/io/timing_table.hpp>

#include "fuzz.hpp"

using namespace turbomap_fuzz;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = put("t.csv", {reinterpret_cast<const char*>(data), size});
  turbomap::timing_table table;
  if (!reads([&] { table = turbomap::read_timing_table(file); })) return 0;
  expect(!table.empty() && table.names.size() == table.columns.size(), "every column has a name");
  expect(std::set<std::string>(table.names.begin(), table.names.end()).size() == table.names.size(), "names differ");
  for (const auto& column : table.columns) {
    expect(column.size() == table.row_count(), "columns are equally long");
    for (const double x : column) expect(finite({x}), "cells are finite");
  }
  if (table.has("iter") && table.has("snapshot"))
    for (const auto& name : table.names) table.mean(name);
  return 0;
}

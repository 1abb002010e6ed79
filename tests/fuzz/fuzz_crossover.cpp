// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Files of crossovers. What is read can be written, and read again to the bit.

#include <cstring>

#include <turbomap/io/crossover_file.hpp>

#include "fuzz.hpp"

using namespace turbomap_fuzz;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = put("c.txt", {reinterpret_cast<const char*>(data), size});
  turbomap::crossover c;
  if (!reads([&] { c = turbomap::read_crossover(file); })) return 0;
  for (const double least : c.least) expect(least >= 0, "amounts are numbers and not negative");
  turbomap::write_crossover(folder() / "w.txt", c);
  turbomap::crossover again;
  expect(reads([&] { again = turbomap::read_crossover(folder() / "w.txt"); }), "what was read can be written and read");
  expect(std::memcmp(again.least, c.least, sizeof c.least) == 0, "amounts are read back to the bit");
  return 0;
}

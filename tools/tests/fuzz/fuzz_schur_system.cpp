// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Recorded Schur systems: nine text files.

#include "readers/schur_system.hpp"

#include "fuzz/fuzz.hpp"

using namespace turbomap_fuzz;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto part = parts({reinterpret_cast<const char*>(data), size}, 9);
  const char* const names[] = {"hpp", "hpl", "hll", "hschur", "bp", "bl", "bschur", "xp", "xl"};
  for (std::size_t i = 0; i < 9; ++i) put(names[i] + std::string(".txt"), part[i]);
  turbomap::schur_system s;
  if (!reads([&] { s = turbomap::read_schur_system(folder()); })) return 0;
  expect(s.bp.size() == static_cast<std::size_t>(s.hpp.rows()) && s.xl.size() == s.bl.size(), "vectors fit");
  for (const auto* m : {&s.hpp, &s.hpl, &s.hll, &s.hschur})
    if (std::int64_t{m->rows()} * m->columns() < 1000000)
      for (const double x : m->dense(m != &s.hpl)) expect(finite({x}), "values are finite");
  return 0;
}

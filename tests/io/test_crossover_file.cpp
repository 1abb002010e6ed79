// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The file of crossovers between host and device: what is written reads back, and nothing else is taken for one.

#include <turbomap/io/crossover_file.hpp>

#include <limits>
#include <stdexcept>
#include <string>

#include <doctest/doctest.h>

#include "support/files.hpp"

namespace {

TEST_CASE("the file of crossovers") {
  const turbomap_test::temporary_directory folder;
  const std::string file = (folder.path() / "crossover.txt").string();
  turbomap::crossover c;
  c.least[0] = 0, c.least[1] = 4096.5;
  turbomap::write_crossover(file, c);
  const turbomap::crossover read = turbomap::read_crossover(file);
  for (std::size_t k = 0; k < turbomap::work_kinds; ++k) CHECK(read.least[k] == c.least[k]);

  {
    const turbomap_test::comma_locale commas;
    CHECK(turbomap::read_crossover(file).least[1] == 4096.5);
    turbomap::write_crossover(file, c);
  }
  CHECK(turbomap::read_crossover(file).least[1] == 4096.5);
  c.least[0] = 0x1.fffffffffffffp1023, c.least[1] = 0x1p-1074, c.least[2] = 1 / 3.0;
  turbomap::write_crossover(file, c);
  for (std::size_t k = 0; k < turbomap::work_kinds; ++k) CHECK(turbomap::read_crossover(file).least[k] == c.least[k]);

  for (const double amount : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    turbomap::crossover unreadable = c;
    unreadable.least[1] = amount;
    CHECK_THROWS_AS(turbomap::write_crossover(file, unreadable), std::invalid_argument);
    CHECK(turbomap::read_crossover(file).least[1] == c.least[1]);
  }

  CHECK_THROWS_AS(turbomap::read_crossover(file + ".not_there"), turbomap::bad_file);
  CHECK_THROWS_AS(turbomap::write_crossover((folder.path() / "no" / "folder").string(), c), std::runtime_error);
  for (const std::string& text :
       {std::string("turbomap crossover 1\r\nsearch 1 \r\nadjustment +2\r\nmotion_only\tinf\r\n"),
        std::string("turbomap crossover 1\nsearch 1\nadjustment 2\nmotion_only inf \n\n")}) {
    CAPTURE(text);
    turbomap_test::write_bytes(file, text);
    const turbomap::crossover lenient = turbomap::read_crossover(file);
    CHECK(lenient.least[0] == 1);
    CHECK(lenient.least[1] == 2);
    CHECK(lenient.least[2] == std::numeric_limits<double>::infinity());
  }

  const std::string title = "turbomap crossover 1\n", rest = "adjustment 2\nmotion_only 3\n";
  for (const std::string& text :
       {std::string(), title, "turbomap crossover 2\nsearch 1\n" + rest, title + "search -1\n" + rest,
        title + "search nan\n" + rest, title + "search\n" + rest, title + "search 1 1\n" + rest,
        title + "search 1,5\n" + rest, title + "search\n1\n" + rest, title + "search inf inf\n" + rest, title + rest,
        title + "search 1\n" + rest + "more 1\n", std::string(1000, 'x')}) {
    CAPTURE(text);
    turbomap_test::write_bytes(file, text);
    CHECK_THROWS_AS(turbomap::read_crossover(file), turbomap::bad_file);
  }
}

}  // namespace

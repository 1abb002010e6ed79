// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Crossovers between host and device in a text file: a title, then a line "name number" for each kind of work. Numbers
/// are written and read whatever the locale, and read back to the bit.

#include <charconv>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <string>

#include "../config.hpp"
#include "../crossover.hpp"
#include "../math/number_checks.hpp"
#include "text_file.hpp"
#include "text_reader.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

inline constexpr const char* work_names[work_kinds] = {"search", "adjustment", "motion_only"};
inline constexpr const char* crossover_title = "turbomap crossover 1";

}  // namespace detail

/// Writes a text file of four lines.
/// \throws std::invalid_argument  an amount that is negative or NaN, which read_crossover() would refuse
/// \throws std::runtime_error     it cannot be written; one that was there stays
inline void write_crossover(const std::filesystem::path& file, const crossover& c) {
  std::string text = detail::crossover_title;
  for (std::size_t k = 0; k < work_kinds; ++k) {
    if (!(c.least[k] >= 0)) reject(argument_name("c.least", k).text(), c.least[k], "must be an amount, 0 or above");
    char number[32] = {};  // the shortest form that reads back as it is: 24 characters at most
    std::to_chars(number, number + sizeof number - 1, c.least[k]);
    text.append("\n").append(detail::work_names[k]).append(" ").append(number);
  }
  if (!detail::replace_text_file(file, text.append("\n")))
    throw std::runtime_error("turbomap: " + file.string() + ": cannot be written");
}

/// Reads what write_crossover() wrote, also with other line ends and blanks.
/// \throws bad_file  it is not there or holds anything else
inline crossover read_crossover(const std::filesystem::path& file) {
  detail::text_reader in(file);
  if (in.take_rest("title") != detail::crossover_title) in.fail("this is not a file of crossovers");
  crossover c;
  for (std::size_t k = 0; k < work_kinds; ++k) {
    in.next_line();
    if (in.take_word("kind of work") != detail::work_names[k])
      in.fail(std::string("expected is ") + detail::work_names[k]);
    const std::string number = in.take_rest("amount");
    double& least = c.least[k];
    if (number == "inf")
      least = std::numeric_limits<double>::infinity();
    else if (!detail::parse_number(number.data(), number.data() + number.size(), least) || !(least >= 0))
      in.fail("'" + number + "' is no amount");
  }
  if (!in.file_ends()) in.fail("the file goes on after the last kind of work");
  return c;
}

TURBOMAP_END_NAMESPACE

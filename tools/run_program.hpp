// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How every program reads its command line, and says what is wrong with its input.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>

namespace turbomap_program {

/// \name What the value of an option must be
/// For numbers without an upper end, of which CLI11's own say that 0 is not in range 0.000000 to a number of 309 digits.
/// @{
inline CLI::Validator above(bool (*is_above)(double), const char* rule, const char* name) {
  const auto fault = [is_above, rule](const std::string& value) {
    char* end = nullptr;
    const double number = std::strtod(value.c_str(), &end);
    return end != value.c_str() && *end == '\0' && is_above(number) ? std::string() : value + rule;
  };
  return {fault, name};
}
inline CLI::Validator positive() {
  return above([](double number) { return number > 0; }, " is not a positive number", "POSITIVE");
}
inline CLI::Validator not_negative() {
  return above([](double number) { return number >= 0; }, " is not a number from 0 on", "FROM 0");
}
/// @}

/// Throws for an option whose value is nan or inf: ranges let nan pass.
inline void require_finite_options(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_type_name().find("FLOAT") == std::string::npos) continue;  // a name may be "nan"
    for (const std::string& value : option->results()) {
      char* end = nullptr;
      const double number = std::strtod(value.c_str(), &end);
      if (end != value.c_str() && *end == '\0' && !std::isfinite(number))
        throw std::invalid_argument(option->get_name() + ": " + value + " is not a finite number");
    }
  }
}

/// Parses the command line, and calls run(), which returns the exit status. What is thrown becomes one line on stderr, whatever
/// the message was.
/// \param app  named as the program is
/// \return the exit status: 2 where something was thrown, 0 after --help
template <class Run>
int run_program(CLI::App& app, int argc, char** argv, Run run) {
  std::string message;
  try {
    app.parse(argc, argv);
    require_finite_options(app);
    return run();
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help
    message = error.what();
  } catch (const std::exception& error) {
    message = error.what();
  }
  std::replace(message.begin(), message.end(), '\n', ' ');
  std::fprintf(stderr, "%s: %s\n", app.get_name().c_str(), message.c_str());
  return 2;
}

}  // namespace turbomap_program

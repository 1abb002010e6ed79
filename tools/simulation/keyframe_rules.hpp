// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// When a keyframe is due, as options of a command line: the same for a simulated and for an extracted recording.

#include <CLI/CLI.hpp>

#include "motion.hpp"

namespace turbomap::simulation {

inline void add_keyframe_rules(CLI::App& app, motion_options& motion) {
  app.add_option("--keyframe-seconds", motion.keyframe_seconds, "A keyframe is due after so long")
      ->check(CLI::Range(1e-3, 1e9))
      ->capture_default_str();
  app.add_option("--keyframe-metres", motion.keyframe_metres, "... or so far")
      ->check(CLI::Range(1e-3, 1e9))
      ->capture_default_str();
  app.add_option("--keyframe-radians", motion.keyframe_radians, "... or such a turn")
      ->check(CLI::Range(1e-3, 1e9))
      ->capture_default_str();
}

}  // namespace turbomap::simulation

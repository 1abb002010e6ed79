// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-reduce: shrinks a recording to the few keyframes that a failure needs.

#include <cstdio>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>

#include <turbomap/io/recording.hpp>

#include "reduce/reduce.hpp"
#include "run_program.hpp"

int main(int argc, char** argv) {
  std::string recording, out, command;
  int status = -1;
  CLI::App app("Shrinks a recording to the few keyframes with which a command still fails.", "turbomap-reduce");
  app.footer(
      "Examples:\n"
      "  turbomap-reduce RECORDING --out SMALL --command 'turbomap-replay {}'    the map is faulty in the end (status "
      "1)\n"
      "  turbomap-reduce RECORDING --out SMALL --command 'timeout 60 my_slam {}' --status 139    a crash (128 + signal "
      "11)");
  app.add_option("RECORDING", recording, "Directory of the recording")->required();
  app.add_option("--out", out, "Directory of the smaller one; one that is there is replaced if it holds nothing else")
      ->required();
  app.add_option("--command", command, "Shell command that fails; {} stands for the recording")->required();
  app.add_option("--status", status, "Exit status of the failure (not given: the command's on the whole recording)")
      ->check(CLI::Range(1, 255));
  return turbomap_program::run_program(app, argc, argv, [&] {
    if (command.find("{}") == std::string::npos) throw std::invalid_argument("--command: has no {} for the recording");
    turbomap_reduce::require_elsewhere(recording, out);

    const turbomap::recording whole = turbomap::read_recording(recording);
    const auto tell = [&](const turbomap_reduce::reduction& so_far) {
      std::fprintf(stderr, "turbomap-reduce: %zu of %zu keyframes fail, after %zu runs\n", so_far.kept.size(),
                   whole.keyframe_count(), so_far.runs);
    };
    const auto found = turbomap_reduce::reduce(whole, command, out, status, tell);
    std::printf("%s: %zu of %zu keyframes, status %d, %zu runs of the command; kept:", out.c_str(), found.kept.size(),
                whole.keyframe_count(), found.status, found.runs);
    for (const std::size_t k : found.kept) std::printf(" %zu", k);
    std::printf("\n");
    return 0;
  });
}

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-replay: replays a recording of local mapping, or checks every stage against it. See docs/programs.md.

#include <cstdio>
#include <stdexcept>
#include <string>
#include <system_error>

#include <CLI/CLI.hpp>

#include "replay/arguments.hpp"
#include "replay/many_mappers.hpp"
#include "replay/options.hpp"
#include "replay/print_outcome.hpp"
#include "run_program.hpp"
#include "write_json.hpp"

namespace {

using turbomap_replay::arguments;
using turbomap_replay::outcome;

outcome run(const arguments& a) {
#if defined(TURBOMAP_PROGRAM_WITH_CUDA)
  if (a.policy == "cuda") return turbomap_replay::run_cuda(a);
#endif
  return turbomap_replay::run_host(a);
}

/// Throws where an output has no folder, before the replay instead of after it.
void require_folders(const arguments& a) {
  for (const auto* output : {&a.json, &a.report, &a.ply, &a.trajectory, &a.growth_file})
    if (output->has_parent_path() && !std::filesystem::is_directory(output->parent_path()))
      throw std::invalid_argument(output->string() + ": its folder does not exist");
}

/// The same replay under more policies; prints the times of all and adds the others' to the JSON. What the first replay found
/// out from observations is not found out again: it costs a replay, and another policy might differ.
void run_beside(arguments a, outcome& result) {
  std::vector<nlohmann::json> replays{result.json};
  a.quiet = true;
  a.trajectory.clear(), a.ply.clear(), a.report.clear();
  using turbomap_replay::choice;
  if (result.json.contains("keypoint_offset"))
    a.pixel_centres = result.json["pixel_centres"].get<bool>() ? choice::yes : choice::no;
  for (const std::string& policy : a.beside) {
    a.policy = policy;
    const outcome other = run(a);
    replays.push_back(other.json);
    nlohmann::json figures;
    for (const char* key : {"policy", "map_points", "keyframes_left", "map_digest", "stages"})
      figures[key] = other.json[key];
    result.json["beside"].push_back(figures);
    result.good = result.good && other.good;
  }
  turbomap_replay::print_beside(replays);
}

/// The recording that is made at build time, beside the program.
std::filesystem::path demo_recording(const char* program) {
  std::error_code failed;
  const auto self = std::filesystem::canonical("/proc/self/exe", failed);
  return (failed ? std::filesystem::path(program) : self).parent_path().parent_path() / "demo" / "recording";
}

}  // namespace

int main(int argc, char** argv) {
  turbomap_replay::command_line line;
  CLI::App app("Replays a recording of local mapping through the stages of TurboMap, or checks every stage against it.",
               "turbomap-replay");
  app.footer(
      "Examples:\n"
      "  turbomap-replay                                   the built-in recording, times of every stage\n"
      "  turbomap-replay RECORDING --beside all            under every policy of this processor\n"
      "  turbomap-replay RECORDING --report map.html       map, times and errors as a page\n"
      "  turbomap-replay RECORDING --ply map.ply           the map for MeshLab, CloudCompare, rerun\n"
      "  turbomap-replay RECORDING --check                 every stage against what was recorded");
  add_options(app, line);
  return turbomap_program::run_program(app, argc, argv, [&] {
    settle(app, line);
    arguments& a = line.a;
    if (a.recording.empty()) a.recording = demo_recording(argv[0]);
    require_folders(a);
    outcome result = line.mappers > 1 ? turbomap_replay::replay_side_by_side(a, line.mappers, run) : run(a);
    if (a.check)
      std::printf("%s\n%s\n", result.json.dump(2).c_str(), result.good ? "check: all agree" : "check: FAILED");
    if (!a.beside.empty()) run_beside(a, result);
    turbomap_program::write_json(a.json, result.json);
    return result.good ? 0 : 1;
  });
}

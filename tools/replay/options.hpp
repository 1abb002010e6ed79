// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The options of turbomap-replay, and what follows from those that are given together.

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "../run_program.hpp"
#include "arguments.hpp"

namespace turbomap_replay {

/// The command line as it is written. settle() makes the arguments of it that options do not set by themselves.
struct command_line {
  arguments a;
  std::size_t mappers = 1;
  std::vector<std::string> beside;
  std::string stages, map = "simple", preset = "default", global, associate = "recorded";
  std::string points = "exact", fused = "exact";
  bool uses_imu = false, centres = false;
};

/// What is replayed, and where.
inline void add_input_options(CLI::App& app, command_line& line) {
  arguments& a = line.a;
  app.add_option("recording", a.recording, "folder of the recording; the built-in simulated one when not given");
  app.add_option("--policy", a.policy, "execution policy")->check(CLI::IsMember({"seq", "omp", "tbb", "cuda"}));
  app.add_option("--beside", line.beside,
                 "replay under these policies too (separated by commas; all: those of this processor), and print the "
                 "times side by side")
      ->delimiter(',')
      ->check(CLI::IsMember({"seq", "omp", "tbb", "cuda", "all"}));
  app.add_option("--mappers", line.mappers,
                 "so many replays at a time, each on a thread of its own: how many keyframes they map together")
      ->check(CLI::Range(1, 1000));
  app.add_option("--map", line.map,
                 "how the map is stored: flat arrays, or objects with locks and getters that copy, as in the field "
                 "(host policies, replay mode)")
      ->check(CLI::IsMember({"simple", "objects"}));
  app.add_flag("--imu,!--no-imu", line.uses_imu,
               "use the IMU, initialised from its samples, or leave it out; when not given, recordings "
               "with an IMU use it (replay mode)");
  app.add_option("--imu-noise", a.imu_noise,
                 "noise densities of the IMU, times those of the recording; above 1 where it vibrates")
      ->check(CLI::Range(1e-3, 1e3));
  app.add_flag("--pixel-centres,!--no-pixel-centres", line.centres,
               "move recorded keypoints of coarser levels to where they are in the full image, or not; when not "
               "given, the recording says so or its observations tell (replay mode)");
  app.add_option("--right-distortion", a.right_distortion,
                 "distortion of the right fisheye camera instead of the recorded one: k1,k2,k3,k4 (replay mode)")
      ->delimiter(',')
      ->expected(4);
}

/// Which stages run, and what search, creation, fusion and adjustment do for one keyframe.
inline void add_stage_options(CLI::App& app, command_line& line) {
  arguments& a = line.a;
  app.add_flag("--check", a.check, "compare every stage with the recorded snapshots; exit status 1 when one differs");
  app.add_option("--stages", line.stages,
                 "stages to run, separated by commas: "
                 "point_culling,search,creation,fusion,map_update,adjustment,preintegration,culling");
  app.add_option("--creation", a.rule, "what points are made from (replay mode)")
      ->check(CLI::IsMember({"tracks", "pairs"}));
  app.add_option("--known-octaves", a.known_octaves,
                 "a keypoint that sees a point is beside a track's where their octaves differ by so many at most")
      ->check(turbomap_program::not_negative());
  app.add_option("--fewest-keyframes", a.fewest_keyframes, "keyframes that must see a new point of a track (1)")
      ->check(turbomap_program::positive());
  app.add_option("--lookalike-ratio", a.lookalike_ratio,
                 "of descriptor distances, for points that only two cameras of one keyframe see (0.8); 0: nobody asks")
      ->check(CLI::Range(0.0, 1.0));
  app.add_flag("--across-rig,!--no-across-rig", a.across_rig,
               "match the cameras of a keyframe with each other too, or not, for --creation tracks (replay mode)");
  app.add_option("--candidates", a.candidates, "what the search compares with (replay mode)")
      ->check(CLI::IsMember({"exhaustive", "ordered", "grouped"}));
  app.add_flag("--serial-fusion", a.serial_fusion, "fuse camera by camera, each search after the commit before it");
  app.add_option(
         "--second-shared", a.second_shared,
         "adjust keyframes too that share so many points with one that shares enough with the current one; 0: none")
      ->check(turbomap_program::not_negative());
}

/// What is wrong with the value of --global-adjustment; empty: nothing. 0.5 and 1e3 are numbers, but not of keyframes.
inline std::string end_or_count(const std::string& text) {
  int count = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), count);
  const bool whole = failed == std::errc() && end == text.data() + text.size();
  return text == "end" || (whole && count > 0) ? "" : "'" + text + "' is neither 'end' nor a whole number above 0";
}

/// What is done beyond the neighbours of a keyframe, and what is taken out.
inline void add_map_options(CLI::App& app, command_line& line) {
  arguments& a = line.a;
  app.add_option("--preset", line.preset,
                 "balanced: options for a trajectory near the bound; accurate: the most exact ones; both with --points "
                 "uncertain, and unless others are given --global-adjustment end and --global-rounds 3 (replay mode)")
      ->check(CLI::IsMember({"default", "balanced", "accurate"}));
  app.add_option("--global-adjustment", line.global,
                 "adjust all of the map together: 'end', after the last keyframe, or a number, after so many keyframes "
                 "each (replay mode)")
      ->check(end_or_count);
  app.add_option("--global-rounds", a.global_rounds,
                 "with --global-adjustment: look for duplicates around every keyframe and adjust again, so many times")
      ->check(turbomap_program::not_negative());
  app.add_option("--temporal-neighbours", a.temporal_neighbours,
                 "search and fuse with so many keyframes at least: predecessors in time where fewer share points")
      ->check(turbomap_program::not_negative());
  app.add_option("--culling-observers", a.culling_observers,
                 "a point is redundant in a keyframe when more than so many others see it; with --preset accurate only "
                 "beside --culling-share")
      ->check(turbomap_program::not_negative());
  app.add_option("--culling-share", a.culling_share, "a keyframe is, when more than this share of its points is")
      ->check(CLI::Range(0.0, 1.0));
}

/// How keyframes come: with which points, and when.
inline void add_tracking_options(CLI::App& app, command_line& line) {
  arguments& a = line.a;
  app.add_option("--associate", line.associate,
                 "where keypoints get points of the map from: the recorded associations, or those and the local map, "
                 "projected into the keyframe")
      ->check(CLI::IsMember({"recorded", "projected"}));
  app.add_option("--points", line.points,
                 "how well tracking knows the points of the map: exactly, or as their covariances say")
      ->check(CLI::IsMember({"exact", "uncertain"}));
  app.add_option("--fusion-points", line.fused, "how well fusion's gate knows them")
      ->check(CLI::IsMember({"exact", "uncertain"}));
  app.add_flag("--queue", a.queue, "keyframes come in recorded time: stages are skipped while one waits");
  app.add_option("--rate", a.rate, "--queue, with keyframes that come so many times as fast")
      ->check(turbomap_program::positive());
}

/// How it is computed, and how much of it.
inline void add_computation_options(CLI::App& app, arguments& a) {
  app.add_option("--precision", a.numbers, "what adjustments compute in")
      ->check(CLI::IsMember({"float64", "mixed", "float32"}));
  app.add_flag("--published-steps", a.published_steps,
               "adjust around each keyframe with the steps of ORB-SLAM3: damped by the identity, ended by three slow "
               "iterations");
  app.add_flag("--marginal-prior", a.marginal_prior,
               "with an IMU: what a keyframe that leaves a window knew of the next one becomes a prior of that one");
  app.add_option("--stereo-correlation", a.stereo_correlation,
                 "of the errors of u and u_right, in adjustments; not given: as a simulated recording says, else "
                 "0.9835, as measured")
      ->check(CLI::Range(0.0, 0.9999));
  app.add_option("--merges", a.merges, "what fusion does with points that a camera sees at two keypoints")
      ->check(CLI::IsMember({"refuse", "apart", "drop"}));
  app.add_option("--deadline-ms", a.deadline_ms, "milliseconds per keyframe: work that would overrun is cut")
      ->check(turbomap_program::not_negative());
  app.add_option("--most-views", a.most_views,
                 "of a point with more views, so many stand for all in descriptor and normal; 0: all take part")
      ->check(turbomap_program::not_negative());
  app.add_option("--behind", a.behind,
                 "for so many first keyframes the next one waits: their fusion, adjustment and culling are skipped")
      ->check(turbomap_program::not_negative());
}

/// What is told of the replay.
inline void add_output_options(CLI::App& app, arguments& a) {
  app.add_flag("--growth", a.growth,
               "print medians of the times and of what keyframes share, per fifth of the keyframes");
  app.add_option("--growth-file", a.growth_file, "write them per keyframe to this file (.svg: a plot; else CSV)");
  app.add_option("--report", a.report, "write a page with map, times and growth to this file (HTML)");
  app.add_option("--json", a.json, "write the result to this file");
  app.add_option("--trajectory", a.trajectory, "write the keyframes' body poses to this file (TUM format)");
  app.add_option("--ply", a.ply, "write points and trajectory to this file (PLY: MeshLab, CloudCompare, rerun)");
  app.add_flag("!--no-bound", a.bound, "simulated recordings: leave out the adjustment of all true observations");
  app.add_flag("--merge-causes", a.merge_causes, "count why points had to be merged, and write it to the JSON");
  app.add_flag("--error-parts", a.error_parts,
               "simulated recordings: adjust what the map has, the right part of it, and what it lacks, and write the "
               "errors to the JSON");
  app.add_option("--perturb", a.perturb, "move the poses that come in by 1e-6 m at random, with this seed; 0: not")
      ->check(turbomap_program::not_negative());
  app.add_option("--repeat", a.repeat, "replay so many times and time all of them")
      ->check(turbomap_program::positive());
}

inline void add_options(CLI::App& app, command_line& line) {
  add_input_options(app, line);
  add_stage_options(app, line);
  add_map_options(app, line);
  add_tracking_options(app, line);
  add_computation_options(app, line.a);
  add_output_options(app, line.a);
}

/// The host policies that this program was built with.
inline std::vector<std::string> host_policies() {
  std::vector<std::string> names{"seq"};
#if defined(TURBOMAP_WITH_OPENMP)
  names.push_back("omp");
#endif
#if defined(TURBOMAP_WITH_TBB)
  names.push_back("tbb");
#endif
  return names;
}

/// The policies of --beside; `all` are the host policies that are not named yet, without `first`.
inline std::vector<std::string> other_policies(const std::vector<std::string>& beside, const std::string& first) {
  std::vector<std::string> built = host_policies(), others;
#if defined(TURBOMAP_PROGRAM_WITH_CUDA)
  built.push_back("cuda");
#endif
  const auto add = [&](const std::string& name) {
    if (std::find(built.begin(), built.end(), name) == built.end())
      throw std::invalid_argument("--beside " + name + ": this program was built without it");
    others.push_back(name);
  };
  for (const std::string& name : beside)
    if (name != "all")
      add(name);
    else
      for (const std::string& host : host_policies())
        if (host != first && std::find(others.begin(), others.end(), host) == others.end()) add(host);
  return others;
}

inline void choose_stages(const std::string& list, arguments& a) {
  const std::pair<const char*, bool*> stages[] = {{"point_culling", &a.point_culling},
                                                  {"search", &a.search},
                                                  {"creation", &a.creation},
                                                  {"fusion", &a.fusion},
                                                  {"map_update", &a.map_update},
                                                  {"adjustment", &a.adjustment},
                                                  {"preintegration", &a.preintegration},
                                                  {"culling", &a.culling},
                                                  {"keyframe_culling", &a.culling}};
  for (const auto& stage : stages) *stage.second = false;
  std::istringstream stream(list);
  for (std::string name; std::getline(stream, name, ',');) {
    const auto found =
        std::find_if(std::begin(stages), std::end(stages), [&](const auto& s) { return s.first == name; });
    if (found == std::end(stages))
      throw std::invalid_argument("--stages: '" + name +
                                  "' is not a stage: point_culling, search, creation, fusion, map_update, adjustment, "
                                  "preintegration, culling");
    *found->second = true;
  }
}

/// When all of the map is adjusted: as asked, otherwise as the preset does.
inline void settle_global_adjustment(const CLI::App& app, command_line& line) {
  arguments& a = line.a;
  const bool preset = a.balanced || a.accurate;
  const std::string when = line.global.empty() && preset ? "end" : line.global;
  if (preset && app.count("--global-rounds") == 0) a.global_rounds = 3;
  a.global_end = when == "end";
  if (!when.empty() && !a.global_end) a.global_every = std::stoi(when);
  if (when.empty() && a.global_rounds != 0)
    throw std::invalid_argument("--global-rounds: not without --global-adjustment");
}

/// --check compares without the IMU, and with keypoints as they were recorded.
inline void settle_check(command_line& line) {
  arguments& a = line.a;
  refuse({{"--map objects", a.objects},
          {"--pixel-centres", line.centres},
          {"--error-parts", a.error_parts},
          {"--right-distortion", !a.right_distortion.empty()},
          {"--imu", line.uses_imu},
          {"--beside", !line.beside.empty()}},
         "--check");
  a.pixel_centres = choice::no;
  if (a.imu == choice::by_recording) a.without_imu = "--check";
  a.imu = choice::no;
}

/// Throws std::invalid_argument for options that do not go together.
inline void settle(const CLI::App& app, command_line& line) {
  arguments& a = line.a;
  if (!line.stages.empty()) choose_stages(line.stages, a);
  a.queue = a.queue || app.count("--rate") != 0;
  a.objects = line.map == "objects";
  a.balanced = line.preset == "balanced", a.accurate = line.preset == "accurate";
  settle_global_adjustment(app, line);
  a.beside = other_policies(line.beside, a.policy);
  const bool cuda = a.policy == "cuda" || std::count(a.beside.begin(), a.beside.end(), "cuda") != 0;
  if (a.objects && cuda) throw std::invalid_argument("--map objects: not together with the policy cuda");
  if (a.accurate && a.culling_observers >= 0 && a.culling_share < 0)
    throw std::invalid_argument("--culling-observers: with --preset accurate not without --culling-share");
  const auto chosen = [&](const char* option, bool value) {
    return app.count(option) == 0 ? choice::by_recording : value ? choice::yes : choice::no;
  };
  a.imu = chosen("--imu", line.uses_imu), a.pixel_centres = chosen("--pixel-centres", line.centres);
  if (a.check) settle_check(line);
  if (a.imu == choice::no && a.imu_noise != 1) throw std::invalid_argument("--imu-noise: the replay is without an IMU");
  a.growth = a.growth || !a.growth_file.empty();
  a.projected = line.associate == "projected";
  a.uncertain_tracking = line.points == "uncertain" || (app.count("--points") == 0 && (a.balanced || a.accurate));
  a.uncertain_fusion = line.fused == "uncertain";
  if (line.mappers > 1)
    refuse({{"--check", a.check},
            {"--beside", !line.beside.empty()},
            {"--growth", a.growth},
            {"--report", !a.report.empty()},
            {"--ply", !a.ply.empty()},
            {"--trajectory", !a.trajectory.empty()},
            {"--error-parts", a.error_parts},
            {"--merge-causes", a.merge_causes}},
           "--mappers");
}

}  // namespace turbomap_replay

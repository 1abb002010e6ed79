// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-replay: replays a recording of local mapping, or checks every stage against it. See docs/programs.md.

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

#include <CLI/CLI.hpp>

#include "replay/arguments.hpp"
#include "replay/many_mappers.hpp"
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

/// The host policies that this program was built with.
std::vector<std::string> host_policies() {
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
std::vector<std::string> other_policies(const std::vector<std::string>& beside, const std::string& first) {
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

/// What is wrong with the value of --global-adjustment; empty: nothing. 0.5 and 1e3 are numbers, but not of keyframes.
std::string end_or_count(const std::string& text) {
  int count = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), count);
  const bool whole = failed == std::errc() && end == text.data() + text.size();
  return text == "end" || (whole && count > 0) ? "" : "'" + text + "' is neither 'end' nor a whole number above 0";
}

void choose_stages(const std::string& list, arguments& a) {
  std::set<std::string> names;
  std::istringstream stream(list);
  for (std::string name; std::getline(stream, name, ',');) {
    static const std::set<std::string> known{"point_culling",  "search",     "creation",
                                             "fusion",         "map_update", "adjustment",
                                             "preintegration", "culling",    "keyframe_culling"};
    if (known.count(name) == 0)
      throw std::invalid_argument("--stages: '" + name +
                                  "' is not a stage: point_culling, search, creation, fusion, map_update, adjustment, "
                                  "preintegration, culling");
    names.insert(name);
  }
  a.point_culling = names.count("point_culling") != 0;
  a.search = names.count("search") != 0;
  a.creation = names.count("creation") != 0;
  a.fusion = names.count("fusion") != 0;
  a.adjustment = names.count("adjustment") != 0;
  a.preintegration = names.count("preintegration") != 0;
  a.map_update = names.count("map_update") != 0;
  a.culling = names.count("culling") != 0 || names.count("keyframe_culling") != 0;
}

}  // namespace

int main(int argc, char** argv) {
  arguments a;
  std::string stages;
  CLI::App app("Replays a recording of local mapping through the stages of TurboMap, or checks every stage against it.",
               "turbomap-replay");
  app.footer(
      "Examples:\n"
      "  turbomap-replay                                   the built-in recording, times of every stage\n"
      "  turbomap-replay RECORDING --beside all            under every policy of this processor\n"
      "  turbomap-replay RECORDING --report map.html       map, times and errors as a page\n"
      "  turbomap-replay RECORDING --ply map.ply           the map for MeshLab, CloudCompare, rerun\n"
      "  turbomap-replay RECORDING --check                 every stage against what was recorded");
  app.add_option("recording", a.recording, "folder of the recording; the built-in simulated one when not given");
  app.add_option("--policy", a.policy, "execution policy")->check(CLI::IsMember({"seq", "omp", "tbb", "cuda"}));
  app.add_option("--beside", a.beside,
                 "replay under these policies too (separated by commas; all: those of this processor), and print the "
                 "times side by side")
      ->delimiter(',')
      ->check(CLI::IsMember({"seq", "omp", "tbb", "cuda", "all"}));
  std::size_t mappers = 1;
  app.add_option("--mappers", mappers,
                 "so many replays at a time, each on a thread of its own: how many keyframes they map together")
      ->check(CLI::Range(1, 1000));
  std::string map = "simple";
  app.add_option("--map", map,
                 "how the map is stored: flat arrays, or objects with locks and getters that copy, as in the field "
                 "(host policies, replay mode)")
      ->check(CLI::IsMember({"simple", "objects"}));
  bool uses_imu = false, centres = false;
  auto* imu = app.add_flag("--imu,!--no-imu", uses_imu,
                           "use the IMU, initialised from its samples, or leave it out; when not given, recordings "
                           "with an IMU use it (replay mode)");
  app.add_option("--imu-noise", a.imu_noise,
                 "noise densities of the IMU, times those of the recording; above 1 where it vibrates")
      ->check(CLI::Range(1e-3, 1e3));
  auto* pixel_centres =
      app.add_flag("--pixel-centres,!--no-pixel-centres", centres,
                   "move recorded keypoints of coarser levels to where they are in the full image, or not; when not "
                   "given, the recording says so or its observations tell (replay mode)");
  app.add_option("--right-distortion", a.right_distortion,
                 "distortion of the right fisheye camera instead of the recorded one: k1,k2,k3,k4 (replay mode)")
      ->delimiter(',')
      ->expected(4);
  app.add_flag("--check", a.check, "compare every stage with the recorded snapshots; exit status 1 when one differs");
  app.add_option("--stages", stages,
                 "stages to run, separated by commas: "
                 "point_culling,search,creation,fusion,map_update,adjustment,preintegration,culling");
  app.add_option("--creation", a.rule, "what points are made from (replay mode)")
      ->check(CLI::IsMember({"tracks", "pairs"}));
  app.add_option("--known-octaves", a.known_octaves,
                 "a keypoint that sees a point is beside a track's where their octaves differ by so many at most")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--fewest-keyframes", a.fewest_keyframes, "keyframes that must see a new point of a track (1)")
      ->check(CLI::PositiveNumber);
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
      ->check(CLI::NonNegativeNumber);
  std::string preset = "default";
  app.add_option("--preset", preset,
                 "balanced: options for a trajectory near the bound; accurate: the most exact ones; both with --points "
                 "uncertain, and unless others are given --global-adjustment end and --global-rounds 3 (replay mode)")
      ->check(CLI::IsMember({"default", "balanced", "accurate"}));
  std::string global;
  app.add_option("--global-adjustment", global,
                 "adjust all of the map together: 'end', after the last keyframe, or a number, after so many keyframes "
                 "each (replay mode)")
      ->check(end_or_count);
  auto* rounds =
      app.add_option(
             "--global-rounds", a.global_rounds,
             "with --global-adjustment: look for duplicates around every keyframe and adjust again, so many times")
          ->check(CLI::NonNegativeNumber);
  app.add_option("--temporal-neighbours", a.temporal_neighbours,
                 "search and fuse with so many keyframes at least: predecessors in time where fewer share points")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--culling-observers", a.culling_observers,
                 "a point is redundant in a keyframe when more than so many others see it; with --preset accurate only "
                 "beside --culling-share")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--culling-share", a.culling_share, "a keyframe is, when more than this share of its points is")
      ->check(CLI::Range(0.0, 1.0));
  std::string associate = "recorded";
  app.add_option("--associate", associate,
                 "where keypoints get points of the map from: the recorded associations, or those and the local map, "
                 "projected into the keyframe")
      ->check(CLI::IsMember({"recorded", "projected"}));
  std::string points = "exact", fused = "exact";
  auto* known = app.add_option("--points", points,
                               "how well tracking knows the points of the map: exactly, or as their covariances say")
                    ->check(CLI::IsMember({"exact", "uncertain"}));
  app.add_option("--fusion-points", fused, "how well fusion's gate knows them")
      ->check(CLI::IsMember({"exact", "uncertain"}));
  app.add_flag("--queue", a.queue, "keyframes come in recorded time: stages are skipped while one waits");
  auto* rate = app.add_option("--rate", a.rate, "--queue, with keyframes that come so many times as fast")
                   ->check(CLI::PositiveNumber);
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
      ->check(CLI::NonNegativeNumber);
  app.add_option("--most-views", a.most_views,
                 "of a point with more views, so many stand for all in descriptor and normal; 0: all take part")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--behind", a.behind,
                 "for so many first keyframes the next one waits: their fusion, adjustment and culling are skipped")
      ->check(CLI::NonNegativeNumber);
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
      ->check(CLI::NonNegativeNumber);
  app.add_option("--repeat", a.repeat, "replay so many times and time all of them")->check(CLI::PositiveNumber);
  return turbomap_program::run_program(app, argc, argv, [&] {
    if (!stages.empty()) choose_stages(stages, a);
    a.queue = a.queue || rate->count() != 0;
    a.objects = map == "objects";
    a.balanced = preset == "balanced", a.accurate = preset == "accurate";
    if ((a.balanced || a.accurate) && global.empty()) global = "end";
    if ((a.balanced || a.accurate) && rounds->count() == 0) a.global_rounds = 3;
    a.global_end = global == "end";
    if (!global.empty() && !a.global_end) a.global_every = std::stoi(global);
    if (global.empty() && a.global_rounds != 0)
      throw std::invalid_argument("--global-rounds: not without --global-adjustment");
    const bool compares = !a.beside.empty();
    a.beside = other_policies(a.beside, a.policy);
    const bool cuda = a.policy == "cuda" || std::count(a.beside.begin(), a.beside.end(), "cuda") != 0;
    if (a.objects && cuda) throw std::invalid_argument("--map objects: not together with the policy cuda");
    if (a.accurate && a.culling_observers >= 0 && a.culling_share < 0)
      throw std::invalid_argument("--culling-observers: with --preset accurate not without --culling-share");
    const auto chosen = [](const CLI::Option* option, bool value) {
      using turbomap_replay::choice;
      return option->count() == 0 ? choice::by_recording : value ? choice::yes : choice::no;
    };
    a.imu = chosen(imu, uses_imu), a.pixel_centres = chosen(pixel_centres, centres);
    if (a.check) {
      turbomap_replay::refuse({{"--map objects", a.objects},
                               {"--pixel-centres", centres},
                               {"--error-parts", a.error_parts},
                               {"--right-distortion", !a.right_distortion.empty()},
                               {"--imu", uses_imu},
                               {"--beside", compares}},
                              "--check");
      a.pixel_centres = turbomap_replay::choice::no;
      if (a.imu == turbomap_replay::choice::by_recording) a.without_imu = "--check";
      a.imu = turbomap_replay::choice::no;
    }
    if (a.imu == turbomap_replay::choice::no && a.imu_noise != 1)
      throw std::invalid_argument("--imu-noise: the replay is without an IMU");
    a.growth = a.growth || !a.growth_file.empty();
    a.projected = associate == "projected";
    a.uncertain_tracking = points == "uncertain" || (known->count() == 0 && (a.balanced || a.accurate));
    a.uncertain_fusion = fused == "uncertain";
    if (a.recording.empty()) a.recording = demo_recording(argv[0]);

    if (mappers > 1)
      turbomap_replay::refuse({{"--check", a.check},
                               {"--beside", compares},
                               {"--growth", a.growth},
                               {"--report", !a.report.empty()},
                               {"--ply", !a.ply.empty()},
                               {"--trajectory", !a.trajectory.empty()},
                               {"--error-parts", a.error_parts},
                               {"--merge-causes", a.merge_causes}},
                              "--mappers");
    require_folders(a);
    outcome result = mappers > 1 ? turbomap_replay::replay_side_by_side(a, mappers, run) : run(a);
    if (a.check)
      std::printf("%s\n%s\n", result.json.dump(2).c_str(), result.good ? "check: all agree" : "check: FAILED");
    if (!a.beside.empty()) run_beside(a, result);
    turbomap_program::write_json(a.json, result.json);
    return result.good ? 0 : 1;
  });
}

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-extract: makes a recording of local mapping from the images of a data set in EuRoC's or TUM-VI's layout.

#include <algorithm>
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include <turbomap/io/recording_writer.hpp>

#include "extraction/extract.hpp"
#include "progress.hpp"
#include "run_program.hpp"
#include "simulation/keyframe_rules.hpp"

namespace {

namespace ext = turbomap::extraction;

struct arguments {
  std::string folder, out;
  ext::dataset_options data;
  ext::extract_options options;
};

void run(const arguments& args) {
  const ext::asl_dataset data = ext::read_asl_dataset(args.folder, args.data);
  const ext::picked_keyframes picked = ext::pick_keyframes(data, args.options);
  turbomap::recording r;
  {
    turbomap_program::progress bar("extract", picked.keyframes.size());
    r = ext::extract(data, picked, args.options, [&] { bar.advance(); });
  }
  turbomap::write_recording(args.out, r);
  std::size_t stereo = 0;
  for (const float depth : r.kp_depth) stereo += depth > 0 ? 1 : 0;
  const double keypoints = std::max(1.0, static_cast<double>(r.kp_xy.size()));
  std::printf("%s: %zu keyframes of %zu images, %zu keypoints, %.0f%% with a depth, %.0f%% with a map point\n",
              args.out.c_str(), r.keyframe_count(), data.images.size(), r.kp_xy.size(),
              100 * static_cast<double>(stereo) / keypoints, 100 * static_cast<double>(r.assoc_kp.size()) / keypoints);
}

}  // namespace

int main(int argc, char** argv) {
  arguments args;
  auto& o = args.options;
  CLI::App app("Makes a recording of local mapping from the images of a data set.", "turbomap-extract");
  app.footer(
      "Examples:\n"
      "  turbomap-extract V1_02_medium --out recording    EuRoC, stereo, poses of its ground truth\n"
      "  turbomap-extract dataset-room1_512_16 --out recording --imu --drift 0.01\n"
      "  turbomap-replay recording --associate projected");
  app.add_option("FOLDER", args.folder, "Data set in ASL layout (EuRoC, TUM-VI): the folder with mav0")->required();
  app.add_option("--out", args.out, "Directory of the recording")->required();
  app.add_option(
      "--trajectory", args.data.trajectory,
      "TUM file (t x y z qx qy qz qw, body in world) with the poses, instead of the data set's ground truth");
  app.add_option(
      "--calibration", args.data.calibration,
      "Kalibr FILE.yaml, instead of each sensor.yaml or TUM-VI's dso/camchain.yaml; its imu0 too, where it has one");
  app.add_flag("--mono", args.data.mono, "Only the left camera, no stereo");
  app.add_flag("--imu", args.data.imu, "Inertial data too (imu0)");
  app.add_option("--drift", o.motion.drift_metres_per_metre,
                 "Drift of the recorded positions, m per m; rotations drift by 0.2 times as many rad per m")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  app.add_option("--seed", o.seed, "The same seed gives the same drift")->capture_default_str();
  app.add_option("--keyframes", o.motion.most_keyframes, "Stop after so many (0: all the way)")
      ->check(CLI::Range(0, 1000000000));
  turbomap::simulation::add_keyframe_rules(app, o.motion);
  app.add_option("--cell-features", o.features.per_cell, "Keypoints per cell of a grid of 12 x 8, at most")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  app.add_option("--close", o.close_depth, "Stereo points beyond so many baselines are far")
      ->check(CLI::Range(1.0, 1e6))
      ->capture_default_str();
  return turbomap_program::run_program(app, argc, argv, [&] {
    // The simulator's ratio of turn and way.
    o.motion.drift_radians_per_metre = 0.2 * o.motion.drift_metres_per_metre;
    run(args);
    return 0;
  });
}

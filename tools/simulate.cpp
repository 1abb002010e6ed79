// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-simulate: writes a recording of local mapping along a trajectory, with the truth beside it.

#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include <turbomap/io/recording_writer.hpp>

#include "progress.hpp"
#include "run_program.hpp"
#include "simulation/calibration_file.hpp"
#include "simulation/keyframe_rules.hpp"
#include "simulation/simulate.hpp"
#include "simulation/walks.hpp"

namespace {

namespace sim = turbomap::simulation;

struct arguments {
  std::string trajectory, camera = "euroc", out;
  bool mono = false, uninitialised = false;
  double noise_px = -1, disparity_noise_px = -1;  ///< negative: not given
  sim::simulation_options options;
};

sim::simulated_rig rig_of(const arguments& args) {
  sim::simulated_rig rig = args.camera == "euroc"    ? sim::euroc_rig()
                           : args.camera == "tum-vi" ? sim::tum_vi_rig()
                                                     : sim::read_rig(args.camera);
  return args.mono ? sim::monocular(rig) : rig;
}

void set_noise(const arguments& args, sim::simulated_rig& rig) {
  if (args.noise_px >= 0) {
    rig.disparity_noise_px *= args.noise_px / rig.noise_px;
    rig.noise_px = args.noise_px;
  }
  if (args.disparity_noise_px >= 0) rig.disparity_noise_px = args.disparity_noise_px;
}

void run(const arguments& args, int features) {
  sim::simulated_rig rig = rig_of(args);
  set_noise(args, rig);
  if (features > 0) rig.features = features;
  auto options = args.options;
  options.imu_initialised = !args.uninitialised;
  if (args.trajectory == "corridor") options.scene.ahead = 60;  // or the last keyframes would see its end
  const auto poses = sim::trajectory(args.trajectory, args.options.motion, rig.cameras[0].T_bc);
  std::optional<turbomap_program::progress> bar;
  const turbomap::recording r = sim::simulate(poses, rig, options, [&bar](std::size_t steps) {
    if (!bar) bar.emplace("simulate", steps);
    bar->advance();
  });
  bar.reset();
  turbomap::write_recording(args.out, r);
  const auto mapped =
      static_cast<double>(r.assoc_kp.size()) / static_cast<double>(std::max<std::size_t>(1, r.kp_xy.size()));
  std::printf("%s: %zu keyframes, %zu keypoints, %.0f%% with a map point, %zu scene points\n", args.out.c_str(),
              r.keyframe_count(), r.kp_xy.size(), 100 * mapped, r.sim_point_xyz.size());
}

}  // namespace

int main(int argc, char** argv) {
  arguments args;
  auto& o = args.options;
  int features = 0;
  CLI::App app("Simulates a recording of local mapping, with the truth beside it.", "turbomap-simulate");
  app.footer(
      "Examples:\n"
      "  turbomap-simulate room --out OUT --keyframes 200    a stereo recording of 200 keyframes\n"
      "  turbomap-simulate FILE.tum --out OUT --mono --drift 0.02    along your own trajectory\n"
      "  turbomap-replay OUT                                 replays it");
  app.add_option(
         "TRAJECTORY", args.trajectory,
         "TUM file (t x y z qx qy qz qw, body in world), or 'builtin'; as long as --keyframes asks for: 'room', the "
         "same room again and again, and 'corridor'")
      ->required();
  app.add_option("--camera", args.camera, "euroc, tum-vi, or a Kalibr calibration FILE.yaml")->capture_default_str();
  app.add_option("--out", args.out, "Directory of the recording")->required();
  app.add_option("--seed", o.seed, "The same seed gives the same recording")->capture_default_str();
  auto* imu = app.add_flag("--imu", o.imu, "Inertial data too; the world then has gravity along -z");
  app.add_flag(
         "--uninitialised", args.uninitialised,
         "As by a system whose IMU is not initialised: no velocities and biases, the world is the first camera's, "
         "with --mono in a unit of its own")
      ->needs(imu);
  app.add_flag("--mono", args.mono, "Only the left camera, no stereo");
  app.add_option("--keyframes", o.motion.most_keyframes, "Stop after so many (0: all the way)")
      ->check(CLI::Range(0, 1000000000));
  app.add_option("--points", o.points, "Scene points (0: as many as fill the images)")
      ->check(CLI::Range(0, 1000000000));
  app.add_option("--features", features, "Keypoints an image (0: as the camera's preset)")
      ->check(CLI::Range(0, 1000000));
  app.add_option("--boxes", o.scene.boxes, "Boxes in the room")->check(CLI::Range(0, 10000))->capture_default_str();
  app.add_option("--noise", args.noise_px, "Standard deviation of u and v at the finest level, px (0.5; fisheye: 1)")
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--disparity-noise", args.disparity_noise_px,
                 "... of the disparity of a rectified pair (not given: 0.26 times that of u, as measured)")
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--drift", o.motion.drift_metres_per_metre,
                 "Drift of the recorded positions, m per m; rotations drift by 2e-4 rad per m, whatever is given")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  turbomap::simulation::add_keyframe_rules(app, o.motion);
  return turbomap_program::run_program(app, argc, argv, [&] {
    run(args, features);
    return 0;
  });
}

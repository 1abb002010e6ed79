// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Recorded local bundle adjustments, and what must hold of ours under every policy.

#include <doctest/doctest.h>

#include <cstdint>
#include <string>
#include <vector>

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/io/recording.hpp>
#include "bundle/recorded_problem.hpp"
#include "bundle/solve.hpp"
#include "readers/recording_snapshot_adjustment.hpp"
#include "replay/check_adjustment.hpp"

#include "support/support.hpp"

namespace turbomap_test {

/// Calls `run(camera, recording, directory)` with each of these recordings, the camera a default one of its model in float.
/// Skips the running test case where data are not there.
template <class Run>
void for_each_recording(std::initializer_list<const char*> names, const Run& run) {
  for (const char* name : names) {
    const auto directory = data(std::string("recordings/") + name);
    if (!directory) return;
    CAPTURE(std::string(name));
    const auto r = turbomap::read_recording(*directory);
    if (r.meta.is_fisheye())
      run(turbomap::kannala_brandt<float>{}, r, *directory);
    else
      run(turbomap::pinhole<float>{}, r, *directory);
  }
}

template <class Run>
void for_each_recording(const Run& run) {
  for_each_recording({"euroc_v102_stereo", "euroc_v102_inertial", "tum_room1_stereo", "tum_room1_inertial"}, run);
}

/// The recorded problems of a recording end where the peer's did.
template <class Camera, class Policy>
void check_as_good_as_peer(const turbomap::recording& r, const std::filesystem::path& directory, const Policy& policy,
                           turbomap::precision numbers) {
  turbomap_replay::adjustment_check<Camera, Policy> check(r, directory, policy, numbers, 1);
  for (const auto iteration : r.meta.snapshots) check.check(iteration);
  CHECK_FALSE(check.empty());
  nlohmann::json json;
  check.add_json(json);
  CAPTURE(json.dump());
  CHECK(check.good());
}

/// Calls `run(problem, options)` with each recorded visual problem, the options those of the peer.
/// \tparam Camera  a model in float, as recorded
/// \return how many there were
template <class Camera, class Run>
int for_each_recorded_problem(const turbomap::recording& r, const std::filesystem::path& directory, const Run& run) {
  using camera = typename turbomap_replay::in_double<Camera>::type;
  int problems = 0;
  for (const auto iteration : r.meta.snapshots) {
    const auto s = turbomap::read_adjustment_snapshot(r, directory, iteration);
    if (!s || s->inertial) continue;
    CAPTURE(iteration);
    turbomap::adjustment_options options;
    options.damping = turbomap::damping_rule::identity;  // the peer's
    options.numbers = turbomap::precision::float64;
    options.max_iterations = s->iterations, options.initial_lambda = s->initial_lambda;
    run(turbomap_bundle::recorded_problem<camera>(r.meta, *s), options);
    ++problems;
  }
  return problems;
}

/// What an adjustment of a recorded problem gives.
struct recorded_result {
  turbomap::adjustment_summary summary;
  std::vector<turbomap::rigid_transform<double>> poses;
  std::vector<turbomap::vec3<double>> points;
  std::vector<double> chi2, depth;    ///< one per observation
  std::vector<std::uint8_t> outlier;  ///< the same: beyond the gate or behind the camera
};

template <class Policy, class Camera>
recorded_result adjust_recorded(const Policy& policy, const turbomap_bundle::rig_problem<Camera>& p,
                                const turbomap::adjustment_options& options) {
  const auto& d = p.data;
  turbomap::context<Policy> ctx{policy};
  turbomap::bundle_problem<Policy, turbomap::pose_frame, turbomap::reprojections<Camera>> problem(ctx);
  problem.assign(
      ctx, {{d.T_cw.data(), d.T_cw.size()}, {d.fixed.data(), d.fixed.size()}}, {{d.points.data(), d.points.size()}},
      turbomap_bundle::reprojections_of(p, turbomap_bundle::huber_of(5.991), turbomap_bundle::huber_of(7.815)));
  recorded_result r;
  r.summary = turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, options);
  problem.frames(ctx, r.poses), problem.landmarks(ctx, r.points);
  problem.template chi2<0>(ctx, r.chi2, r.depth);
  for (std::size_t i = 0; i < r.chi2.size(); ++i) {
    const double gate = d.stereo[i] != 0 ? 7.815 : 5.991;
    r.outlier.push_back(r.chi2[i] > gate || !(r.depth[i] > 0) ? 1 : 0);
  }
  return r;
}

}  // namespace turbomap_test

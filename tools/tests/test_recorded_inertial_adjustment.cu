// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Recorded visual-inertial adjustments on a device: as good as the peer's, what the host computes within rounding, and the
/// same bits each time. Prints how long they take with all copies.

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <cmath>
#include <string>
#include <vector>

#include "adjustment/adjustment_results.hpp"
#include "inertial/inertial_state_distance.hpp"
#include "recorded_adjustment_cases.hpp"
#include "replay/check_inertial_adjustment.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::precision;
using edges = turbomap::inertial_edges;
using methods = turbomap::adjustment_methods<turbomap::solver_list<turbomap::reduced_solver::dense>,
                                             turbomap::precision_list<precision::float64, precision::mixed>>;

constexpr std::initializer_list<const char*> inertial_recordings{"euroc_v102_inertial", "tum_room1_inertial"};

struct result {
  turbomap::adjustment_summary summary;
  std::vector<turbomap::inertial_state<double>> frames;
  std::vector<turbomap::vec3<double>> landmarks;
  double ms = 0;  ///< from host arrays to host arrays, median
};

template <class Policy, class Camera>
result adjust_recorded(const Policy& policy, const turbomap_bundle::inertial_rig_problem<Camera>& p,
                       const turbomap::adjustment_options& options, int repeat) {
  turbomap::context<Policy> ctx{policy};
  turbomap::bundle_problem<Policy, turbomap::inertial_frame, turbomap::reprojections<Camera>, edges::factors,
                           edges::robust_factors, edges::walk_factors>
      problem(ctx);
  const auto seen = turbomap_bundle::reprojections_of(p.visual, turbomap::huber{5.991}, turbomap::huber{7.815});
  const auto& d = p.visual.data;
  result r;
  std::vector<double> ms;
  for (int i = 0; i < repeat; ++i) {
    const turbomap_bundle::stopwatch watch;
    problem.assign(ctx, {p.states, d.fixed, {}}, {{d.points.data(), d.points.size()}}, seen, p.edges.plain(p.factor),
                   p.edges.robust(p.factor, p.window), p.edges.walks());
    r.summary = turbomap::adjust<methods>(ctx, problem, options);
    problem.frames(ctx, r.frames);
    problem.landmarks(ctx, r.landmarks);
    ms.push_back(watch.ms());
  }
  r.ms = turbomap_bundle::median(ms);
  return r;
}

TEST_CASE("recorded visual-inertial problems are adjusted as on the host, and the same each time") {
  const stream on;
  for_each_recording(inertial_recordings, [&](auto model, const turbomap::recording& r,
                                              const std::filesystem::path& directory) {
    using camera = typename turbomap_replay::in_double<decltype(model)>::type;
    for (const auto iteration : r.meta.snapshots) {
      const auto s = turbomap::read_adjustment_snapshot(r, directory, iteration);
      if (!s || !s->inertial) continue;
      CAPTURE(iteration);
      const auto more = turbomap::read_inertial_snapshot(r, directory, iteration, *s);
      const auto p = turbomap_bundle::recorded_inertial_problem<camera>(
          r.meta, *s, more, turbomap::read_preintegration_snapshot(r, directory, iteration));
      turbomap::adjustment_options options;
      options.damping = turbomap::damping_rule::identity;  // the peer's
      options.max_iterations = s->iterations, options.initial_lambda = s->initial_lambda;
      for (const auto numbers : {precision::float64, precision::mixed}) {
        CAPTURE(static_cast<int>(numbers));
        options.numbers = numbers;
        const auto a = adjust_recorded(on.policy(), p, options, 20), b = adjust_recorded(on.policy(), p, options, 1);
        const auto host = adjust_recorded(thrust::seq, p, options, 1);
        CHECK(same_bits(a.frames, b.frames));
        CHECK(same_bits(a.landmarks, b.landmarks));
        const double relative = numbers == precision::float64 ? 1e-9 : 1e-5;
        CHECK(std::abs(a.summary.cost_final - host.summary.cost_final) <= relative * host.summary.cost_final);
        const double apart = distance(a.frames, host.frames), points = distance(a.landmarks, host.landmarks);
        CHECK(apart <= (numbers == precision::float64 ? 1e-9 : 1e-3));
        if (numbers == precision::float64) CHECK(points <= 1e-9);
        const std::string name = numbers == precision::float64 ? "float64" : "mixed";
        MESSAGE(r.meta.model, " ", iteration, " ", name, ": ", a.ms, " ms, ", s->optimised, " keyframes, ",
                p.visual.data.points.size(), " points, ", a.summary.iterations, " iterations; off the host's by ",
                apart, ", points by ", points);
      }
    }
  });
}

TEST_CASE("recorded visual-inertial problems are adjusted as well as by the peer") {
  const stream on;
  for_each_recording(
      inertial_recordings, [&](auto model, const turbomap::recording& r, const std::filesystem::path& directory) {
        turbomap_replay::inertial_adjustment_check<decltype(model), std::decay_t<decltype(on.policy())>> check(
            r, directory, on.policy(), precision::float64, 1);
        for (const auto iteration : r.meta.snapshots) check.check(iteration);
        if (check.empty()) return;  // a visual recording
        nlohmann::json json;
        check.add_json(json);
        CAPTURE(json.dump());
        CHECK(check.good());
      });
}

}  // namespace

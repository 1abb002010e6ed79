// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The adjustments of turbomap-bench on recorded inputs: each visual local adjustment that the recorded system made, and the newest of
/// its keyframes with its points held fixed, as tracking adjusts a frame. Milliseconds are those of one adjustment, means over all.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "reference/recorded_cost_rig.hpp"
#include "reference/reprojection_oracle.hpp"

#include <turbomap/adjustment/levenberg_marquardt.hpp>
#include <turbomap/adjustment/motion_only.hpp>
#include <turbomap/adjustment/problem.hpp>

#include "bundle/recorded_problem.hpp"
#include "measure.hpp"
#include "motion_only_calls.hpp"
#include "progress.hpp"
#include "readers/recording_snapshot_adjustment.hpp"
#include "replay/check_adjustment.hpp"

namespace turbomap_bench {

/// One recorded adjustment.
template <class Camera>
struct recorded_adjustment {
  turbomap_bundle::rig_problem<Camera> problem;
  turbomap::adjustment_options options;
  double peer_cost = 0;    ///< robust, where the recorded system ended
  std::size_t newest = 0;  ///< of the frames that move
};

inline turbomap_test::oracle_problem oracle_of(const turbomap::reprojection_data& d,
                                               const std::vector<turbomap_test::cost_camera>& rig) {
  turbomap_test::oracle_problem o;
  for (const auto& T : d.T_cw) o.frames.push_back(turbomap_test::frame_of(T));
  for (const auto f : d.fixed) o.frame_fixed.push_back(f != 0);
  for (const auto& x : d.points) o.landmarks.emplace_back(x.x, x.y, x.z);
  o.landmark_fixed.assign(d.points.size(), false);
  for (std::size_t i = 0; i < d.observation_count(); ++i)
    o.blocks.push_back(turbomap_test::reprojection_block(d.frame[i], d.landmark[i], rig[d.camera[i]],
                                                         {d.pixel[i], d.information[i], d.stereo[i] != 0}));
  return o;
}

/// Milliseconds that one core needs for so many multiply-adds in double and nothing else, read as a stream.
inline double multiply_add_floor_ms(double multiply_adds) {
  volatile double sink = 0;
  std::vector<double> x(1000, 1e-3), y(1000, 1);
  std::vector<double> samples;
  const int passes = 2000;
  for (int k = 0; k < 15; ++k) {
    const double begin = now_ms();
    for (int p = 0; p < passes; ++p) {
      const double a = 1e-3 * p;
      for (std::size_t i = 0; i < x.size(); ++i) y[i] += a * x[i];
    }
    samples.push_back((now_ms() - begin) / (passes * static_cast<double>(x.size())));
    sink = y[static_cast<std::size_t>(k)];
  }
  (void)sink;
  return median(samples) * multiply_adds;
}

/// What an adjustment has to do at least.
struct adjustment_floor {
  double multiply_adds = 0, transforms = 0;

  double ms() const { return multiply_add_floor_ms(multiply_adds) + transform_floor_ms(transforms); }
  nlohmann::json json() const { return {{"multiply_adds", multiply_adds}, {"transforms", transforms}}; }
};

/// One iteration of the Schur complement. Each residual of an observation with a moving frame adds a row to the blocks of its frame (21),
/// of its point (6), between both (18) and to the right side (9). A point that k moving frames see takes 6 x 3 x 3 in each of them, and
/// 6 x 6 x 3 in each of their k (k + 1) / 2 pairs; the Cholesky factorisation of n unknowns n^3 / 6.
inline adjustment_floor floor_of_iteration(const turbomap::reprojection_data& d) {
  adjustment_floor floor;
  std::vector<double> moving(d.points.size(), 0);
  for (std::size_t i = 0; i < d.observation_count(); ++i) {
    const bool moves = d.fixed[static_cast<std::size_t>(d.frame[i])] == 0;
    floor.multiply_adds += (d.stereo[i] != 0 ? 3 : 2) * (moves ? 54 : 9);
    floor.transforms += 1;
    moving[static_cast<std::size_t>(d.landmark[i])] += moves ? 1 : 0;
  }
  for (const double k : moving) floor.multiply_adds += 54 * k + 108 * k * (k + 1) / 2;
  const auto n = 6 * static_cast<double>(std::count(d.fixed.begin(), d.fixed.end(), 0));
  floor.multiply_adds += n * n * n / 6;
  return floor;
}

/// Adjusts problems of one rig and keeps what the last one gave.
template <class Camera, class Policy>
struct adjuster {
  explicit adjuster(const Policy& policy) : ctx(policy), problem(ctx) {}

  void operator()(const turbomap_bundle::rig_problem<Camera>& p, const turbomap::adjustment_options& options) {
    using turbomap_bundle::huber_of;
    const auto& d = p.data;
    problem.assign(ctx, {{d.T_cw.data(), d.T_cw.size()}, {d.fixed.data(), d.fixed.size()}},
                   {{d.points.data(), d.points.size()}},
                   turbomap_bundle::reprojections_of(p, huber_of(5.991), huber_of(7.815)));
    summary = turbomap::adjust<methods>(ctx, problem, options);
    problem.frames(ctx, frames), problem.landmarks(ctx, landmarks);
  }

  using methods = turbomap::adjustment_methods<turbomap::solver_list<turbomap::reduced_solver::dense>,
                                               turbomap::precision_list<turbomap::precision::float64>>;
  turbomap::context<Policy> ctx;
  turbomap::bundle_problem<Policy, turbomap::pose_frame, turbomap::reprojections<Camera>> problem;
  turbomap::adjustment_summary summary;
  std::vector<turbomap::rigid_transform<double>> frames;
  std::vector<turbomap::vec3<double>> landmarks;
};

/// Times of a whole recording as those of one adjustment.
inline nlohmann::json per_problem(nlohmann::json times, std::size_t problems, const adjustment_floor& floor) {
  for (const char* key : {"ms_median", "oracle_ms_median", "floor_ms"})
    if (times.contains(key)) times[key] = times[key].template get<double>() / static_cast<double>(problems);
  times["problems"] = problems, times["floor"] = floor.json();
  return times;
}

/// Beside the oracle, which is timed once: it takes seconds where an adjustment takes milliseconds.
template <class Camera, class Policy>
nlohmann::json time_adjustment(const Policy& policy, const std::vector<recorded_adjustment<Camera>>& problems,
                               const std::vector<turbomap_test::cost_camera>& rig, int repetitions) {
  adjuster<Camera, Policy> adjust(policy);
  adjustment_floor floor;
  double oracle_ms = 0;
  turbomap_program::progress bar("adjustments by the oracle", problems.size());
  for (const auto& one : problems) {
    adjust(one.problem, one.options);
    std::vector<turbomap::isometry<double>> T_cw;
    for (const auto& T : adjust.frames) T_cw.push_back(turbomap::to_isometry<double>(T));
    const double cost = robust_sum(turbomap_bundle::observation_costs(one.problem, T_cw, adjust.landmarks));
    require_same(cost <= turbomap_replay::adjustment_bounds{}.worst_cost_ratio * one.peer_cost, "adjustment");

    auto expected = oracle_of(one.problem.data, rig), got = expected;
    const double begin = now_ms();
    turbomap_test::oracle_adjust<turbomap_test::sparse_equations>(expected, one.options.max_iterations, false,
                                                                  one.options.initial_lambda);
    oracle_ms += now_ms() - begin;
    for (std::size_t f = 0; f < got.frames.size(); ++f) got.frames[f] = turbomap_test::frame_of(adjust.frames[f]);
    for (std::size_t l = 0; l < got.landmarks.size(); ++l) {
      const auto& x = adjust.landmarks[l];
      got.landmarks[l] = {x.x, x.y, x.z};
    }
    require_same(std::abs(got.cost() / expected.cost() - 1) < 1e-6, "adjustment");
    const auto of_one = floor_of_iteration(one.problem.data);
    floor.multiply_adds += adjust.summary.iterations * of_one.multiply_adds;
    floor.transforms += adjust.summary.iterations * of_one.transforms;
    bar.advance();
  }
  const auto ours = [&] {
    for (const auto& one : problems) adjust(one.problem, one.options);
  };
  nlohmann::json times = interleave(repetitions, ours, {}, floor.ms());
  times["oracle_ms_median"] = oracle_ms, times["ratio"] = oracle_ms / times["ms_median"].get<double>();
  return per_problem(times, problems.size(), floor);
}

/// One frame, with what it sees.
struct sighted_frame {
  sighted_frame(const turbomap::reprojection_data& d, std::size_t f) : T_cw{d.T_cw[f]} {
    for (std::size_t i = 0; i < d.observation_count(); ++i) {
      if (d.frame[i] != static_cast<std::int32_t>(f)) continue;
      const bool stereo = d.stereo[i] != 0;
      point.push_back(d.points[static_cast<std::size_t>(d.landmark[i])]), pixel.push_back(d.pixel[i]);
      if (!stereo) pixel.back().z = -1;
      information.push_back(d.information[i]), camera.push_back(d.camera[i]);
      sights.add(point.back(), pixel.back(), d.information[i], d.camera[i], stereo);
    }
    begin = {0, static_cast<std::int32_t>(point.size())};
  }
  std::vector<turbomap::rigid_transform<double>> T_cw;
  std::vector<std::int32_t> begin;
  std::vector<turbomap::vec3<double>> point, pixel;
  std::vector<double> information;
  std::vector<std::uint8_t> camera;
  turbomap_test::oracle_sights sights;
};

template <class Camera, class Policy>
nlohmann::json time_motion_only(const Policy& policy, const std::vector<recorded_adjustment<Camera>>& problems,
                                const std::vector<turbomap_test::cost_camera>& rig, int repetitions) {
  turbomap::context<Policy> ctx(policy);
  turbomap::motion_only<Camera, Policy> adjust(ctx);
  std::vector<sighted_frame> all;
  for (const auto& one : problems) all.emplace_back(one.problem.data, one.newest);
  const turbomap::motion_only_options options;
  std::vector<turbomap::posed_frame> poses;
  std::vector<std::uint8_t> outlier;
  const auto adjust_one = [&](const sighted_frame& in) {
    turbomap::motion_only_input<Camera> view;
    view.rig = problems[0].problem.view();
    view.T_cw = turbomap::span<const turbomap::rigid_transform<double>>(in.T_cw);
    view.begin = turbomap::span<const std::int32_t>(in.begin);
    view.point = turbomap::span<const turbomap::vec3<double>>(in.point);
    view.pixel = turbomap::span<const turbomap::vec3<double>>(in.pixel);
    view.information = turbomap::span<const double>(in.information);
    view.camera = turbomap::span<const std::uint8_t>(in.camera);
    adjust(ctx, view, options, poses, outlier);
  };
  const auto by_definition = [&](const sighted_frame& in) {
    return turbomap_test::motion_only_oracle(turbomap_test::frame_of(in.T_cw[0]), rig, in.sights);
  };
  // A round linearises every observation once at least (21 + 6 a residual), and looks once which are outliers.
  adjustment_floor floor;
  for (const auto& in : all) {
    adjust_one(in);
    const auto expected = by_definition(in);
    bool same = (poses[0].adjusted != 0) == expected.adjusted;
    const auto got = turbomap::to_isometry<double>(poses[0].T_cw);
    same = same && (Eigen::Vector3d(got.t.x, got.t.y, got.t.z) - expected.frame.t).norm() < 1e-6;
    for (std::size_t i = 0; i < expected.excess.size(); ++i) {
      if (std::abs(expected.excess[i] - 1) > 1e-4) same = same && (outlier[i] != 0) == (expected.excess[i] > 1);
      floor.multiply_adds += options.rounds * (in.sights.seen[i].stereo ? 3 : 2) * 27;
      floor.transforms += options.rounds * 2;
    }
    require_same(same, "motion_only");
  }
  const auto ours = [&] {
    for (const auto& in : all) adjust_one(in);
  };
  const auto oracle = [&] {
    for (const auto& in : all) by_definition(in);
  };
  return per_problem(interleave(repetitions, ours, oracle, floor.ms()), problems.size(), floor);
}

/// All of them. None where the recorded adjustments are inertial.
/// \tparam Camera  in double
template <class Camera, class Policy>
nlohmann::json run_adjustment_stages(const Policy& policy, const turbomap::recording& recording,
                                     const std::string& folder, int repetitions) {
  std::vector<recorded_adjustment<Camera>> problems;
  for (const std::int32_t iteration : recording.meta.snapshots) {
    const auto s = turbomap::read_adjustment_snapshot(recording, folder, iteration);
    if (!s || s->inertial) continue;
    recorded_adjustment<Camera> one;
    one.problem = turbomap_bundle::recorded_problem<Camera>(recording.meta, *s);
    one.options.numbers = turbomap::precision::float64;
    one.options.damping = turbomap::damping_rule::identity;  // the recorded system's
    one.options.max_iterations = s->iterations, one.options.initial_lambda = s->initial_lambda;
    one.peer_cost = robust_sum(
        turbomap_bundle::observation_costs(one.problem, turbomap_replay::peer_poses(*s), s->position_after_exact));
    for (std::size_t f = 0; f < s->keyframe.size(); ++f)
      if (s->fixed[f] == 0 && s->keyframe[f] >= s->keyframe[one.newest]) one.newest = f;
    problems.push_back(one);
  }
  nlohmann::json stages = nlohmann::json::object();
  if (problems.empty()) return stages;
  const auto rig = turbomap_test::recorded_cost_rig(recording.meta);
  stages["adjustment"] = time_adjustment(policy, problems, rig, repetitions);
  stages["motion_only"] = time_motion_only(policy, problems, rig, repetitions);
  return stages;
}

/// By the camera of the recording; or single calls.
template <class Policy>
nlohmann::json run_adjustments(const Policy& policy, const turbomap::recording& recording, const arguments& a) {
  if (!a.calls.empty()) return run_motion_only_calls(policy, a.repetitions);
  return recording.meta.is_fisheye()
             ? run_adjustment_stages<turbomap::kannala_brandt<double>>(policy, recording, a.recording, a.repetitions)
             : run_adjustment_stages<turbomap::pinhole<double>>(policy, recording, a.recording, a.repetitions);
}

}  // namespace turbomap_bench

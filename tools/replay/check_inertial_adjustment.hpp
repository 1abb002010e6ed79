// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Check of visual-inertial adjustment: the recorded problems adjusted with the recorded number of iterations, then cost,
/// poses and velocities compared. Costs of both results come from one function in float64.

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/inertial/merge.hpp>
#include <turbomap/io/recording.hpp>

#include "adjustment_comparison.hpp"
#include "bundle/recorded_inertial_problem.hpp"
#include "bundle/solve.hpp"

namespace turbomap_replay {

/// What the comparison has to hold.
struct inertial_adjustment_bounds {
  double worst_cost_ratio = 1 + 1e-4, median_cost_ratio = 1 + 1e-6;
  double pose_m = 1e-3, pose_rad = 1e-3, velocity = 1e-2;  ///< the worst; m, rad, m/s
};

template <class Camera, class Policy>
class inertial_adjustment_check {
 public:
  using camera = typename in_double<Camera>::type;
  using methods =
      turbomap::adjustment_methods<turbomap::solver_list<turbomap::reduced_solver::dense>,
                                   turbomap::precision_list<turbomap::precision::float64, turbomap::precision::mixed>>;

  inertial_adjustment_check(const turbomap::recording& recording, const std::filesystem::path& directory,
                            const Policy& policy, turbomap::precision numbers = turbomap::precision::float64,
                            int repeat = 3)
      : recording_(recording),
        directory_(directory),
        policy_(policy),
        numbers_(numbers),
        repeat_(repeat),
        times_(directory) {
    if (numbers_ == turbomap::precision::float32) numbers_ = turbomap::precision::mixed;  // what is compiled
  }

  /// Reads the adjustment of an iteration; one that is not there, or not inertial, is left out.
  void check(std::int32_t iteration) {
    const auto s = turbomap::read_adjustment_snapshot(recording_, directory_, iteration);
    if (!s || !s->inertial) return;
    const auto more = turbomap::read_inertial_snapshot(recording_, directory_, iteration, *s);
    const auto problem = turbomap_bundle::recorded_inertial_problem<camera>(
        recording_.meta, *s, more, turbomap::read_preintegration_snapshot(recording_, directory_, iteration));
    unusable_ += problem.unusable;
    turbomap::adjustment_options options;
    options.numbers = numbers_, options.damping = turbomap::damping_rule::identity;  // the peer's
    options.max_iterations = s->iterations, options.initial_lambda = s->initial_lambda;
    const auto ours = solve(problem, options);

    auto T_peer = peer_poses(*s);
    // The peer's matrices are products of float ones, off from rotations by 5e-7: its result is the nearest rotations.
    for (auto& T : T_peer) T.R = turbomap::detail::orthonormalised(T.R);
    for (std::size_t i = s->optimised; i < T_peer.size(); ++i)
      T_peer[i] = turbomap::to_isometry<double>(problem.visual.data.T_cw[i]);
    std::vector<turbomap::isometry<double>> T_ours;
    std::vector<turbomap::inertial_state<double>> peer;
    for (std::size_t i = 0; i < s->keyframe.size(); ++i) {
      T_ours.push_back(turbomap::to_isometry<double>(ours.frames[i].T_cw));
      peer.push_back(turbomap_bundle::state_of(turbomap::to_rigid_transform(T_peer[i]), more.velocity_after[i],
                                               more.bias_after[i]));
      if (s->fixed[i] != 0) continue;
      const pose_difference d = compare_poses(T_ours.back(), T_peer[i]);
      metres_.push_back(d.metres), radians_.push_back(d.radians);
      velocities_.push_back(turbomap::norm(ours.frames[i].velocity - peer.back().velocity));
    }
    const double before = cost(problem, turbomap_bundle::isometries_of(problem.visual.data.T_cw),
                               problem.visual.data.points, problem.states);
    const double ratio =
        cost(problem, T_ours, ours.landmarks, ours.frames) / cost(problem, T_peer, s->position_after_exact, peer);
    before_.push_back(std::abs(before / s->robust_cost_before - 1));
    ratios_.push_back(ratio);
    if (!(ratio <= bounds_.worst_cost_ratio))
      std::printf("inertial adjustment: snapshot %d: cost %.9g of the peer's\n", iteration, ratio);
    times_.add(iteration, ours);
  }

  bool empty() const { return ratios_.empty(); }

  void add_json(nlohmann::json& json) const {
    using turbomap_bundle::median;
    json["inertial_adjustment"] = {{"problems", ratios_.size()},
                                   {"unusable_edges", unusable_},
                                   {"cost_before_error", largest_of(before_)},
                                   {"cost_ratio_max", largest_of(ratios_)},
                                   {"cost_ratio_median", median(ratios_)},
                                   {"pose_max_m", largest_of(metres_)},
                                   {"pose_max_rad", largest_of(radians_)},
                                   {"velocity_max", largest_of(velocities_)}};
    times_.add_json(json["inertial_adjustment"]);
  }
  bool good() const {
    return unusable_ == 0 && largest_of(ratios_) <= bounds_.worst_cost_ratio &&
           turbomap_bundle::median(ratios_) <= bounds_.median_cost_ratio && largest_of(metres_) <= bounds_.pose_m &&
           largest_of(radians_) <= bounds_.pose_rad && largest_of(velocities_) <= bounds_.velocity;
  }

 private:
  using problem_type = turbomap_bundle::inertial_rig_problem<camera>;

  turbomap_bundle::solution<turbomap::inertial_state<double>> solve(const problem_type& p,
                                                                    const turbomap::adjustment_options& options) const {
    using edges = turbomap::inertial_edges;
    using bundle = turbomap::bundle_problem<Policy, turbomap::inertial_frame, turbomap::reprojections<camera>,
                                            edges::factors, edges::robust_factors, edges::walk_factors>;
    const auto& d = p.visual.data;
    const auto seen = turbomap_bundle::reprojections_of(p.visual, turbomap::huber{5.991}, turbomap::huber{7.815});
    return turbomap_bundle::solve<bundle, methods>(policy_, repeat_, options, [&](auto& ctx, auto& to) {
      to.assign(ctx, {p.states, d.fixed, {}}, {{d.points.data(), d.points.size()}}, seen, p.edges.plain(p.factor),
                p.edges.robust(p.factor, p.window), p.edges.walks());
    });
  }
  static double cost(const problem_type& p, const std::vector<turbomap::isometry<double>>& T_cw,
                     const std::vector<turbomap::vec3<double>>& points,
                     const std::vector<turbomap::inertial_state<double>>& states) {
    return turbomap_bundle::robust_sum(turbomap_bundle::observation_costs(p.visual, T_cw, points)) +
           turbomap_bundle::inertial_cost(p, states);
  }

  const turbomap::recording& recording_;
  std::filesystem::path directory_;
  Policy policy_;
  turbomap::precision numbers_;
  int repeat_;
  adjustment_times times_;
  inertial_adjustment_bounds bounds_;
  std::vector<double> before_, ratios_, metres_, radians_, velocities_;
  std::size_t unusable_ = 0;
};

}  // namespace turbomap_replay

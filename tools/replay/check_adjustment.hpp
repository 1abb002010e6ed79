// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Check of the visual local bundle adjustment: the recorded problems adjusted with the recorded number of iterations,
/// then cost, poses and outliers compared. Costs of both results come from one function in float64.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/io/recording.hpp>
#include "readers/recording_snapshot_adjustment.hpp"

#include "adjustment_comparison.hpp"
#include "bundle/recorded_problem.hpp"
#include "bundle/solve.hpp"

namespace turbomap_replay {

/// What the comparison has to hold.
struct adjustment_bounds {
  double worst_cost_ratio = 1 + 1e-4, median_cost_ratio = 1 + 1e-6;
  double pose_m = 1e-3, pose_rad = 1e-3;                ///< the worst
  double median_pose_m = 1e-5, median_pose_rad = 1e-5;  ///< of all keyframes
  double outlier_agree = 0.98;
};

template <class Camera, class Policy>
class adjustment_check {
 public:
  using camera = typename in_double<Camera>::type;

  /// \param repeat  adjustments of each problem, to time them
  adjustment_check(const turbomap::recording& recording, const std::filesystem::path& directory, const Policy& policy,
                   turbomap::precision numbers = turbomap::precision::float64, int repeat = 3)
      : recording_(recording),
        directory_(directory),
        policy_(policy),
        numbers_(numbers),
        repeat_(repeat),
        times_(directory) {}

  /// Reads the adjustment of an iteration; one that is not there, or inertial, is left out.
  void check(std::int32_t iteration) {
    const auto s = turbomap::read_adjustment_snapshot(recording_, directory_, iteration);
    if (!s || s->inertial) return;
    const auto problem = turbomap_bundle::recorded_problem<camera>(recording_.meta, *s);
    turbomap::adjustment_options options;
    options.numbers = numbers_, options.damping = turbomap::damping_rule::identity;  // the peer's
    options.max_iterations = s->iterations, options.initial_lambda = s->initial_lambda;
    const auto ours = turbomap_bundle::solve_rig(policy_, repeat_, options, problem);

    std::vector<turbomap::isometry<double>> T_ours;
    const auto T_peer = peer_poses(*s);
    for (std::size_t i = 0; i < s->keyframe.size(); ++i) {
      T_ours.push_back(turbomap::to_isometry<double>(ours.frames[i]));
      if (s->fixed[i] != 0) continue;
      const pose_difference d = compare_poses(T_ours.back(), T_peer[i]);
      metres_.push_back(d.metres), radians_.push_back(d.radians);
    }
    const auto our_costs = turbomap_bundle::observation_costs(problem, T_ours, ours.landmarks);
    const auto peer_costs = turbomap_bundle::observation_costs(problem, T_peer, s->position_after_exact);
    const double ratio = turbomap_bundle::robust_sum(our_costs) / turbomap_bundle::robust_sum(peer_costs);
    ratios_.push_back(ratio);
    if (!(ratio <= bounds_.worst_cost_ratio))
      std::printf("adjustment: snapshot %d: cost %.9g of the peer's\n", iteration, ratio);
    count_outliers(*s, our_costs);
    times_.add(iteration, ours);
  }

  bool empty() const { return ratios_.empty(); }

  void add_json(nlohmann::json& json) const {
    using turbomap_bundle::median;
    json["adjustment"] = {{"problems", ratios_.size()},
                          {"chi2_ratio_max", largest_of(ratios_)},
                          {"chi2_ratio_median", median(ratios_)},
                          {"pose_max_m", largest_of(metres_)},
                          {"pose_max_rad", largest_of(radians_)},
                          {"pose_median_m", median(metres_)},
                          {"pose_median_rad", median(radians_)},
                          {"outlier_agree", outlier_agree()},
                          {"outliers", either_}};
    times_.add_json(json["adjustment"]);
  }
  bool good() const {
    using turbomap_bundle::median;
    return largest_of(ratios_) <= bounds_.worst_cost_ratio && median(ratios_) <= bounds_.median_cost_ratio &&
           largest_of(metres_) <= bounds_.pose_m && largest_of(radians_) <= bounds_.pose_rad &&
           median(metres_) <= bounds_.median_pose_m && median(radians_) <= bounds_.median_pose_rad &&
           outlier_agree() >= bounds_.outlier_agree;
  }

 private:
  void count_outliers(const turbomap::adjustment_snapshot& s,
                      const std::vector<turbomap_bundle::observation_cost>& costs) {
    for (std::size_t i = 0; i < costs.size(); ++i) {
      const double limit = s.kind[i] == turbomap::recorded_residual::stereo ? 7.815 : 5.991;
      const bool ours = costs[i].chi2 > limit || !(costs[i].depth > 0), theirs = s.outlier[i] != 0;
      both_ += ours && theirs ? 1 : 0, either_ += ours || theirs ? 1 : 0;
    }
  }
  double outlier_agree() const { return either_ == 0 ? 1 : static_cast<double>(both_) / static_cast<double>(either_); }

  const turbomap::recording& recording_;
  std::filesystem::path directory_;
  Policy policy_;
  turbomap::precision numbers_;
  int repeat_;
  adjustment_times times_;
  adjustment_bounds bounds_;
  std::vector<double> ratios_, metres_, radians_;
  std::size_t both_ = 0, either_ = 0;
};

}  // namespace turbomap_replay

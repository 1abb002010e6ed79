// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Check of preintegration: the recorded ones made again from the raw samples.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/inertial/preintegrate.hpp>
#include <turbomap/io/recording.hpp>
#include "readers/recording_snapshot_preintegration.hpp"

namespace turbomap_replay {

/// Integrates all intervals of a snapshot in one call of the policy, from frame to frame as the peer does, and merges
/// them from keyframe to keyframe.
template <class Policy>
class preintegration_check {
 public:
  static constexpr double bound = 1e-5;  ///< relative; recorded in float

  preintegration_check(const turbomap::recording& recording, const std::filesystem::path& directory,
                       const Policy& policy)
      : recording_(recording), directory_(directory), ctx_(policy), result_(ctx_) {
    const auto& meta = recording.meta;
    if (!recording.has_imu() || meta.imu_noise_variance.size() != 6 || meta.imu_walk_variance.size() != 6) return;
    // The recorded variances are those of one step.
    options_.noise = {std::sqrt(meta.imu_noise_variance[0]), std::sqrt(meta.imu_noise_variance[3]),
                      std::sqrt(meta.imu_walk_variance[0]), std::sqrt(meta.imu_walk_variance[3]), 1};
    options_.rule = turbomap::integration_rule::first_order;
    options_.max_gap = options_.max_extrapolation = 1;  // s: the peer looks at neither
  }

  /// Reads the preintegrations of an iteration; none, or a recording without samples, is left out.
  void check(std::int32_t iteration) {
    if (options_.noise.rate == 0) return;
    check(turbomap::read_preintegration_snapshot(recording_, directory_, iteration));
  }
  void check(const std::vector<turbomap::recorded_preintegration>& recorded) {
    std::vector<turbomap::imu_interval> intervals;
    std::vector<turbomap::imu_bias<double>> biases;
    std::vector<std::size_t> begin{0};
    for (const auto& r : recorded) {
      cut(time_of(r.from), time_of(r.to), intervals);
      const auto& b = r.bias;
      biases.resize(intervals.size(), {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}});
      begin.push_back(intervals.size());
    }
    using turbomap::span;
    turbomap::preintegrate(ctx_, {recording_.imu_t_ns, recording_.imu}, span<const turbomap::imu_interval>(intervals),
                           span<const turbomap::imu_bias<double>>(biases), options_, result_);
    const auto pieces = result_.values(ctx_);
    for (std::size_t i = 0; i < recorded.size(); ++i) {
      auto p = pieces[begin[i]];
      for (std::size_t k = begin[i] + 1; k < begin[i + 1]; ++k) p = turbomap::merge(p, pieces[k]);
      const double e = error(p, recorded[i]);
      if (!(e <= bound))
        std::printf("preintegration: keyframes %d to %d: off by %.3g\n", recorded[i].from, recorded[i].to, e);
      worst_ = e > worst_ || std::isnan(e) ? e : worst_;
    }
    edges_ += recorded.size();
  }

  bool empty() const { return edges_ == 0; }
  void add_json(nlohmann::json& json) const {
    json["preintegration"] = {{"edges", edges_}, {"max_relative_error", worst_}};
  }
  bool good() const { return worst_ <= bound; }

 private:
  std::int64_t time_of(std::int32_t keyframe) const { return recording_.t_ns[static_cast<std::size_t>(keyframe)]; }

  /// Pieces from frame to frame. The peer knows the samples up to the time of a frame only, extrapolates to it, and
  /// takes a sample of the last millisecond as the first one of the next piece too.
  void cut(std::int64_t from, std::int64_t to, std::vector<turbomap::imu_interval>& pieces) const {
    constexpr std::int64_t early = 1'000'000;
    const auto& t = recording_.imu_t_ns;
    const auto first_from = [&](std::int64_t time) { return std::lower_bound(t.begin(), t.end(), time) - t.begin(); };
    const auto& frames = recording_.frame_t_ns;
    auto frame = std::upper_bound(frames.begin(), frames.end(), from + early);  // times of keyframes are rounded
    for (std::int64_t begin = from; begin < to;) {
      const std::int64_t end = frame == frames.end() || *frame > to - early ? to : *frame++;
      auto last = first_from(end - early);
      if (last == static_cast<std::ptrdiff_t>(t.size()) || t[static_cast<std::size_t>(last)] > end) --last;
      pieces.push_back(
          {begin, end, static_cast<std::int32_t>(first_from(begin - early)), static_cast<std::int32_t>(last)});
      begin = end;
    }
  }

  /// The largest of the parts' relative errors, each by its norm.
  static double error(const turbomap::preintegration<double>& p, const turbomap::recorded_preintegration& r) {
    double worst = 0;
    const auto compare = [&](const double* a, const float* b, int n) {
      double difference = 0, size = 0;
      for (int i = 0; i < n; ++i) {
        const double d = a[i] - static_cast<double>(b[i]);
        difference += d * d, size += static_cast<double>(b[i]) * static_cast<double>(b[i]);
      }
      const double e = std::sqrt(difference / size);
      worst = e > worst || std::isnan(e) ? e : worst;
    };
    compare(&p.dt, &r.dT, 1);
    compare(&p.dV.x, &r.dV.x, 3), compare(&p.dP.x, &r.dP.x, 3);
    const turbomap::mat3<double>* const ours[6] = {&p.dR, &p.J_Rg, &p.J_Vg, &p.J_Va, &p.J_Pg, &p.J_Pa};
    const turbomap::mat3<float>* const theirs[6] = {&r.dR, &r.J_Rg, &r.J_Vg, &r.J_Va, &r.J_Pg, &r.J_Pa};
    for (int k = 0; k < 6; ++k) compare(ours[k]->m, theirs[k]->m, 9);
    for (const int block : {0, 9, 12}) {  // the motion, each walk
      const int size = block == 0 ? 9 : 3;
      std::vector<double> a;
      std::vector<float> b;
      for (int row = block; row < block + size; ++row)
        for (int column = block; column < block + size; ++column)
          a.push_back(p.covariance(row, column)), b.push_back(r.C[static_cast<std::size_t>(15 * row + column)]);
      compare(a.data(), b.data(), size * size);
    }
    return worst;
  }

  const turbomap::recording& recording_;
  std::filesystem::path directory_;
  turbomap::context<Policy> ctx_;
  turbomap::preintegrations<double, Policy> result_;
  turbomap::preintegration_options options_;  ///< noise.rate 0: the recording has no IMU
  std::size_t edges_ = 0;
  double worst_ = 0;
};

}  // namespace turbomap_replay

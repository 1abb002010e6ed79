// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Times of the stages of a replay, and their table.

#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/mapping/duration_statistics.hpp>
#include <turbomap/mapping/mapping_report.hpp>

namespace turbomap_replay {

/// Milliseconds since an arbitrary moment.
inline double now_ms() {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Keyframes left out of the statistics, as in the recorded ones: the map is small before.
inline constexpr std::size_t warm_up = 11;

/// Columns of the peer's table for each stage of ours: its time is that of the first, less the second, which is nested there.
inline constexpr const char* peer_columns[turbomap::mapping_stages][2] = {
    {"ms_process", nullptr}, {"ms_mpculling", nullptr}, {"ms_sft", nullptr},      {"ms_createnew", "ms_sft"},
    {"ms_fuse", nullptr},    {"ms_lba", nullptr},       {"ms_cull_orig", nullptr}};
/// \param value  of a column by its name; NaN where the table has none
template <class Value>
double peer_ms(turbomap::mapping_stage stage, const Value& value) {
  const auto& [whole, nested] = peer_columns[static_cast<std::size_t>(stage)];
  return value(whole) - (nested != nullptr ? value(nested) : 0);
}

/// The samples of one stage, one per keyframe.
struct stage_samples {
  std::string name;
  double peer_ms_mean = -1;  ///< < 0: not recorded
  turbomap::duration_statistics ms;

  double mean() const { return ms.mean(); }
  /// Standard deviation of the samples; 0 of fewer than two.
  double deviation() const {
    const double center = mean();
    double squares = 0;
    for (const double t : ms.samples()) squares += (t - center) * (t - center);
    return ms.count() < 2 ? 0 : std::sqrt(squares / static_cast<double>(ms.count() - 1));
  }
  double quantile(double q) const { return ms.quantile(q); }
  nlohmann::json json() const {
    if (ms.count() == 0) return {{"ms_mean", nullptr}};
    nlohmann::json j = {{"ms_mean", mean()},
                        {"ms_std", deviation()},
                        {"ms_median", quantile(0.5)},
                        {"ms_p95", quantile(0.95)},
                        {"ms_max", quantile(1)}};
    if (peer_ms_mean >= 0) j["peer_ms_mean"] = peer_ms_mean;
    return j;
  }
};

inline void print_table(const std::vector<stage_samples>& stages) {
  std::printf("%-16s %10s %10s %10s %10s %10s %8s\n", "stage (ms)", "mean", "median", "p95", "max", "peer mean",
              "ratio");
  for (const stage_samples& s : stages) {
    if (s.ms.count() == 0) {
      std::printf("%-16s no keyframe after the first %zu: they are not counted\n", s.name.c_str(), warm_up);
      continue;
    }
    std::printf("%-16s %10.3f %10.3f %10.3f %10.3f", s.name.c_str(), s.mean(), s.quantile(0.5), s.quantile(0.95),
                s.quantile(1));
    if (s.peer_ms_mean >= 0)
      std::printf(" %10.3f %7.1fx\n", s.peer_ms_mean, s.peer_ms_mean / s.mean());
    else
      std::printf(" %10s %8s\n", "-", "-");
  }
}

}  // namespace turbomap_replay

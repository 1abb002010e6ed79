// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What an inertial adjustment of a recording has beside its poses and points (`lba_vel_*`, `lba_bias_*`): velocities and
/// biases of the keyframes before and after.

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include <turbomap/config.hpp>
#include <turbomap/types.hpp>
#include "recording_snapshot_adjustment.hpp"

namespace turbomap {

/// One row per keyframe of the adjustment_snapshot.
struct inertial_snapshot {
  bool all_robust = false;  ///< every inertial edge has the robust kernel, not the oldest alone
  std::vector<vec3<float>> velocity_before, velocity_after;   ///< m/s
  std::vector<std::array<float, 6>> bias_before, bias_after;  ///< gyroscope (rad/s), accelerometer (m/s^2)
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Of an iteration whose adjustment `s` is inertial. Throws bad_file naming file, array and reason.
inline inertial_snapshot read_inertial_snapshot(const recording& r, const std::filesystem::path& directory,
                                                std::int32_t iteration, const adjustment_snapshot& s) {
  const auto where = snapshot_directory(directory, iteration);
  const detail::snapshot_source from{r, where, detail::array_checks(where)};
  const detail::json_reader meta(where / "meta.json");
  inertial_snapshot out;
  out.all_robust = meta.member<double>("lba", meta.json()["lba"], "bRecInit") != 0;
  const std::size_t n = s.keyframe.size();
  from.read_finite("lba_vel_before", out.velocity_before, n);
  from.read_finite("lba_vel_after", out.velocity_after, n);
  from.read_finite("lba_bias_before", out.bias_before, n);
  from.read_finite("lba_bias_after", out.bias_after, n);
  return out;
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The recorded preintegrations of one iteration's inertial adjustment (`lba_imu_*`): one per optimised keyframe, from
/// the keyframe before it.

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include <turbomap/config.hpp>
#include <turbomap/types.hpp>
#include "recording_snapshot_source.hpp"

namespace turbomap {

/// As the peer holds it (float). Matrices are row-major.
struct recorded_preintegration {
  std::int32_t from = 0, to = 0;  ///< keyframes
  float dT = 0;
  mat3<float> dR{}, J_Rg{}, J_Vg{}, J_Va{}, J_Pg{}, J_Pa{};
  vec3<float> dV{}, dP{};
  std::array<float, 225> C{};   ///< rotation, velocity, position, gyroscope walk, accelerometer walk
  std::array<float, 6> bias{};  ///< gyroscope, accelerometer: of the integration
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Reads and validates the preintegrations of an iteration of the recording in `directory`; none when it has none.
/// Throws bad_file naming file, array and reason.
inline std::vector<recorded_preintegration> read_preintegration_snapshot(const recording& r,
                                                                         const std::filesystem::path& directory,
                                                                         std::int32_t iteration) {
  const auto where = snapshot_directory(directory, iteration);
  const detail::snapshot_source from{r, where, detail::array_checks(where)};
  std::vector<recorded_preintegration> result;
  if (!from.has_group({"lba_imu_has", "lba_imu_prev", "lba_imu_dT", "lba_imu_C"})) return result;
  std::vector<std::int32_t> keyframe, previous;
  std::vector<std::uint8_t> has;
  from.read("lba_kf", keyframe);
  from.read("lba_imu_has", has);
  from.read("lba_imu_prev", previous, has.size());
  from.check.in_range("lba_kf", keyframe, 0, from.keyframe_count());
  from.check.in_range("lba_imu_has", has, 0, 2);
  if (has.size() > keyframe.size()) from.check.fail("lba_imu_has", "has more rows than lba_kf");

  const std::size_t n = has.size();
  std::vector<float> dT;
  std::vector<vec3<float>> dV, dP;
  std::vector<std::array<float, 6>> bias;
  from.read_finite("lba_imu_dT", dT, n);
  from.read_finite("lba_imu_dV", dV, n);
  from.read_finite("lba_imu_dP", dP, n);
  from.read_finite("lba_imu_bias_orig", bias, n);
  const auto matrices = [&](const char* name, std::size_t size) {
    std::vector<float> values;
    from.read_shape(name, values, {n, size, size});
    from.check.finite(name, values);
    return values;
  };
  const char* const names[6] = {"lba_imu_dR",  "lba_imu_JRg", "lba_imu_JVg",
                                "lba_imu_JVa", "lba_imu_JPg", "lba_imu_JPa"};
  std::vector<float> matrix[6];
  for (int k = 0; k < 6; ++k) matrix[k] = matrices(names[k], 3);
  const std::vector<float> C = matrices("lba_imu_C", 15);

  for (std::size_t i = 0; i < n; ++i) {
    if (has[i] == 0) continue;
    if (previous[i] < 0 || static_cast<std::size_t>(previous[i]) >= keyframe.size())
      from.check.fail_row("lba_imu_prev", i, "is no row of lba_kf");
    recorded_preintegration p;
    p.from = keyframe[static_cast<std::size_t>(previous[i])], p.to = keyframe[i];
    if (!(r.t_ns[static_cast<std::size_t>(p.from)] < r.t_ns[static_cast<std::size_t>(p.to)]))
      from.check.fail_row("lba_imu_prev", i, "is not an earlier keyframe");
    p.dT = dT[i], p.dV = dV[i], p.dP = dP[i], p.bias = bias[i];
    mat3<float>* const to[6] = {&p.dR, &p.J_Rg, &p.J_Vg, &p.J_Va, &p.J_Pg, &p.J_Pa};
    for (int k = 0; k < 6; ++k)
      for (std::size_t j = 0; j < 9; ++j) to[k]->m[j] = matrix[k][9 * i + j];
    for (std::size_t j = 0; j < 225; ++j) p.C[j] = C[225 * i + j];
    result.push_back(p);
  }
  return result;
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A recorded visual-inertial adjustment: as the library takes it, and what its inertial edges cost, by one function.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <turbomap/adjustment/factors.hpp>
#include <turbomap/inertial/inertial_edges.hpp>
#include <turbomap/inertial/inertial_frame.hpp>
#include <turbomap/io/recording.hpp>
#include "readers/recording_snapshot_inertial.hpp"
#include "readers/recording_snapshot_preintegration.hpp"
#include "recorded_problem.hpp"

namespace turbomap_bundle {

inline turbomap::preintegration<double> in_double(const turbomap::recorded_preintegration& r) {
  using turbomap::cast;
  turbomap::preintegration<double> p;
  p.dt = r.dT, p.bias = {{r.bias[0], r.bias[1], r.bias[2]}, {r.bias[3], r.bias[4], r.bias[5]}};
  p.dR = cast<double>(r.dR), p.dV = cast<double>(r.dV), p.dP = cast<double>(r.dP);
  p.J_Rg = cast<double>(r.J_Rg), p.J_Vg = cast<double>(r.J_Vg), p.J_Va = cast<double>(r.J_Va);
  p.J_Pg = cast<double>(r.J_Pg), p.J_Pa = cast<double>(r.J_Pa);
  const auto C = [&r](int row, int column) {
    return static_cast<double>(r.C[static_cast<std::size_t>(15 * row + column)]);
  };
  turbomap::mat3<double>* const lower[6] = {&p.C_RR, &p.C_VR, &p.C_VV, &p.C_PR, &p.C_PV, &p.C_PP};
  for (int row = 0, k = 0; row < 3; ++row)
    for (int column = 0; column <= row; ++column, ++k)
      for (int i = 0; i < 9; ++i)  // the two halves differ in float: their mean
        lower[k]->m[i] = 0.5 * (C(3 * row + i / 3, 3 * column + i % 3) + C(3 * column + i % 3, 3 * row + i / 3));
  p.gyro_walk = C(9, 9), p.acceleration_walk = C(12, 12);
  return p;
}

inline turbomap::inertial_state<double> state_of(const turbomap::rigid_transform<double>& T_cw,
                                                 const turbomap::vec3<float>& velocity,
                                                 const std::array<float, 6>& bias) {
  return {T_cw, turbomap::cast<double>(velocity), {{bias[0], bias[1], bias[2]}, {bias[3], bias[4], bias[5]}}};
}

template <class Camera>
struct inertial_rig_problem {
  rig_problem<Camera> visual;
  turbomap::inertial_factor factor;  ///< T_bc, gravity
  std::vector<turbomap::inertial_state<double>> states;
  turbomap::inertial_edges edges;
  turbomap::inertial_window_options window;
  std::size_t unusable = 0;  ///< edges whose covariance has no inverse
};

/// The recorded visual-inertial problem, in double.
template <class Camera>
inertial_rig_problem<Camera> recorded_inertial_problem(const turbomap::recording_meta& meta,
                                                       const turbomap::adjustment_snapshot& s,
                                                       const turbomap::inertial_snapshot& more,
                                                       const std::vector<turbomap::recorded_preintegration>& recorded) {
  inertial_rig_problem<Camera> p;
  p.visual = recorded_problem<Camera>(meta, s);
  for (auto& T : p.visual.data.T_cw) T = turbomap::normalised(T);  // as adjust() sees them
  p.factor.T_bc = turbomap::to_isometry<double>(turbomap::normalised(turbomap::cast<double>(meta.T_bc)));
  for (std::size_t f = 0; f < s.keyframe.size(); ++f)
    p.states.push_back(state_of(p.visual.data.T_cw[f], more.velocity_before[f], more.bias_before[f]));
  const auto row_of = [&s](std::int32_t keyframe) {
    std::size_t f = 0;
    while (s.keyframe[f] != keyframe) ++f;
    return static_cast<std::int32_t>(f);
  };
  p.window.all_robust = more.all_robust;
  std::int32_t oldest = 0;  // optimised keyframes come from new to old
  for (const auto& r : recorded) oldest = std::max(oldest, row_of(r.to));
  for (const auto& r : recorded) {
    const std::int32_t i = row_of(r.from), j = row_of(r.to);
    p.unusable += p.edges.add(i, j, in_double(r), j == oldest, p.window) ? 0 : 1;
  }
  return p;
}

inline std::vector<turbomap::isometry<double>> isometries_of(
    const std::vector<turbomap::rigid_transform<double>>& T_cw) {
  std::vector<turbomap::isometry<double>> result;
  for (const auto& T : T_cw) result.push_back(turbomap::to_isometry<double>(T));
  return result;
}

/// Robust cost of all inertial edges at any states.
template <class Camera>
double inertial_cost(const inertial_rig_problem<Camera>& p,
                     const std::vector<turbomap::inertial_state<double>>& states) {
  double total = 0;
  const auto add = [&](const auto& group, double delta2) {
    for (std::size_t k = 0; k < group.rows.size(); ++k) {
      double e[9], chi2 = 0;
      group.factor.residual(states[static_cast<std::size_t>(group.first[k])],
                            states[static_cast<std::size_t>(group.second[k])], group.rows[k], e);
      for (int i = 0; i < group.factor.size; ++i) chi2 += e[i] * e[i];
      total += chi2 <= delta2 ? chi2 : 2 * std::sqrt(delta2 * chi2) - delta2;
    }
  };
  add(p.edges.plain(p.factor), HUGE_VAL);
  add(p.edges.robust(p.factor, p.window), p.window.robust_chi2);
  add(p.edges.walks(), HUGE_VAL);
  return total;
}

}  // namespace turbomap_bundle

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// States and motions of an IMU, of which numbers are replaced by hostile ones.

#include <turbomap/inertial/inertial_frame.hpp>
#include <turbomap/inertial/preintegration.hpp>

#include "hostile.hpp"

namespace turbomap_fuzz {

using state = turbomap::inertial_state<double>;

inline void spoil_state(state& x, choices& c) {
  const unsigned what = c.byte() % 4;
  if (what == 0) spoil(x.T_cw, c);
  if (what == 1) x.velocity = c.vector(10);
  if (what == 2) x.bias.gyro = c.vector(1);
  if (what == 3) x.bias.acceleration = c.vector(10);
}
inline void spoil_motion(turbomap::preintegration<double>& p, choices& c) {
  turbomap::mat3<double>* const matrices[] = {&p.dR,   &p.J_Rg, &p.J_Vg, &p.J_Va, &p.J_Pg, &p.J_Pa,
                                              &p.C_RR, &p.C_VR, &p.C_VV, &p.C_PR, &p.C_PV, &p.C_PP};
  const unsigned what = c.byte() % 8;
  if (what == 0) p.dt = c.number(1);
  if (what == 1) p.dV = c.vector(10);
  if (what == 2) p.dP = c.vector(10);
  if (what == 3) p.bias.gyro = c.vector(1);
  if (what == 4) p.gyro_walk = c.number(1);
  if (what == 5) p.acceleration_walk = c.number(1);
  if (what > 5) matrices[c.below(12)]->m[c.below(9)] = c.number(1);
}
inline bool is_finite(const state& x) {
  return finite({x.velocity.x, x.velocity.y, x.velocity.z, x.bias.gyro.x, x.bias.gyro.y, x.bias.gyro.z,
                 x.bias.acceleration.x, x.bias.acceleration.y, x.bias.acceleration.z});
}

}  // namespace turbomap_fuzz

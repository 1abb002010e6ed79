// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The state of the next frame from that of the last one and what the IMU measured in between: the first guess of
/// tracking.

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/rotation.hpp"
#include "bias_update.hpp"
#include "preintegration.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Moves `from` by `p`, corrected to its bias; the bias stays.
/// \param gravity  in the world, m/s^2, e.g. {0, 0, -9.81}
/// \param T_bc     from the frame of the poses to the body, in which the IMU measures
template <class S>
TURBOMAP_HD inertial_state<S> predict(const inertial_state<S>& from, const preintegration<S>& p, const vec3<S>& gravity,
                                      const isometry<S>& T_bc = {identity3<S>(), {S(0), S(0), S(0)}}) {
  const relative_motion<S> m = corrected(p, from.bias);
  const isometry<S> T_wb = inverse(T_bc * to_isometry<S>(normalised(from.T_cw)));
  inertial_state<S> to = from;
  to.velocity = from.velocity + p.dt * gravity + T_wb.R * m.dV;
  const vec3<S> position = T_wb.t + p.dt * from.velocity + (S(0.5) * p.dt * p.dt) * gravity + T_wb.R * m.dP;
  to.T_cw = to_rigid_transform(inverse(isometry<S>{T_wb.R * m.dR, position} * T_bc));
  return to;
}

TURBOMAP_END_NAMESPACE

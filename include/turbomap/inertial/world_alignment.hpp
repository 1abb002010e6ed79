// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Takes a visual map into a world in metres whose gravity points along -z: what is applied to every pose, point and velocity once
/// the IMU is initialised.

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/rotation.hpp"
#include "initialisation_options.hpp"
#include "preintegration.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// From the old world to the new one: x' = scale R x. The origin stays.
struct world_alignment {
  mat3<double> R{{1, 0, 0, 0, 1, 0, 0, 0, 1}};  ///< old world to new one
  double scale = 1;                             ///< new metres per unit of the old world
};

/// The alignment that an initialisation asks for: the shortest turn that takes gravity to -z.
inline world_alignment alignment_of(const initialisation& found) {
  const vec3<double> down{0, 0, -1}, g = (1 / norm(found.gravity)) * found.gravity;
  const vec3<double> axis = cross(g, down);
  const double sine = norm(axis), cosine = dot(g, down);
  world_alignment a;
  a.scale = found.scale;
  if (sine > 1e-12) {
    a.R = rotation_exp((std::atan2(sine, cosine) / sine) * axis);
  } else if (cosine < 0) {
    a.R = {{1, 0, 0, 0, -1, 0, 0, 0, -1}};  // half a turn about x
  }
  return a;
}

/// A point of the old world in the new one, m.
inline vec3<double> aligned_point(const world_alignment& a, const vec3<double>& x) { return a.scale * (a.R * x); }

/// \param T_cw  its unit of length is that of the old world
inline rigid_transform<double> aligned_pose(const world_alignment& a, const rigid_transform<double>& T_cw) {
  const isometry<double> T = to_isometry<double>(normalised(T_cw));
  return to_rigid_transform(isometry<double>{T.R * transpose(a.R), a.scale * T.t});
}

/// \param velocity  in metres per second already, as initialise_inertial() gives it: it is turned, not scaled
inline vec3<double> aligned_velocity(const world_alignment& a, const vec3<double>& velocity) { return a.R * velocity; }

/// What an initialisation says of keyframe k, in the new world.
inline inertial_state<double> aligned_state(const world_alignment& a, const initialisation& found,
                                            const rigid_transform<double>& T_cw, std::size_t k) {
  return {aligned_pose(a, T_cw), aligned_velocity(a, found.velocity[k]), found.bias};
}

TURBOMAP_END_NAMESPACE

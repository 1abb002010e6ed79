// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A visual map does not know where down is, how fast the body moves, what its IMU measures wrongly and, with one camera, how
/// long a metre is. All of that follows from comparing the poses of some keyframes with what the IMU measured between them: the
/// maximum a posteriori estimate of gravity's direction, scale, velocities and biases, with the poses fixed
/// [Campos, Montiel, Tardos: Inertial-only optimization for visual-inertial initialization, ICRA 2020].
///
/// Ours beyond it: the errors of the poses are estimated too, and positions are compared in the unit of the poses. So weak motion
/// gives a large standard deviation, not a scale that is too small, and the answer is 'not initialised'.

#include <cstddef>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "../math/number_checks.hpp"
#include "../math/rotation.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "initialisation_check.hpp"
#include "initialisation_options.hpp"
#include "initialiser.hpp"
#include "preintegration.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The estimate begins with a scale of 1: poses that move faster than 10 or slower than 0.1 of their units per second, of a map in
/// millimetres for example, are estimated in another unit, in which they move by one.
inline void estimate_in_metres(span<const rigid_transform<double>> T_cw, span<const preintegration<double>> motion,
                               const isometry<double>& T_bc, const initialisation_options& options,
                               initialisation& found) {
  double path = 0;
  for (std::size_t k = 1; k < T_cw.size(); ++k)
    path += norm(camera_centre(to_isometry<double>(normalised(T_cw[k]))) -
                 camera_centre(to_isometry<double>(normalised(T_cw[k - 1]))));
  const double unit = path / found.seconds;
  if (!options.monocular || !(unit > 0) || !is_finite(1 / unit) || (unit >= 0.1 && unit <= 10))
    return initialiser(T_cw, motion, T_bc, options).run(found);
  plain_vector<rigid_transform<double>> T(T_cw.size());
  for (std::size_t k = 0; k < T.size(); ++k) T[k] = T_cw[k], T[k].tx /= unit, T[k].ty /= unit, T[k].tz /= unit;
  initialisation_options in_that = options;
  in_that.position_sigma /= unit;
  initialiser(T, motion, T_bc, in_that).run(found);
  found.scale /= unit, found.position_sigma *= unit;
}

}  // namespace detail

/// Estimates gravity, velocities, biases and, for one camera, the scale from keyframes in the order of time.
/// \param T_cw     poses in the visual world, in metres, or, options.monocular, in any unit
/// \param motion   motion[k]: what the IMU measured from keyframe k to k + 1. One without duration, preintegration(), stands for
///                 a gap in the data: the answer is then 'interrupted', as no chain of velocities leads across
/// \param T_bc     camera to body, the frame of the IMU; metres
/// \return what was found; `end` says whether it may be used. There is no partial answer.
/// \throws std::invalid_argument  sizes, options, a pose or a preintegration that is not finite
/// Runs on the host, whatever the policy of the mapper: some dozen keyframes are too few for a device.
/// O(keyframes * iterations): about 3 us per keyframe and iteration.
inline initialisation initialise_inertial(span<const rigid_transform<double>> T_cw,
                                          span<const preintegration<double>> motion, const isometry<double>& T_bc,
                                          const initialisation_options& options = {}) {
  detail::check_initialisation_options(options);
  require(motion.size() + 1 == T_cw.size() || (motion.empty() && T_cw.empty()), "motion.size()", motion.size(),
          "must be one less than the poses");
  if (!is_pose(to_rigid_transform(T_bc))) reject("T_bc", norm(T_bc.t), "must be a pose");
  initialisation found;
  for (std::size_t i = 0; i < T_cw.size(); ++i)
    if (!is_pose(T_cw[i])) reject(argument_name("T_cw", i).text(), T_cw[i].tx, "must be a pose");
  for (std::size_t i = 0; i < motion.size(); ++i) {
    detail::check_motion(i, motion[i]);
    found.seconds += motion[i].dt;
    if (motion[i].dt == 0 && found.edge < 0) found.edge = static_cast<int>(i);
  }
  if (found.edge >= 0) {
    found.end = initialisation_end::interrupted;
  } else if (T_cw.size() < static_cast<std::size_t>(options.min_keyframes)) {
    found.end = initialisation_end::too_few_keyframes;
  } else if (found.seconds < options.min_seconds) {
    found.end = initialisation_end::too_short;
  } else {
    detail::estimate_in_metres(T_cw, motion, T_bc, options, found);
  }
  return found;
}

TURBOMAP_END_NAMESPACE

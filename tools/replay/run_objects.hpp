// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A replay on a map of objects, under the host policy that the arguments name. Its stages are compiled in units of their own:
/// run_objects.cpp, and run_inertial_objects.cpp with the IMU of the recording.

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>

#include "arguments.hpp"
#include "loop.hpp"

namespace turbomap_replay {

/// Without an IMU.
template <class Camera>
replay_result replay_visual_objects(const turbomap::recording& recording, const arguments& arguments);
/// With that of the recording.
template <class Camera>
replay_result replay_inertial_objects(const turbomap::recording& recording, const arguments& arguments);

/// \param arguments  whether the IMU takes part is decided
template <class Camera>
replay_result replay_objects(const turbomap::recording& recording, const arguments& arguments) {
  return arguments.imu == choice::yes ? replay_inertial_objects<Camera>(recording, arguments)
                                      : replay_visual_objects<Camera>(recording, arguments);
}

template <>
replay_result replay_visual_objects<turbomap::pinhole<float>>(const turbomap::recording& recording,
                                                              const arguments& arguments);
template <>
replay_result replay_visual_objects<turbomap::kannala_brandt<float>>(const turbomap::recording& recording,
                                                                     const arguments& arguments);
template <>
replay_result replay_inertial_objects<turbomap::pinhole<float>>(const turbomap::recording& recording,
                                                                const arguments& arguments);
template <>
replay_result replay_inertial_objects<turbomap::kannala_brandt<float>>(const turbomap::recording& recording,
                                                                       const arguments& arguments);

}  // namespace turbomap_replay

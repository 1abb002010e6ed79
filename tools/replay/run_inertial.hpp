// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A replay with the recording's IMU, under the host policy that the arguments name. Compiled in a unit of its own,
/// run_inertial.cpp.

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>

#include "arguments.hpp"
#include "loop.hpp"

namespace turbomap_replay {

template <class Camera>
replay_result replay_inertial(const turbomap::recording& recording, const arguments& arguments);

template <>
replay_result replay_inertial<turbomap::pinhole<float>>(const turbomap::recording& recording,
                                                        const arguments& arguments);
template <>
replay_result replay_inertial<turbomap::kannala_brandt<float>>(const turbomap::recording& recording,
                                                               const arguments& arguments);

}  // namespace turbomap_replay

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A replay with the recording's IMU. Compiled in units of its own: run_inertial.cpp for host policies,
/// cuda/replay_inertial.cu.

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>

#include "arguments.hpp"
#include "loop.hpp"

namespace turbomap_program {
class host_policy;
}

namespace turbomap_replay {

/// Under a device policy.
template <class Camera, class Policy>
replay_result replay_inertial(const turbomap::recording& recording, const Policy& policy, const arguments& arguments);

/// Under the host policy that the arguments name.
template <class Camera>
replay_result replay_inertial(const turbomap::recording& recording, const arguments& arguments);
template <class Camera>
replay_result replay_inertial(const turbomap::recording& recording, const turbomap_program::host_policy&,
                              const arguments& arguments) {
  return replay_inertial<Camera>(recording, arguments);
}

template <>
replay_result replay_inertial<turbomap::pinhole<float>>(const turbomap::recording& recording,
                                                        const arguments& arguments);
template <>
replay_result replay_inertial<turbomap::kannala_brandt<float>>(const turbomap::recording& recording,
                                                               const arguments& arguments);

}  // namespace turbomap_replay

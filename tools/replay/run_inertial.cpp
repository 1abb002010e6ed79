// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-replay with the IMU of a recording.

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/map/simple_map/simple_inertial_map.hpp>

#include "host_policy.hpp"
#include "recorded_imu.hpp"
#include "replay_on_body.hpp"

namespace turbomap_replay {

using turbomap::simple_inertial_map, turbomap_program::host_policy;

template replay_result replay_on<simple_inertial_map<orb, turbomap::pinhole<float>>, recorded_imu>(
    const turbomap::recording&, const host_policy&, const arguments&);
template replay_result replay_on<simple_inertial_map<orb, turbomap::kannala_brandt<float>>, recorded_imu>(
    const turbomap::recording&, const host_policy&, const arguments&);

}  // namespace turbomap_replay

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-replay --map objects, without an IMU.

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>

#include "host_policy.hpp"
#include "objects_map/objects_map.hpp"
#include "replay_on_body.hpp"

namespace turbomap_replay {

using turbomap_program::host_policy, turbomap_program::objects_map;

template replay_result replay_on<objects_map<turbomap::pinhole<float>>, no_imu>(const turbomap::recording&,
                                                                                const host_policy&, const arguments&);
template replay_result replay_on<objects_map<turbomap::kannala_brandt<float>>, no_imu>(const turbomap::recording&,
                                                                                       const host_policy&,
                                                                                       const arguments&);

}  // namespace turbomap_replay

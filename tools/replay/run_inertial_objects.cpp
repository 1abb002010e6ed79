// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-replay --map objects with the IMU of a recording.

#include "run_objects.hpp"

#include "host_policy.hpp"
#include "objects_map/inertial_objects_map.hpp"
#include "recorded_imu.hpp"

namespace turbomap_replay {
namespace {

template <class Camera>
replay_result run(const turbomap::recording& recording, const arguments& arguments) {
  using turbomap_program::host_policy;
  const host_policy policy(arguments.policy);
  using map = turbomap_program::inertial_objects_map<Camera>;
  return replayer<map, host_policy, recorded_imu>(recording, policy, arguments).run();
}

}  // namespace

template <>
replay_result replay_inertial_objects<turbomap::pinhole<float>>(const turbomap::recording& recording,
                                                                const arguments& arguments) {
  return run<turbomap::pinhole<float>>(recording, arguments);
}
template <>
replay_result replay_inertial_objects<turbomap::kannala_brandt<float>>(const turbomap::recording& recording,
                                                                       const arguments& arguments) {
  return run<turbomap::kannala_brandt<float>>(recording, arguments);
}

}  // namespace turbomap_replay

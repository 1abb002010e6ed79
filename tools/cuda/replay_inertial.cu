// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-replay with the IMU of a recording, under the CUDA policy.

#include "on_device.cuh"
#include "replay/recorded_imu.hpp"
#include "replay/run_inertial.hpp"

namespace turbomap_replay {
namespace {
using stream_policy = decltype(thrust::cuda::par_nosync.on(cudaStream_t{}));
}

template <class Camera, class Policy>
replay_result replay_inertial(const turbomap::recording& recording, const Policy& policy, const arguments& arguments) {
  return replayer<turbomap::simple_inertial_map<orb, Camera>, Policy, recorded_imu>(recording, policy, arguments).run();
}

template replay_result replay_inertial<turbomap::pinhole<float>>(const turbomap::recording&, const stream_policy&,
                                                                 const arguments&);
template replay_result replay_inertial<turbomap::kannala_brandt<float>>(const turbomap::recording&,
                                                                        const stream_policy&, const arguments&);

}  // namespace turbomap_replay

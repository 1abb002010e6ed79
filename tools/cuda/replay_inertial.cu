// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-replay with the IMU of a recording, under the CUDA policy.

#include <thrust/system/cuda/execution_policy.h>

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/map/simple_map/simple_inertial_map.hpp>

#include "replay/recorded_imu.hpp"
#include "replay/replay_on_body.hpp"

namespace turbomap_replay {
namespace {

using turbomap::simple_inertial_map;
using stream_policy = decltype(thrust::cuda::par_nosync.on(cudaStream_t{}));

}  // namespace

template replay_result replay_on<simple_inertial_map<orb, turbomap::pinhole<float>>, recorded_imu>(
    const turbomap::recording&, const stream_policy&, const arguments&);
template replay_result replay_on<simple_inertial_map<orb, turbomap::kannala_brandt<float>>, recorded_imu>(
    const turbomap::recording&, const stream_policy&, const arguments&);

}  // namespace turbomap_replay

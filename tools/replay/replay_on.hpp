// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A replay on one kind of map, declared only: it compiles all stages for that map, so each kind has a unit of its own.

#include <turbomap/io/recording.hpp>
#include <turbomap/map/simple_map/simple_inertial_map.hpp>

#include "arguments.hpp"

// Kinds of map, and what their units know of: named only.
namespace turbomap_program {
class host_policy;
template <class Camera>
class objects_map;
template <class Camera>
class inertial_objects_map;
}  // namespace turbomap_program

namespace turbomap_replay {

struct replay_result;
template <class Map, class Policy>
class recorded_imu;

/// replayer<Map, Policy, Imu>::run(). Host policies: run_objects.cpp, run_inertial.cpp, run_inertial_objects.cpp; CUDA:
/// cuda/replay_inertial.cu. They include replay_on_body.hpp and instantiate it for both camera models.
template <class Map, template <class, class> class Imu, class Policy>
replay_result replay_on(const turbomap::recording& recording, const Policy& policy, const arguments& arguments);

}  // namespace turbomap_replay

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A replay on a map of objects, under the host policy that the arguments name. Its stages are compiled in a unit of their own,
/// run_objects.cpp.

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>

#include "arguments.hpp"
#include "loop.hpp"

namespace turbomap_replay {

template <class Camera>
replay_result replay_objects(const turbomap::recording& recording, const arguments& arguments);

template <>
replay_result replay_objects<turbomap::pinhole<float>>(const turbomap::recording& recording,
                                                       const arguments& arguments);
template <>
replay_result replay_objects<turbomap::kannala_brandt<float>>(const turbomap::recording& recording,
                                                              const arguments& arguments);

}  // namespace turbomap_replay

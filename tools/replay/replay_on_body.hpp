// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The body of replay_on, for the units that instantiate it.

#include "loop.hpp"
#include "replay_on.hpp"

namespace turbomap_replay {

template <class Map, template <class, class> class Imu, class Policy>
replay_result replay_on(const turbomap::recording& recording, const Policy& policy, const arguments& arguments) {
  return replayer<Map, Policy, Imu>(recording, policy, arguments).run();
}

}  // namespace turbomap_replay

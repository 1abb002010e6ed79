// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Runs a check of turbomap-replay over the snapshots of the recordings, and over snapshots that a test has changed.

#include <turbomap/io/recording.hpp>
#include "readers/recording_snapshot.hpp"

#include <cstddef>
#include <filesystem>
#include <string>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "replay/recorded_scene.hpp"
#include "support/support.hpp"

namespace turbomap_test {

inline constexpr const char* recordings[] = {"euroc_v102_stereo", "euroc_v102_inertial", "tum_room1_stereo",
                                             "tum_room1_inertial"};

/// What a check says about all snapshots, each changed by `change` before.
struct verdict {
  nlohmann::json json;
  bool good = false;
};

inline std::size_t number(const nlohmann::json& json, const char* key) { return json[key].get<std::size_t>(); }

template <template <class, class> class Check, class Camera, class Policy, class Change>
verdict check_snapshots(const turbomap::recording& recording, const std::filesystem::path& directory,
                        const Policy& policy, std::size_t most, Change change) {
  turbomap_replay::recorded_scene<Camera, Policy> scene(recording, policy);
  Check<Camera, Policy> check(scene);
  std::size_t done = 0;
  for (const auto iteration : recording.meta.snapshots) {
    auto snapshot = turbomap::read_snapshot(recording, directory, iteration);
    change(snapshot);
    check.check(turbomap_replay::snapshot_scene<Camera, Policy>(scene, snapshot));
    if (++done == most) break;
  }
  verdict v;
  check.add_json(v.json);
  v.good = check.good();
  return v;
}

/// \param most  snapshots that are looked at, 0: all
template <template <class, class> class Check, class Policy, class Change>
verdict check_recording(const std::filesystem::path& directory, const Policy& policy, std::size_t most, Change change) {
  const auto r = turbomap::read_recording(directory);
  return r.meta.is_fisheye()
             ? check_snapshots<Check, turbomap::kannala_brandt<float>>(r, directory, policy, most, change)
             : check_snapshots<Check, turbomap::pinhole<float>>(r, directory, policy, most, change);
}
template <template <class, class> class Check, class Policy>
verdict check_recording(const std::filesystem::path& directory, const Policy& policy) {
  return check_recording<Check>(directory, policy, 0, [](turbomap::recording_snapshot&) {});
}

}  // namespace turbomap_test

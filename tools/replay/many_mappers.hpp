// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Several replays of one recording at a time: each has a thread, a map, a store, a context and, on a device, a stream of its own.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <functional>
#include <future>
#include <vector>

#include "arguments.hpp"

namespace turbomap_replay {

/// \param mappers  how many replays
/// \param run      one of them
/// \return what all did; not good where one is not, or where two maps differ
inline outcome replay_side_by_side(arguments a, std::size_t mappers,
                                   const std::function<outcome(const arguments&)>& run) {
  a.quiet = true;
  std::vector<std::future<outcome>> running;
  for (std::size_t m = 0; m < mappers; ++m)
    running.push_back(std::async(std::launch::async, [&run, &a] { return run(a); }));
  outcome all;
  double keyframes = 0, ms = 0;
  bool same = true;
  nlohmann::json digest;
  for (auto& one : running) {
    const outcome found = one.get();
    all.begin_ms = digest.is_null() ? found.begin_ms : std::min(all.begin_ms, found.begin_ms);
    all.end_ms = std::max(all.end_ms, found.end_ms);
    keyframes += a.repeat * found.json["keyframes"].get<double>();
    const auto& mean = found.json["stages"]["total"]["ms_mean"];
    ms += (mean.is_null() ? std::nan("") : mean.get<double>()) / static_cast<double>(mappers);
    if (digest.is_null()) digest = found.json["map_digest"];
    same = same && found.json["map_digest"] == digest;
    all.good = all.good && found.good;
  }
  all.good = all.good && same;
  const double per_second = 1000 * keyframes / (all.end_ms - all.begin_ms);
  all.json = {
      {"mappers", mappers}, {"policy", a.policy},   {"keyframes_per_second", per_second}, {"ms_per_keyframe", ms},
      {"same_map", same},   {"map_digest", digest}, {"recording", a.recording.string()}};
  std::printf("%zu mappers, policy %s: %.0f keyframes per second together, ", mappers, a.policy.c_str(), per_second);
  if (std::isfinite(ms)) std::printf("%.2f ms of mapping per keyframe of each; ", ms);
  std::printf("%s\n", same ? "the same map" : "MAPS DIFFER");
  return all;
}

}  // namespace turbomap_replay

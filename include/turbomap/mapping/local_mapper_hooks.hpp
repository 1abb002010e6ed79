// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What local mapping asks and tells the rest of the system.

#include <functional>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "mapping_report.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// What local mapping asks and tells the rest of the system. All hooks are optional. They are called on the mapper's thread,
/// and without the map's guard unless a comment says otherwise.
template <class Map>
struct local_mapper_hooks {
  static_assert(require_map_traits<Map>());
  using keyframe = detail::named_keyframe_t<Map>;  ///< the name of a keyframe.

  /// More keyframes wait: fusion, adjustment and keyframe culling are skipped for this one. Asked before each of them.
  std::function<bool()> keyframes_wait;
  /// Another thread (loop closing) wants the map to itself: asked before each stage; the rest of the iteration is skipped.
  std::function<bool()> stop;
  /// Adjusts poses and points around the keyframe, with write-back, in place of the mapper's own stage: for another solver.
  /// Called again, for the same keyframe, in each of local_mapper_options::extra_rounds (2 at most with accurate()).
  /// \param time_left_ms  infinite: no deadline
  std::function<void(Map&, keyframe, double time_left_ms)> adjust;
  /// A keyframe is about to be erased as redundant, under the map's guard: e.g. to keep its pose relative to a parent. It sees all its
  /// points yet. A large one is taken out under further holds of the guard, and stays if others keep it in between.
  std::function<void(keyframe)> erasing;
  /// A stage has ended; fusion and adjustment again in each of the extra rounds.
  std::function<void(mapping_stage, const mapping_report&)> stage_done;
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How many keyframes local mapping looks at around one, as plain data.

namespace turbomap {

/// Options of the neighbourhood. Defaults are those of [ORB-SLAM3]. None may be negative; 0 keyframes means none.
struct neighbourhood_options {
  int min_shared_points = 15;   ///< keyframes that share fewer are not covisible, unless no other is
  int neighbours = 10;          ///< best covisible keyframes; 30 without stereo depth
  int temporal_neighbours = 0;  ///< predecessors in time are added while there are fewer; 11 for inertial systems
  int second_neighbours = 20;   ///< duplicates are also looked for in so many covisible keyframes of each neighbour
  int temporal_targets = 0;     ///< predecessors in time are added while there are fewer targets; 20 inertial
};

}  // namespace turbomap

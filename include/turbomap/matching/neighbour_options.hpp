// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which neighbours are worth a search, as plain data.

namespace turbomap {

/// Options of the neighbour rules. Defaults are those of [ORB-SLAM3]. How many neighbours: neighbourhood_options.
struct neighbour_options {
  double min_baseline_depth_ratio = 0.01;  ///< monocular: baseline / median depth of the neighbour's points
};

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Looks up a visual word group in the index of a keyframe.

#include <cstdint>

#include "../config.hpp"
#include "../store/keyframe_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index of `group` among the ascending ids, or -1.
TURBOMAP_HD inline int find_group(const group_index_view& groups, std::uint32_t group) {
  int low = 0, high = groups.group_count;
  while (low < high) {
    const int middle = (low + high) / 2;
    if (groups.ids[middle] < group)
      low = middle + 1;
    else
      high = middle;
  }
  return low < groups.group_count && groups.ids[low] == group ? low : -1;
}

TURBOMAP_END_NAMESPACE

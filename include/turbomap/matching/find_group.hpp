// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Looks up a visual word group in the index of a keyframe.

#include <cstdint>

#include "../config.hpp"
#include "../first_where.hpp"
#include "../store/keyframe_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index of `group` among the ascending ids, or -1.
TURBOMAP_HD inline int find_group(const group_index_view& groups, std::uint32_t group) {
  const int g = first_where(0, groups.group_count, [&](int i) { return groups.ids[i] >= group; });
  return g < groups.group_count && groups.ids[g] == group ? g : -1;
}

TURBOMAP_END_NAMESPACE

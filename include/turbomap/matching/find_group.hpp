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

/// Whether there is a keypoint in the group with f(keypoint). The keypoints of no group are not asked: false.
template <class Function>
TURBOMAP_HD bool any_of_group(const group_index_view& groups, std::uint32_t group, const Function& f) {
  const int g = group == keypoint::no_group ? -1 : find_group(groups, group);
  if (g < 0) return false;
  const std::uint32_t end = groups.offsets[static_cast<std::size_t>(g) + 1];
  for (std::uint32_t k = groups.offsets[static_cast<std::size_t>(g)]; k < end; ++k)
    if (f(static_cast<std::int32_t>(groups.keypoints[k]))) return true;
  return false;
}

TURBOMAP_END_NAMESPACE

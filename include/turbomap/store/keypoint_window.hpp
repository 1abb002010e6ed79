// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The keypoints around a pixel, through the cell index of a keyframe.

#include <cstdint>

#include "../config.hpp"
#include "keyframe_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Cells first <= c <= last along one axis.
struct cell_range {
  int first, last;
};

/// Every cell that a coordinate between `low` and `high` can have been put into. Cells are rounded in float: by how
/// much that can be off grows with the number of cells.
TURBOMAP_HD inline cell_range cells_between(double low, double high, float minimum, float inverse_size, int count) {
  const double slack = 1e-3 + 1e-6 * count, origin = static_cast<double>(minimum);
  const double first = (low - origin) * static_cast<double>(inverse_size) + 0.5 - slack;
  const double last = (high - origin) * static_cast<double>(inverse_size) + 0.5 + slack;
  return {first > 0 ? (first < count ? static_cast<int>(first) : count) : 0,
          last < count ? (last >= 0 ? static_cast<int>(last) : -1) : count - 1};
}

}  // namespace detail

/// Calls visit(k) for every keypoint k of camera `camera` that the cell index holds within `radius_u`, `radius_v`
/// px of (u, v), and for some others near it, until visit() returns true. By cell column, cell row, keypoint; without a
/// cell index every keypoint of the camera, in order. O(keypoints in the cells).
template <class Descriptor, class Camera, class Visit>
TURBOMAP_HD void visit_window(const keyframe_view<Descriptor, Camera>& view, int camera, double u, double v,
                              double radius_u, double radius_v, Visit& visit) {
  const cell_index_view& cells = view.cells;
  if (cells.columns == 0) {
    for (int k = 0; k < view.keypoint_count; ++k)
      if (view.camera_of(k) == camera && visit(k)) return;
    return;
  }
  const auto columns =
      detail::cells_between(u - radius_u, u + radius_u, cells.bounds.min_x, cells.inverse_width, cells.columns);
  const auto rows =
      detail::cells_between(v - radius_v, v + radius_v, cells.bounds.min_y, cells.inverse_height, cells.rows);
  if (rows.first > rows.last) return;
  for (int column = columns.first; column <= columns.last; ++column) {
    // The cells of a column lie in a row: one list.
    const std::int64_t cell = (static_cast<std::int64_t>(camera) * cells.columns + column) * cells.rows;
    const std::uint32_t end = cells.offsets[static_cast<std::size_t>(cell + rows.last + 1)];
    for (std::uint32_t i = cells.offsets[static_cast<std::size_t>(cell + rows.first)]; i < end; ++i)
      if (visit(static_cast<int>(cells.keypoints[i]))) return;
  }
}

TURBOMAP_END_NAMESPACE

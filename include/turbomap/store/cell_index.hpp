// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which cell of the grid a pixel lies in: the same answer wherever it is asked.

#include "../config.hpp"
#include "../math/strict.hpp"
#include "../types.hpp"
#include "keyframe_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// round((value - minimum) * inverse_size), halves away from zero, or -1 when that is outside [0, count). In float,
/// rounded after every operation: where a keypoint is found must not depend on who looks.
TURBOMAP_HD inline int cell_of_coordinate(float value, float minimum, float inverse_size, int count) {
  const float scaled = ((strict<float>(value) - strict<float>(minimum)) * strict<float>(inverse_size)).value;
  if (!(scaled > -0.5F && scaled < static_cast<float>(count))) return -1;         // also NaN
  const int below = static_cast<int>(scaled);                                     // towards zero
  const int cell = below + (scaled - static_cast<float>(below) >= 0.5F ? 1 : 0);  // the difference is exact
  return cell < count ? cell : -1;
}

/// Cells per pixel along one axis: count / (maximum - minimum).
TURBOMAP_HD inline float inverse_cell_size(int count, float minimum, float maximum) {
  return (strict<float>(static_cast<float>(count)) / (strict<float>(maximum) - strict<float>(minimum))).value;
}

/// Index of the cell that a pixel of camera `camera` lies in, -1 outside of the grid. `Grid` has the bounds, inverse
/// sizes, columns and rows of cell_index_view.
template <class Grid>
TURBOMAP_HD int cell_of(const Grid& grid, float x, float y, int camera) {
  const int column = cell_of_coordinate(x, grid.bounds.min_x, grid.inverse_width, grid.columns);
  const int row = cell_of_coordinate(y, grid.bounds.min_y, grid.inverse_height, grid.rows);
  return column < 0 || row < 0 ? -1 : (camera * grid.columns + column) * grid.rows + row;
}

TURBOMAP_END_NAMESPACE

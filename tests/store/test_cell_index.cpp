// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

#include <doctest/doctest.h>

#include <turbomap/store/cell_index.hpp>

#include <cmath>
#include <initializer_list>
#include <limits>

namespace {

TEST_CASE("cells are rounded half away from zero, in float") {
  turbomap::cell_index_view grid;
  grid.bounds = {-3, 0, 61, 48};
  grid.columns = 64, grid.rows = 48;
  grid.inverse_width = turbomap::inverse_cell_size(64, -3, 61);
  grid.inverse_height = turbomap::inverse_cell_size(48, 0, 48);
  CHECK(grid.inverse_width == 1);
  const auto column = [&grid](float x) { return turbomap::cell_of(grid, x, 0, 0) / 48; };
  CHECK(column(-3) == 0);
  CHECK(column(-2.5F) == 1);
  CHECK(column(std::nextafter(-2.5F, -3.0F)) == 0);
  CHECK(column(-3.25F) == 0);
  CHECK(turbomap::cell_of(grid, -3.5F, 0, 0) == -1);
  CHECK(column(60.25F) == 63);
  CHECK(turbomap::cell_of(grid, 60.5F, 0, 0) == -1);
  CHECK(turbomap::cell_of(grid, 0, 47.5F, 0) == -1);
  CHECK(turbomap::cell_of(grid, -3, 5, 2) == 2 * 64 * 48 + 5);
  for (float wild : {1e30F, -1e30F, std::numeric_limits<float>::quiet_NaN()})
    CHECK(turbomap::cell_of(grid, wild, 0, 0) == -1);
  CHECK(turbomap::cell_of_coordinate(0.49999997F, 0, 1, 4) == 0);  // adding 0.5 in float would give 1
}

}  // namespace

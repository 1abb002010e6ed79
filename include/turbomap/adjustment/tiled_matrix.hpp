// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The lower triangle of a symmetric matrix on the host, in tiles of 8 by 8 that lie one after the other, row by row of tiles: a
/// factorisation reads them in the order of memory. Tiles of zeros that stay zeros when it is factorised have no room.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../plain_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Call reset(), join() for what is not zero, lay_out(), clear(), then fill it by at(). Keep one and use it again: it owns its
/// memory. An identity is beyond the last unknown.
class tiled_matrix {
 public:
  static constexpr int tile = 8;               ///< rows and columns of a tile
  static constexpr int numbers = tile * tile;  ///< of a tile, column by column

  /// n unknowns that nothing joins. What was laid out is lost.
  void reset(int n) {
    n_ = n, tiles_ = (n + tile - 1) / tile;
    place_.assign(at_tile(tiles_, 0), none);
    for (int i = 0; i < tiles_; ++i) place_[at_tile(i, i)] = 0;
  }
  /// The tile of these unknowns, in either order, is not zero.
  void join(int a, int b) { (a > b ? place_[at_tile(a / tile, b / tile)] : place_[at_tile(b / tile, a / tile)]) = 0; }
  /// Finds the tiles that a factorisation fills, and gives all of them room.
  TURBOMAP_ONE_BODY void lay_out() {
    for (int j = 0; j < tiles_; ++j) {  // what a column joins is joined in the column of its first row below too
      int first = j + 1;
      while (first < tiles_ && !has(first, j)) ++first;
      for (int i = first; i < tiles_; ++i)
        if (has(i, j)) place_[at_tile(i, first)] = 0;
    }
    first_.resize(static_cast<std::size_t>(tiles_));
    std::ptrdiff_t size = 0;
    for (int i = 0; i < tiles_; ++i) {
      first_[static_cast<std::size_t>(i)] = i;
      for (int j = i; j >= 0; --j)
        if (has(i, j)) first_[static_cast<std::size_t>(i)] = j;
      for (int j = 0; j <= i; ++j)
        if (has(i, j)) place_[at_tile(i, j)] = size, size += numbers;
    }
    values_.resize(static_cast<std::size_t>(size));
  }
  /// All elements are 0.
  TURBOMAP_ONE_BODY void clear() {
    const std::size_t size = values_.size();
    values_.clear();
    values_.resize(size);  // zeros
    for (int j = n_; j < tiles_ * tile; ++j) at(j, j) = 1;
  }

  /// Unknowns.
  int size() const { return n_; }
  /// Rows of tiles.
  int tiles() const { return tiles_; }
  /// The first tile of row i of tiles that has room.
  int first(int i) const { return first_[static_cast<std::size_t>(i)]; }
  /// Whether tile (i, j), i >= j, has room.
  bool has(int i, int j) const { return place_[at_tile(i, j)] != none; }
  /// Tile (i, j), which has room.
  double* in(int i, int j) { return values_.data() + place_[at_tile(i, j)]; }
  /// The same.
  const double* in(int i, int j) const { return values_.data() + place_[at_tile(i, j)]; }
  /// Element (row, column), row >= column, whose tile has room.
  double& at(int row, int column) { return in(row / tile, column / tile)[column % tile * tile + row % tile]; }
  /// The same.
  double at(int row, int column) const { return in(row / tile, column / tile)[column % tile * tile + row % tile]; }

 private:
  static constexpr std::ptrdiff_t none = -1;
  static std::size_t at_tile(int i, int j) {
    return static_cast<std::size_t>(i) * static_cast<std::size_t>(i + 1) / 2 + static_cast<std::size_t>(j);
  }

  int n_ = 0, tiles_ = 0;
  plain_vector<std::ptrdiff_t> place_;  ///< [tile of the lower triangle, row by row]
  plain_vector<int> first_;             ///< [row of tiles]
  plain_vector<double> values_;
};

TURBOMAP_END_NAMESPACE

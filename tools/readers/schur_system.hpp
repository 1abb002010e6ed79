// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reads a recorded linear system of bundle adjustment with the Schur complement and the solution that belong to it:
/// golden data for the elimination of landmarks. A folder of text files:
///
///     hpp hll hschur hpl .txt    first line: offsets of the block rows, second line: of the block columns, from 0;
///                                then "row column" and the values of one block after the other, column-major
///     bp bl bschur xp xl .txt    vectors
///
/// hpp, hll and hschur are symmetric: blocks of the upper triangle are given.

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <turbomap/config.hpp>
#include <turbomap/io/text_reader.hpp>

namespace turbomap {

/// A matrix of dense blocks. Block k covers rows [row_offset[row[k]], row_offset[row[k] + 1]), columns likewise.
struct block_matrix {
  std::vector<std::int32_t> row_offset, column_offset;  ///< one more than there are block rows and columns
  std::vector<std::int32_t> row, column;                ///< one a block, in the order of the file
  std::vector<std::size_t> value_offset;                ///< one more than there are blocks
  std::vector<double> values;                           ///< block after block, each row-major

  int rows() const { return row_offset.back(); }
  int columns() const { return column_offset.back(); }
  std::size_t block_count() const { return row.size(); }
  int height(std::size_t k) const { return size_at(row_offset, row[k]); }
  int width(std::size_t k) const { return size_at(column_offset, column[k]); }
  const double* block(std::size_t k) const { return values.data() + value_offset[k]; }

  /// Row-major, rows() x columns(). `symmetric`: the strict lower triangle mirrors the upper one, inside of diagonal
  /// blocks as well (recorded ones are symmetric to rounding only, which matters where the matrix nearly is singular).
  std::vector<double> dense(bool symmetric) const {
    const auto n = static_cast<std::size_t>(columns());
    std::vector<double> full(static_cast<std::size_t>(rows()) * n, 0.0);
    for (std::size_t k = 0; k < block_count(); ++k)
      for (int r = 0; r < height(k); ++r)
        for (int c = 0; c < width(k); ++c) {
          const auto i = static_cast<std::size_t>(row_offset[static_cast<std::size_t>(row[k])] + r);
          const auto j = static_cast<std::size_t>(column_offset[static_cast<std::size_t>(column[k])] + c);
          const double value = block(k)[r * width(k) + c];
          if (!symmetric || i <= j) full[i * n + j] = value;
          if (symmetric && i < j) full[j * n + i] = value;
        }
    return full;
  }

 private:
  static int size_at(const std::vector<std::int32_t>& offset, std::int32_t i) {
    return offset[static_cast<std::size_t>(i) + 1] - offset[static_cast<std::size_t>(i)];
  }
};

/// H = [Hpp Hpl; Hpl' Hll], b = [bp; bl]; Hschur xp = bschur is what remains of H x = b when the landmarks are
/// eliminated.
struct schur_system {
  block_matrix hpp, hpl, hll, hschur;
  std::vector<double> bp, bl, bschur, xp, xl;
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

inline std::vector<std::int32_t> read_block_offsets(text_reader& in) {
  std::vector<std::int32_t> offsets;
  do {
    const auto next = in.take<std::int32_t>("offset");
    if (offsets.empty() ? next != 0 : next <= offsets.back())
      in.fail("offset " + std::to_string(next) + " does not rise from 0");
    offsets.push_back(next);
  } while (!in.line_ends());
  return offsets;
}

inline block_matrix read_block_matrix(const std::filesystem::path& file, bool symmetric) {
  text_reader in(file);
  block_matrix m;
  m.row_offset = read_block_offsets(in), m.column_offset = read_block_offsets(in);
  if (symmetric && m.row_offset != m.column_offset) in.fail("rows and columns of a symmetric matrix differ");
  std::vector<std::int64_t> places;
  m.value_offset.push_back(0);
  while (!in.file_ends()) {
    const auto index = [&](const char* what, const std::vector<std::int32_t>& offsets) {
      const auto i = in.take<std::int32_t>(what);
      if (i < 0 || static_cast<std::size_t>(i) + 1 >= offsets.size())
        in.fail(std::string(what) + " " + std::to_string(i) + " is not one of " + std::to_string(offsets.size() - 1));
      return i;
    };
    m.row.push_back(index("block row", m.row_offset));
    m.column.push_back(index("block column", m.column_offset));
    if (symmetric && m.row.back() > m.column.back()) in.fail("a block lies below the diagonal of a symmetric matrix");
    places.push_back((std::int64_t{m.row.back()} << 32) | m.column.back());
    const std::size_t k = m.block_count() - 1;
    const auto height = static_cast<std::size_t>(m.height(k)), width = static_cast<std::size_t>(m.width(k));
    if (height * width > in.left()) in.fail("the file ends before the values of the block");
    m.value_offset.push_back(m.values.size() + height * width);
    m.values.resize(m.value_offset.back());
    for (std::size_t c = 0; c < width; ++c)
      for (std::size_t r = 0; r < height; ++r) m.values[m.value_offset[k] + r * width + c] = in.take<double>("value");
  }
  std::sort(places.begin(), places.end());
  if (std::adjacent_find(places.begin(), places.end()) != places.end()) in.fail("a block comes twice");
  return m;
}

inline std::vector<double> read_vector(const std::filesystem::path& file, int size) {
  text_reader in(file);
  std::vector<double> v;
  while (!in.file_ends()) v.push_back(in.take<double>("value"));
  if (v.size() != static_cast<std::size_t>(size))
    in.fail("there are " + std::to_string(v.size()) + " values, not " + std::to_string(size));
  return v;
}

}  // namespace detail

/// Reads a system from its folder. Throws bad_file naming file, line and reason, also for matrices and vectors whose
/// sizes do not go together.
inline schur_system read_schur_system(const std::filesystem::path& folder) {
  schur_system s;
  s.hpp = detail::read_block_matrix(folder / "hpp.txt", true);
  s.hpl = detail::read_block_matrix(folder / "hpl.txt", false);
  s.hll = detail::read_block_matrix(folder / "hll.txt", true);
  s.hschur = detail::read_block_matrix(folder / "hschur.txt", true);
  const auto fits = [&](const char* name, bool good) {
    if (!good)
      throw bad_file("turbomap: " + (folder / name).string() + ": line 1: the blocks are not those of hpp and hll");
  };
  fits("hpl.txt", s.hpl.row_offset == s.hpp.row_offset && s.hpl.column_offset == s.hll.column_offset);
  fits("hschur.txt", s.hschur.row_offset == s.hpp.row_offset);
  s.bp = detail::read_vector(folder / "bp.txt", s.hpp.rows()),
  s.bl = detail::read_vector(folder / "bl.txt", s.hll.rows());
  s.bschur = detail::read_vector(folder / "bschur.txt", s.hpp.rows());
  s.xp = detail::read_vector(folder / "xp.txt", s.hpp.rows()),
  s.xl = detail::read_vector(folder / "xl.txt", s.hll.rows());
  return s;
}

TURBOMAP_END_NAMESPACE

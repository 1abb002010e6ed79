// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Arrays on disk: the `.npy` format, versions 1 and 2, little-endian, C order. A file is read in one go straight into
/// a vector of plain rows; whatever is not exactly what was asked for is refused by name.

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string>
#include <system_error>
#include <type_traits>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../span.hpp"
#include "../types.hpp"
#include "file_handle.hpp"
#include "npy_header.hpp"

namespace turbomap {

/// How a plain struct lies in an array: its scalar, and how many of them make one row. A row of one column is an
/// element of a one-dimensional array. Specialise it for a struct that has no padding.
template <class Row>
struct npy_row {
  using scalar = Row;                        ///< type of the numbers in the file
  static constexpr std::size_t columns = 1;  ///< numbers per row
};
/// A row of N numbers.
template <class T, std::size_t N>
struct npy_row<std::array<T, N>> {
  /// @{
  /// As in the general template.
  using scalar = T;
  static constexpr std::size_t columns = N;
  /// @}
};
/// A row of two numbers: x, y.
template <class T>
struct npy_row<vec2<T>> : npy_row<std::array<T, 2>> {};
/// A row of three numbers: x, y, z.
template <class T>
struct npy_row<vec3<T>> : npy_row<std::array<T, 3>> {};
/// A row of seven numbers: qx, qy, qz, qw, tx, ty, tz.
template <class T>
struct npy_row<rigid_transform<T>> : npy_row<std::array<T, 7>> {};

/// An array of any shape, as it lies in a file.
template <class T>
struct npy_array {
  std::vector<std::size_t> shape;  ///< number of elements along each axis, the slowest first
  std::vector<T> values;           ///< in C order; as many as the product of shape
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class T>
constexpr const char* npy_descr() {
  static_assert(std::is_arithmetic_v<T>, "turbomap: a .npy array holds plain numbers; specialise npy_row for a struct");
  static_assert(
      (std::is_integral_v<T> && !std::is_same_v<T, bool>) || std::is_same_v<T, float> || std::is_same_v<T, double>,
      "turbomap: no .npy type for this one");
  if (std::is_same_v<T, float>) return "<f4";
  if (std::is_same_v<T, double>) return "<f8";
  constexpr const char* whole[2][4] = {{"|u1", "<u2", "<u4", "<u8"}, {"|i1", "<i2", "<i4", "<i8"}};
  constexpr int size = sizeof(T) == 1 ? 0 : sizeof(T) == 2 ? 1 : sizeof(T) == 4 ? 2 : 3;
  return whole[std::is_signed_v<T> ? 1 : 0][size];
}

inline void require_little_endian(const std::string& file) {
  const std::uint16_t one = 1;
  unsigned char first;
  std::memcpy(&first, &one, 1);
  if (first != 1)
    throw bad_file("turbomap: " + file + ": .npy files are read and written on little-endian machines only");
}

/// An open array file: its header has been read and fits its size; the data follow.
struct open_npy {
  file_handle file;
  npy_header header;
};

template <class T>
open_npy open_array(const std::filesystem::path& path) {
  const std::string name = path.stem().string();
  require_little_endian(path.string());
  std::error_code failed;
  const auto size = std::filesystem::file_size(path, failed);
  if (failed) reject_array(path, name, "cannot be opened: " + failed.message());
  file_handle file(std::fopen(path.string().c_str(), "rb"));
  if (!file) reject_array(path, name, "cannot be opened");
  unsigned char start[12] = {};
  const std::size_t got = std::fread(start, 1, sizeof start, file.get());
  if (got < 10 || std::memcmp(start, "\x93NUMPY", 6) != 0) reject_array(path, name, "is not a .npy file");
  if ((start[6] != 1 && start[6] != 2) || start[7] != 0)
    reject_array(
        path, name,
        "has format version " + std::to_string(start[6]) + "." + std::to_string(start[7]) + ", not 1.0 or 2.0");
  std::size_t length = start[8] + 256u * start[9], prefix = 10;
  if (start[6] == 2) length += (std::size_t(start[10]) << 16) + (std::size_t(start[11]) << 24), prefix = 12;
  if (length > size - std::min<std::uintmax_t>(prefix, size))
    reject_array(path, name, "is truncated inside its header");
  std::string text(length, '\0');
  std::fseek(file.get(), static_cast<long>(prefix), SEEK_SET);
  if (std::fread(text.data(), 1, length, file.get()) != length)
    reject_array(path, name, "is truncated inside its header");
  open_npy opened{std::move(file), parse_npy_header(path, name, text)};
  if (opened.header.descr != npy_descr<T>())
    reject_array(path, name, "has dtype '" + opened.header.descr + "', not '" + npy_descr<T>() + "'");
  const std::size_t count = element_count(opened.header.shape, sizeof(T));
  if (count == too_many_elements || size - prefix - length != count * sizeof(T))
    reject_array(path, name,
                 "has " + std::to_string(size - prefix - length) + " bytes of data, but shape " +
                     shape_text(opened.header.shape) +
                     (count == too_many_elements ? "" : " needs " + std::to_string(count * sizeof(T))));
  return opened;
}

template <class T>
void read_values(const std::filesystem::path& path, std::FILE* file, std::vector<T>& values) {
  if (!values.empty() && std::fread(values.data(), sizeof(T), values.size(), file) != values.size())
    reject_array(path, path.stem().string(), "could not be read to its end");
}

}  // namespace detail

/// Reads an array of any shape. Throws bad_file naming file, array and reason: not there, not a .npy file, another
/// dtype than T, Fortran order, longer or shorter than its shape says.
template <class T>
npy_array<T> read_npy(const std::filesystem::path& path) {
  auto opened = detail::open_array<T>(path);
  npy_array<T> array{opened.header.shape, std::vector<T>(detail::element_count(opened.header.shape, sizeof(T)))};
  detail::read_values(path, opened.file.get(), array.values);
  return array;
}

/// Reads an array of rows: shape [n] when a row has one column, [n, columns] otherwise. Throws bad_file as read_npy
/// does, and for another shape.
template <class Row>
std::vector<Row> read_npy_rows(const std::filesystem::path& path) {
  using scalar = typename npy_row<Row>::scalar;
  constexpr std::size_t columns = npy_row<Row>::columns;
  static_assert(std::is_trivially_copyable_v<Row> && sizeof(Row) == columns * sizeof(scalar));
  auto opened = detail::open_array<scalar>(path);
  const auto& shape = opened.header.shape;
  if (shape.size() != (columns == 1 ? 1u : 2u) || (columns != 1 && shape[1] != columns))
    detail::reject_array(path, path.stem().string(),
                         "has shape " + detail::shape_text(shape) + ", not (n" +
                             (columns == 1 ? std::string(",)") : ", " + std::to_string(columns) + ")"));
  std::vector<Row> rows(shape[0]);
  detail::read_values(path, opened.file.get(), rows);
  return rows;
}

/// Writes `values` with this shape (format 1.0; 2.0 for a shape whose text is above 64 KB). Throws std::invalid_argument
/// if the shape does not hold them, bad_file if the file cannot be written; the file is as before then.
template <class T>
void write_npy(const std::filesystem::path& path, span<const T> values, const std::vector<std::size_t>& shape) {
  const std::string name = path.stem().string();
  detail::require_little_endian(path.string());
  require(detail::element_count(shape, sizeof(T)) == values.size(), "shape", detail::shape_text(shape),
          "must hold as many elements as there are");
  const std::string header = detail::npy_header_bytes(detail::npy_descr<T>(), shape);
  detail::file_replacement file(path);
  if (!file.is_open()) detail::reject_array(path, name, "cannot be opened for writing");
  file.write(header.data(), header.size());
  file.write(values.data(), values.size() * sizeof(T));
  if (!file.finish()) detail::reject_array(path, name, "could not be written");
}

/// Writes rows as read_npy_rows reads them.
template <class Row>
void write_npy_rows(const std::filesystem::path& path, const std::vector<Row>& rows) {
  using scalar = typename npy_row<Row>::scalar;
  constexpr std::size_t columns = npy_row<Row>::columns;
  static_assert(std::is_trivially_copyable_v<Row> && sizeof(Row) == columns * sizeof(scalar));
  std::vector<std::size_t> shape{rows.size()};
  if (columns != 1) shape.push_back(columns);
  write_npy(path, span<const scalar>(reinterpret_cast<const scalar*>(rows.data()), rows.size() * columns), shape);
}

TURBOMAP_END_NAMESPACE

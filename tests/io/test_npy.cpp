// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Arrays on disk: what is written is read back, and every kind of damage is refused with the array's name.

#include <turbomap/io/npy.hpp>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "support/files.hpp"

using turbomap_test::bad_file_message;
using turbomap_test::file_bytes;
using turbomap_test::has;
using turbomap_test::write_bytes;

namespace {

/// A file by hand: any version, any header text.
std::string npy_bytes(const std::string& header, const std::string& data, char version = 1) {
  std::string bytes("\x93NUMPY", 6);
  bytes += version, bytes += '\0';
  bytes += static_cast<char>(header.size() & 0xFF), bytes += static_cast<char>(header.size() >> 8);
  if (version == 2) bytes += std::string(2, '\0');
  return bytes + header + data;
}

std::string read_error(const std::string& bytes) {
  const turbomap_test::temporary_directory folder;
  write_bytes(folder / "some_array.npy", bytes);
  return bad_file_message([&] { turbomap::read_npy<std::int32_t>(folder / "some_array.npy"); });
}

const std::string four_bytes("\x01\x02\x00\x00", 4);

}  // namespace

TEST_CASE_TEMPLATE("a .npy array of every type is read back as written", T, float, double, std::int32_t, std::int64_t,
                   std::uint32_t, std::uint8_t, std::int8_t, std::int16_t, std::uint16_t, std::uint64_t, long,
                   long long, unsigned long long) {
  const turbomap_test::temporary_directory folder;
  std::vector<T> values;
  for (int i = 0; i < 24; ++i) values.push_back(static_cast<T>(5 * i - 3));
  for (const std::vector<std::size_t>& shape : {std::vector<std::size_t>{24}, {4, 6}, {2, 3, 4}}) {
    turbomap::write_npy<T>(folder / "a.npy", values, shape);
    const auto read = turbomap::read_npy<T>(folder / "a.npy");
    CHECK(read.shape == shape);
    CHECK(read.values == values);
    CHECK((file_bytes(folder / "a.npy").size() - values.size() * sizeof(T)) % 64 == 0);
  }
}

TEST_CASE("rows of a .npy array") {
  const turbomap_test::temporary_directory folder;
  const std::vector<turbomap::vec3<float>> points{{1, 2, 3}, {-4, 5.5F, 6}};
  turbomap::write_npy_rows(folder / "p.npy", points);
  const auto read = turbomap::read_npy_rows<turbomap::vec3<float>>(folder / "p.npy");
  REQUIRE(read.size() == 2);
  CHECK(read[1].y == 5.5F);
  CHECK(turbomap::read_npy<float>(folder / "p.npy").shape == std::vector<std::size_t>{2, 3});
  const std::string message =
      bad_file_message([&] { turbomap::read_npy_rows<turbomap::vec2<float>>(folder / "p.npy"); });
  CHECK(has(message, "array p: has shape (2, 3), not (n, 2)"));
  CHECK(has(bad_file_message([&] { turbomap::read_npy_rows<float>(folder / "p.npy"); }), "not (n,)"));

  SUBCASE("none is a shape too") {
    turbomap::write_npy_rows(folder / "none.npy", std::vector<std::array<std::uint8_t, 32>>{});
    CHECK(turbomap::read_npy_rows<std::array<std::uint8_t, 32>>(folder / "none.npy").empty());
  }
}

TEST_CASE("a header that has no room in version 1 is written in version 2") {
  const turbomap_test::temporary_directory folder;
  const std::vector<float> value{7};
  for (const std::size_t dimensions : {21000, 21800, 21822, 21840, 30000}) {  // three characters each: around 64 KB
    const std::vector<std::size_t> shape(dimensions, 1);
    turbomap::write_npy<float>(folder / "long.npy", value, shape);
    const auto read = turbomap::read_npy<float>(folder / "long.npy");
    CHECK(read.shape == shape);
    CHECK(read.values == value);
    CHECK(file_bytes(folder / "long.npy").size() % 64 == 4);
    CHECK(int(file_bytes(folder / "long.npy")[6]) == (3 * dimensions > 65400 ? 2 : 1));
  }
}

TEST_CASE("headers that other writers make are read") {
  const turbomap_test::temporary_directory folder;
  for (const char* header : {"{'descr': '<i4', 'fortran_order': False, 'shape': (1,), }     \n",
                             "{'descr':'<i4','fortran_order':False,'shape':(1)}\n",
                             "{'shape': (1,1), 'fortran_order': False, 'descr': '<i4'}"})
    for (const char version : {1, 2}) {
      write_bytes(folder / "h.npy", npy_bytes(header, four_bytes, version));
      const auto read = turbomap::read_npy<std::int32_t>(folder / "h.npy");
      REQUIRE(read.values.size() == 1);
      CHECK(read.values[0] == 0x201);
    }
}

TEST_CASE("damaged .npy files are refused by name and reason") {
  const std::string good = "{'descr': '<i4', 'fortran_order': False, 'shape': (1,), }\n";
  CHECK(read_error(npy_bytes(good, four_bytes)) == "nothing thrown");
  const auto refused = [](const std::string& message, const std::string& reason) {
    CAPTURE(message);
    CHECK(has(message, "some_array.npy: array some_array: "));
    CHECK(has(message, reason));
  };
  refused(read_error(""), "is not a .npy file");
  refused(read_error("PK\3\4 a zip archive"), "is not a .npy file");
  refused(read_error(npy_bytes(good, four_bytes, 3)), "version 3.0");
  refused(read_error(npy_bytes(good, four_bytes).substr(0, 30)), "truncated inside its header");
  refused(read_error(npy_bytes(good, four_bytes.substr(1))), "has 3 bytes of data, but shape (1,) needs 4");
  refused(read_error(npy_bytes(good, four_bytes + "x")), "has 5 bytes of data");
  refused(read_error(npy_bytes("{'descr': '<i8', 'fortran_order': False, 'shape': (1,), }", four_bytes)),
          "dtype '<i8'");
  refused(read_error(npy_bytes("{'descr': '>i4', 'fortran_order': False, 'shape': (1,), }", four_bytes)),
          "dtype '>i4'");
  refused(read_error(npy_bytes("{'descr': '<i4', 'fortran_order': True, 'shape': (1,), }", four_bytes)),
          "Fortran order");
  refused(read_error(npy_bytes("{'descr': '<i4', 'fortran_order': False, }", four_bytes)), "lacks one of");
  refused(read_error(npy_bytes("{'descr': '<i4', 'descr': '<i4', 'shape': (1,)}", four_bytes)), "repeated header key");
  refused(read_error(npy_bytes("{'descr': '<i4', 'fortran_order': False, 'shape': (-1,), }", four_bytes)),
          "malformed shape");
  refused(read_error(npy_bytes("{'descr': '<i4', 'fortran_order': False, 'shape': (1,), } + 1", four_bytes)),
          "text after");
  refused(read_error(npy_bytes("{'descr': '<i4', 'fortran_order': False, 'shape': (1", four_bytes)),
          "malformed header");
  // 2^62 * 4 bytes would be 0 in 64 bits.
  refused(read_error(npy_bytes("{'descr': '<i4', 'fortran_order': False, 'shape': (4611686018427387904,), }", "")),
          "bytes of data");
  refused(read_error(npy_bytes("{'descr': '<i4', 'fortran_order': False, 'shape': (99999999999999999999,), }", "")),
          "too large");
  const turbomap_test::temporary_directory folder;
  CHECK(has(bad_file_message([&] { turbomap::read_npy<float>(folder / "gone.npy"); }), "array gone: cannot be opened"));
  CHECK(has(bad_file_message([&] { turbomap::read_npy<float>(folder.path()); }), "cannot be opened"));
  CHECK(has(bad_file_message([&] { turbomap::write_npy<float>(folder / "no/such/f.npy", {}, {0}); }),
            "array f: cannot be"));
  CHECK_THROWS_AS(turbomap::write_npy<float>(folder / "f.npy", {}, {1}), std::invalid_argument);
}

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Recorded linear systems: what is read, whether the published one is a Schur complement, and what is refused.

#include <doctest/doctest.h>

#include <Eigen/Dense>
#include <map>
#include <string>
#include <vector>
#include "readers/schur_system.hpp"

#include "support/files.hpp"
#include "support/support.hpp"

using namespace turbomap_test;

namespace {

using matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using vector = Eigen::VectorXd;

/// Two block rows, of 2 and 1; one landmark of 1.
std::map<std::string, std::string> small_system() {
  return {{"hpp.txt", "0 2 3\n0 2 3\n0 0\n4 1 1 5\n0 1\n7 8\n1 1\n9\n"},
          {"hpl.txt", "0 2 3\n0 1\n0 0\n1 2\n"},
          {"hll.txt", "0 1\n0 1\n0 0\n2\n"},
          {"hschur.txt", "0 2 3\n0 2 3\n0 0\n3.5 0 0 3\n0 1\n7 8\n1 1\n9\n"},
          {"bp.txt", "1 2 3"},
          {"bl.txt", "4"},
          {"bschur.txt", "-1 -2 3"},
          {"xp.txt", "0 0 0"},
          {"xl.txt", "2\n"}};
}
turbomap::schur_system read(const std::map<std::string, std::string>& files) {
  const temporary_directory folder;
  for (const auto& [name, text] : files) write_bytes(folder / name, text);
  return turbomap::read_schur_system(folder.path());
}
std::string with(const std::string& file, const std::string& part, const std::string& by) {
  auto files = small_system();
  const auto at = files[file].find(part);
  REQUIRE(at != std::string::npos);
  files[file].replace(at, part.size(), by);
  return bad_file_message([&] { read(files); });
}
matrix dense(const turbomap::block_matrix& m, bool symmetric) {
  const auto values = m.dense(symmetric);
  return Eigen::Map<const matrix>(values.data(), m.rows(), m.columns());
}
vector map(const std::vector<double>& v) {
  return Eigen::Map<const vector>(v.data(), static_cast<Eigen::Index>(v.size()));
}

}  // namespace

TEST_CASE("blocks are column-major in the file, row-major in memory; the upper triangle is mirrored") {
  const auto s = read(small_system());
  REQUIRE(s.hpp.block_count() == 3);
  CHECK(s.hpp.height(1) == 2);
  CHECK(s.hpp.width(1) == 1);
  CHECK(s.hpp.block(1)[1] == 8);
  CHECK(dense(s.hpp, true) == (matrix(3, 3) << 4, 1, 7, 1, 5, 8, 7, 8, 9).finished());
  CHECK(dense(s.hpp, false)(2, 0) == 0);
  CHECK(dense(s.hpl, false) == (matrix(3, 1) << 1, 2, 0).finished());
  CHECK(s.bp == std::vector<double>{1, 2, 3});
  CHECK(s.xl == std::vector<double>{2});
  auto files = small_system();
  files["hpp.txt"] = "0 2 3\n0 2 3\n0 0\n4 77 1 5\n1 1\n9\n";  // a lower triangle that differs: not used
  const matrix upper = dense(read(files).hpp, true);
  CHECK(upper(1, 0) == 1);
  CHECK(upper(0, 1) == 1);
}

TEST_CASE("what is broken is named with its file and line") {
  CHECK(has(with("hpp.txt", "0 2 3\n0 2 3", "0 2 2\n0 2 3"), "hpp.txt: line 1: offset 2 does not rise from 0"));
  CHECK(has(with("hpp.txt", "0 2 3\n0 2 3", "1 2 3\n0 2 3"), "line 1: offset 1 does not rise from 0"));
  CHECK(has(with("hpp.txt", "0 2 3\n0 2 3", "0 2 3\n0 1 3"), "rows and columns of a symmetric matrix differ"));
  CHECK(has(with("hpp.txt", "1 1\n9", "1 2\n9"), "line 7: block column 2 is not one of 2"));
  CHECK(has(with("hpp.txt", "0 1\n7", "1 0\n7"), "line 5: a block lies below the diagonal"));
  CHECK(has(with("hpp.txt", "1 1\n9", "0 1\n9 9"), "a block comes twice"));
  CHECK(has(with("hpp.txt", "7 8", "7 x"), "line 6: 'x' is no value"));
  CHECK(has(with("hpp.txt", "1 1\n9\n", "1 1\n"), "the file ends before value"));
  CHECK(has(with("hpl.txt", "0 1\n0 0\n1 2\n", "0 2\n0 0\n1 2 3 4\n"),
            "hpl.txt: line 1: the blocks are not those of hpp and hll"));
  CHECK(has(with("hschur.txt", "0 2 3\n0 2 3\n0 0\n3.5 0 0 3\n0 1\n7 8\n1 1\n9\n", "0 3\n0 3\n"),
            "hschur.txt: line 1: the blocks are not"));
  CHECK(has(with("bp.txt", "1 2 3", "1 2"), "bp.txt: line 1: there are 2 values, not 3"));
  CHECK(has(with("bl.txt", "4", "4 5"), "there are 2 values, not 1"));
  CHECK(has(with("xp.txt", "0 0 0", "0 0 inf"), "'inf' is no value"));
  auto files = small_system();
  files.erase("xl.txt");
  CHECK(has(bad_file_message([&] { read(files); }), "xl.txt: cannot be opened"));
}

TEST_CASE("the published system is what it says") {
  const auto folder = data("vi-schur-system");
  if (!folder) return;
  const auto s = turbomap::read_schur_system(*folder);
  CHECK(s.hpp.rows() == 390);
  CHECK(s.hll.rows() == 3345);
  CHECK(s.hpp.block_count() == 505);
  CHECK(s.hpl.block_count() == 7673);
  CHECK(s.hschur.block_count() == 805);
  for (std::size_t i = 0; i < 104; ++i) CHECK(s.hpp.row_offset[i + 1] - s.hpp.row_offset[i] == (i < 26 ? 6 : 3));
  const matrix Hpp = dense(s.hpp, true), Hpl = dense(s.hpl, false), Hll = dense(s.hll, true), H = dense(s.hschur, true);
  matrix inverse = matrix::Zero(Hll.rows(), Hll.cols());
  for (Eigen::Index i = 0; i < Hll.rows(); i += 3)
    inverse.block<3, 3>(i, i) = Eigen::Matrix3d(Hll.block<3, 3>(i, i)).inverse();
  const matrix W = Hpl * inverse, S = Hpp - W * Hpl.transpose();
  CHECK((S - H).norm() <= 1e-12 * H.norm());
  CHECK((map(s.bp) - W * map(s.bl) - map(s.bschur)).norm() <= 1e-9 * map(s.bschur).norm());
  CHECK((H * map(s.xp) - map(s.bschur)).norm() <= 1e-10 * map(s.bschur).norm());
  CHECK((inverse * (map(s.bl) - Hpl.transpose() * map(s.xp)) - map(s.xl)).norm() <= 1e-7 * map(s.xl).norm());
}

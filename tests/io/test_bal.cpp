// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Problems of Bundle Adjustment in the Large: what is read, what it costs, and what is refused.

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <string>
#include <turbomap/io/bal.hpp>

#include "reference/reprojection_cost.hpp"
#include "support/files.hpp"
#include "support/support.hpp"

using namespace turbomap_test;

namespace {

const std::string good =
    "2 1 3\n"
    "0 0 -1.5 2\r\n"
    "1 0     3e2   +4.25\n"
    "0 0 0 1e-400\n"
    "0.1\n0.2\n-0.3\n1\n2\n3\n500\n-1e-7\n2e-13\n"
    "0 0 0 4 5 6 600 0 0\n"
    "7\n8\n-9\n";

turbomap::bal_problem read(const std::string& text) {
  const temporary_directory folder;
  write_bytes(folder / "problem.txt", text);
  return turbomap::read_bal(folder / "problem.txt");
}
std::string message(const std::string& text) {
  return bad_file_message([&] { read(text); });
}
/// The good problem with one part replaced.
std::string with(const std::string& part, const std::string& by) {
  std::string text = good;
  const auto at = text.find(part);
  REQUIRE(at != std::string::npos);
  return message(text.replace(at, part.size(), by));
}

}  // namespace

TEST_CASE("a problem is read whatever its line ends and spaces") {
  const auto p = read(good);
  REQUIRE(p.cameras.size() == 2);
  REQUIRE(p.points.size() == 1);
  REQUIRE(p.pixel.size() == 3);
  CHECK(p.camera == std::vector<std::int32_t>{0, 1, 0});
  CHECK(p.point == std::vector<std::int32_t>{0, 0, 0});
  CHECK(p.pixel[0].x == -1.5);
  CHECK(p.pixel[0].y == 2);
  CHECK(p.pixel[1].x == 300);
  CHECK(p.pixel[1].y == 4.25);
  CHECK(p.pixel[2].y == 0);
  CHECK(p.cameras[0].rotation.z == -0.3);
  CHECK(p.cameras[0].translation.x == 1);
  CHECK(p.cameras[0].f == 500);
  CHECK(p.cameras[0].k1 == -1e-7);
  CHECK(p.cameras[0].k2 == 2e-13);
  CHECK(p.cameras[1].translation.z == 6);
  CHECK(p.points[0].z == -9);
  const auto none = read("0 0 0");
  CHECK(none.cameras.empty());
  CHECK(none.pixel.empty());
}

TEST_CASE("the pose of a camera is the exponential of its rotation vector") {
  turbomap::bal_camera c{{0, 0, std::acos(-1.0) / 2}, {1, 2, 3}, 1, 0, 0};
  const auto T = turbomap::bal_pose(c);
  CHECK(T.qz == doctest::Approx(std::sqrt(0.5)).epsilon(1e-15));
  CHECK(T.qw == doctest::Approx(std::sqrt(0.5)).epsilon(1e-15));
  CHECK(T.qx == 0);
  CHECK(T.tx == 1);
  CHECK(T.tz == 3);
  c.rotation = {0, 0.5, 0};
  CHECK(turbomap::bal_pose(c).qy == doctest::Approx(std::sin(0.25)).epsilon(1e-15));
  c.rotation = {0, 0, 0};
  CHECK(turbomap::bal_pose(c).qw == 1);
  c.rotation = {4e-10, 0, 0};
  CHECK(turbomap::bal_pose(c).qx == 2e-10);
}

TEST_CASE("a number too small for its type is zero, however it is written") {
  for (const std::string& tiny : {std::string("1e-400"), "-0." + std::string(400, '0') + "1",
                                  std::string("12e-999999999999"), "." + std::string(900, '0') + "1e+500"}) {
    CAPTURE(tiny);
    std::string text = good;
    CHECK(read(text.replace(text.find("-1.5"), 4, tiny)).pixel[0].x == 0);
  }
}

TEST_CASE("what is broken is named with its line") {
  CHECK(has(with("1 0     3e2", "2 0 3e2"), "problem.txt: line 3: camera 2 is not one of 2"));
  CHECK(has(with("1 0     3e2", "1 -1 3e2"), "line 3: point -1 is not one of 1"));
  CHECK(has(with("+4.25", "4.25px"), "line 3: '4.25px' is no y"));
  CHECK(has(with("+4.25", "+"), "line 3: '+' is no y"));
  CHECK(has(with("-1.5", "nan"), "line 2: 'nan' is no x"));
  CHECK(has(with("-1.5", "inf"), "line 2: 'inf' is no x"));
  CHECK(has(with("-1.5", "1e400"), "line 2: '1e400' is no x"));
  CHECK(has(with("-1.5", std::string(400, '1') + "e-10"), "' is no x"));  // 1e389, though its exponent is negative
  CHECK(has(with("0 0 -1.5", "0.5 0 -1.5"), "line 2: '0.5' is no camera"));
  CHECK(has(with("2 1 3\n", "-2 1 3\n"), "line 1: number of cameras is negative"));
  CHECK(has(with("2 1 3\n", "2 1 3000000000\n"), "line 1: '3000000000' is no number of observations"));
  CHECK(
      has(with("2 1 3\n", "2 1 2000000000\n"), "line 1: the file is too short for 2 cameras, 1 points and 2000000000"));
  CHECK(has(with("\n8\n-9\n", "\n8\n"), "the file ends before point coordinate"));
  CHECK(has(message("1 0 0\n0 1e200 0\n0 0 0 1 0 0"), "line 2: the rotation is too large"));
  CHECK(has(with("-9\n", "-9\n1\n"), "line 18: there is more than the first line says"));
  CHECK(has(message(""), "line 1: the file ends before number of cameras"));
  CHECK(has(message("\x89PNG\r\n"), "is no number of cameras"));
  const temporary_directory empty;
  CHECK(has(bad_file_message([&] { turbomap::read_bal(empty / "none.txt"); }), "none.txt: cannot be opened"));
  CHECK(has(bad_file_message([&] { turbomap::read_bal(empty.path()); }), "cannot be opened"));
}

TEST_CASE("every prefix of a problem is refused, and nothing else happens") {
  for (std::size_t n = 0; n + 3 < good.size(); ++n) {
    CAPTURE(n);
    CHECK(message(good.substr(0, n)) != "nothing thrown");
  }
}

TEST_CASE("the published problem costs what is published") {
  const auto file = data("bal-ladybug-49/problem-49-7776-pre.txt");
  if (!file) return;
  const auto p = turbomap::read_bal(*file);
  CHECK(p.cameras.size() == 49);
  CHECK(p.points.size() == 7776);
  CHECK(p.pixel.size() == 31843);
  CHECK(std::abs(bal_cost(p) - 850912.46) < 0.005);
}

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Trajectories: the TUM format to the nanosecond, and the error after one rigid alignment.

#include <turbomap/io/trajectory.hpp>
#include <turbomap/io/trajectory_error.hpp>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "support/files.hpp"

using turbomap_test::bad_file_message;
using turbomap_test::has;

TEST_CASE("a trajectory is read back as written, to the nanosecond") {
  const turbomap_test::temporary_directory folder;
  std::vector<turbomap::stamped_pose> poses;
  for (int i = 0; i < 5; ++i)
    poses.push_back({1403715527912143104 + i * 7, {0, std::sin(0.1 * i), 0, std::cos(0.1 * i), 0.1 * i, -2.0 * i, 3}});
  poses.insert(poses.begin(), {-500000001, {}});
  turbomap::write_trajectory(folder / "t.txt", poses);
  const auto read = turbomap::read_trajectory(folder / "t.txt");
  REQUIRE(read.size() == poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    CHECK(read[i].t_ns == poses[i].t_ns);
    CHECK(read[i].T_wb.ty == doctest::Approx(poses[i].T_wb.ty).epsilon(1e-9));
    CHECK(read[i].T_wb.qy == doctest::Approx(poses[i].T_wb.qy).epsilon(1e-8));
  }
}

TEST_CASE("any coordinate and any time is written in full, in every locale") {
  const turbomap_test::temporary_directory folder;
  const turbomap_test::comma_locale comma;
  constexpr auto lowest = std::numeric_limits<std::int64_t>::min(), highest = std::numeric_limits<std::int64_t>::max();
  const std::vector<turbomap::stamped_pose> poses{
      {lowest, {0, 0, 0, 1, 1e300, -1e300, 1e300}}, {0, {0, 0, 0, 1, 1234567.25, -0.5, 1e-320}}, {highest, {}}};
  turbomap::write_trajectory(folder / "t.txt", poses);
  const auto read = turbomap::read_trajectory(folder / "t.txt");
  REQUIRE(read.size() == 3);
  CHECK(read[0].t_ns == lowest);
  CHECK(read[0].T_wb.tx == 1e300);
  CHECK(read[0].T_wb.tz == 1e300);
  CHECK(read[0].T_wb.qw == 1);
  CHECK(read[1].T_wb.tx == 1234567.25);
  CHECK(read[1].T_wb.tz == 0);
  CHECK(read[2].t_ns == highest);
  CHECK(turbomap_test::has(turbomap_test::file_bytes(folder / "t.txt"),
                           "\n0.000000000 1234567.250000000 -0.500000000 0.000000000 0.000000000 "));
}

TEST_CASE("a trajectory that could not be read is not written") {
  const turbomap_test::temporary_directory folder;
  turbomap::write_trajectory(folder / "t.txt", {{1, {}}});
  const std::string before = turbomap_test::file_bytes(folder / "t.txt");
  const auto refused = [&](const std::vector<turbomap::stamped_pose>& poses) {
    CHECK_THROWS_AS(turbomap::write_trajectory(folder / "t.txt", poses), std::invalid_argument);
    CHECK(turbomap_test::file_bytes(folder / "t.txt") == before);
  };
  refused({});
  refused({{5, {}}, {5, {}}});
  refused({{5, {}}, {6, {0, 0, 0, 0, 0, 0, 0}}});
  refused({{5, {0, 0, 0, 1, NAN, 0, 0}}});
  refused({{5, {0, 0, 0, 1, 0, 0, INFINITY}}});
  CHECK(has(bad_file_message([&] { turbomap::write_trajectory(folder.path(), {{1, {}}}); }), "could not be written"));
  // A link stays one, and what it points at is replaced.
  std::filesystem::create_symlink(folder / "t.txt", folder / "link.txt");
  turbomap::write_trajectory(folder / "link.txt", {{2, {}}});
  CHECK(std::filesystem::is_symlink(folder / "link.txt"));
  CHECK(turbomap::read_trajectory(folder / "t.txt").at(0).t_ns == 2);
  CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 2);
  // So does one to a link to what is not there yet; one to itself is no file.
  std::filesystem::create_directory(folder / "sub");
  std::filesystem::create_symlink("new.txt", folder / "sub" / "inner.txt");
  std::filesystem::create_symlink("sub/inner.txt", folder / "outer.txt");
  turbomap::write_trajectory(folder / "outer.txt", {{3, {}}});
  CHECK(std::filesystem::is_symlink(folder / "outer.txt"));
  CHECK(std::filesystem::is_symlink(folder / "sub" / "inner.txt"));
  CHECK(turbomap::read_trajectory(folder / "sub" / "new.txt").at(0).t_ns == 3);
  std::filesystem::create_symlink("circle.txt", folder / "circle.txt");
  CHECK_THROWS_AS(turbomap::write_trajectory(folder / "circle.txt", {{4, {}}}), turbomap::bad_file);
  CHECK(std::filesystem::is_symlink(folder / "circle.txt"));
}

TEST_CASE("times may have a sign and an exponent, and are exact to the nanosecond") {
  const turbomap_test::temporary_directory folder;
  const auto time = [&](const std::string& text) {
    turbomap_test::write_bytes(folder / "t.txt", text + " 0 0 0 0 0 0 1\n");
    return turbomap::read_trajectory(folder / "t.txt").at(0).t_ns;
  };
  CHECK(time("1.403636580838555574e+09") == 1403636580838555574);
  CHECK(time("-1.403636580838555574E9") == -1403636580838555574);
  CHECK(time("0.000000000000000000e+00") == 0);
  CHECK(time("0e999") == 0);
  CHECK(time("+1.5") == 1500000000);
  CHECK(time(".5") == 500000000);
  CHECK(time("-.5e-3") == -500000);
  CHECK(time("5.") == 5000000000);
  CHECK(time("14036365808385555749.9e-10") == 1403636580838555574);
  CHECK(time("123456789e-17") == 1);  // 1.2 ns
  CHECK(time("9e-10") == 0);
  CHECK(time("1e-999") == 0);
  CHECK(time("0.0000000000001403636580838555574e22") == 1403636580838555574);
  CHECK(time("9223372036854775807e-9") == std::numeric_limits<std::int64_t>::max());
  CHECK(time("-9.223372036854775808e9") == std::numeric_limits<std::int64_t>::min());
  for (const char* text : {"9.223372036854775808e9",
                           "-9.223372036854775809e9",
                           "1e10",
                           "1e999",
                           "1e1000",
                           "1e-1000",
                           "1e99999999999",
                           "1e",
                           "1e+",
                           "1e+-5",
                           "1e++5",
                           "1e5.0",
                           "1e5e5",
                           "e5",
                           ".",
                           ".e5",
                           "+",
                           "-",
                           "+-1",
                           "-+1",
                           "++1",
                           "1.2.3",
                           "1 e5",
                           "0x1p3",
                           "inf"}) {
    CAPTURE(text);
    CHECK(has(bad_file_message([&] { time(text); }), "t.txt: line 1: "));
  }
  CHECK(has(bad_file_message([&] { time("1e10"); }), "'1e10' is not a number"));
}

TEST_CASE("malformed trajectories are refused by line and reason") {
  const turbomap_test::temporary_directory folder;
  const auto error = [&](const std::string& text) {
    turbomap_test::write_bytes(folder / "t.txt", text);
    return bad_file_message([&] { turbomap::read_trajectory(folder / "t.txt"); });
  };
  const std::string good = "# a comment\n\n1.5 0 0 0 0 0 0 1\r\n";
  CHECK(error(good) == "nothing thrown");
  CHECK(error(good + "2 0 0 0 0 0 0 1") == "nothing thrown");
  CHECK(has(error(good + "2 0 0 0 0 0 1\n"), "line 4: has 7 numbers"));
  CHECK(has(error(good + "2 0 0 0 0 0 0 1 9\n"), "line 4: has more than eight"));
  CHECK(has(error(good + "2 0 0 nan 0 0 0 1\n"), "line 4: 'nan' is not a number"));
  CHECK(has(error(good + "2x 0 0 0 0 0 0 1\n"), "line 4: '2x' is not"));
  CHECK(has(error(good + "2 0 0 0 0 0 0 0\n"), "line 4: does not end with a unit"));
  CHECK(has(error(good + "1.5 0 0 0 0 0 0 1\n"), "line 4: is not later"));
  CHECK(has(error("9223372036.854775808 0 0 0 0 0 0 1\n"), "line 1: '9223372036.854775808' is not"));
  CHECK(has(error("-9223372036.854775809 0 0 0 0 0 0 1\n"), "is not a number"));
  CHECK(has(error("99999999999999999999 0 0 0 0 0 0 1\n"), "is not a number"));
  CHECK(has(error("# nothing\n"), "there is no pose"));
  CHECK(has(bad_file_message([&] { turbomap::read_trajectory(folder.path()); }), "cannot be opened"));
  CHECK(has(bad_file_message([&] { turbomap::read_trajectory(folder / "gone.txt"); }), "cannot be opened"));
}

TEST_CASE("the trajectory error is what one rigid alignment leaves") {
  std::vector<turbomap::vec3<double>> truth, moved;
  const double c = std::cos(0.7), s = std::sin(0.7);
  for (int i = 0; i < 50; ++i) {
    const turbomap::vec3<double> p{std::cos(0.2 * i), 0.1 * i, std::sin(0.13 * i)};
    truth.push_back(p);
    moved.push_back({c * p.x - s * p.y + 5, s * p.x + c * p.y - 3, p.z + 1});
  }
  CHECK(turbomap::absolute_trajectory_error(moved, truth) < 1e-12);
  for (auto& p : moved) p = {1.1 * p.x, 1.1 * p.y, 1.1 * p.z};  // scale is not taken out
  double spread = 0;
  turbomap::vec3<double> mean{0, 0, 0};
  for (const auto& p : truth) mean = {mean.x + p.x / 50, mean.y + p.y / 50, mean.z + p.z / 50};
  for (const auto& p : truth)
    spread += std::pow(p.x - mean.x, 2) + std::pow(p.y - mean.y, 2) + std::pow(p.z - mean.z, 2);
  CHECK(turbomap::absolute_trajectory_error(moved, truth) == doctest::Approx(0.1 * std::sqrt(spread / 50)));
  CHECK(turbomap::absolute_trajectory_error(moved, truth, true) < 1e-12);  // unless asked for
  std::vector<turbomap::vec3<double>> mirrored = truth;
  for (auto& p : mirrored) p.x = -p.x;  // a mirror image is no rigid motion
  CHECK(turbomap::absolute_trajectory_error(mirrored, truth) > 0.1);
  CHECK(std::isnan(turbomap::absolute_trajectory_error({}, {})));
  truth.pop_back();
  CHECK_THROWS_AS(turbomap::absolute_trajectory_error(moved, truth), std::invalid_argument);
}

TEST_CASE("keyframes count where ground truth says where the camera was") {
  turbomap::recording r;
  const auto at = [](double t) { return turbomap::vec3<double>{std::cos(t), 0.3 * t, std::sin(2 * t)}; };
  const auto add_truth = [&](double t) {
    const auto p = at(t);
    r.gt_t_ns.push_back(static_cast<std::int64_t>(1e9 * t) + 7), r.gt_T_wb.push_back({p.x, p.y, p.z, 1, 0, 0, 0});
  };
  for (int i = 100; i < 1000; ++i)
    if (i < 400 || i > 600) add_truth(0.01 * i);  // seconds 1 to 10, but for 4 to 6
  for (int i = 0; i < 48; ++i) {
    const double t = 0.25 * i + 0.125 * (i % 2);
    const auto p = at(t);
    r.t_ns.push_back(static_cast<std::int64_t>(1e9 * t));
    r.T_cw.push_back({0, 0, 0, 1, static_cast<float>(-p.x), static_cast<float>(-p.y), static_cast<float>(-p.z)});
  }
  const auto covered = [&](double t) { return (t >= 1 && t < 4) || (t > 6 && t < 9.995); };
  int count = 0;
  for (std::size_t i = 0; i < r.t_ns.size(); ++i) {
    const double t = 1e-9 * static_cast<double>(r.t_ns[i]);
    const auto centre = turbomap::true_camera_centre(r, r.t_ns[i]);
    CAPTURE(t);
    REQUIRE(centre.has_value() == covered(t));
    if (!centre) continue;
    ++count;
    CHECK(std::hypot(centre->x - at(t).x, centre->y - at(t).y, centre->z - at(t).z) < 1e-4);
  }
  CHECK(count > 20);
  CHECK(turbomap::keyframe_trajectory_error(r, r.T_cw) < 1e-4);
  std::vector<std::uint8_t> uncovered(r.t_ns.size());
  for (std::size_t i = 0; i < uncovered.size(); ++i) uncovered[i] = !covered(1e-9 * static_cast<double>(r.t_ns[i]));
  CHECK(std::isnan(turbomap::keyframe_trajectory_error(r, r.T_cw, uncovered)));

  // Times in files are rounded; a clock may run over its whole range.
  CHECK(turbomap::true_camera_centre(r, r.gt_t_ns.front() - 10000)->y == r.gt_T_wb.front().py);
  CHECK(!turbomap::true_camera_centre(r, r.gt_t_ns.front() - 10001));
  CHECK(turbomap::true_camera_centre(r, r.gt_t_ns.back() + 10000)->y == r.gt_T_wb.back().py);
  r.gt_t_ns.front() = std::numeric_limits<std::int64_t>::min(), r.gt_t_ns.back() = -1 - r.gt_t_ns.front();
  CHECK(!turbomap::true_camera_centre(r, 0));
  r.gt_t_ns.clear();
  CHECK(!turbomap::true_camera_centre(r, 0));
}

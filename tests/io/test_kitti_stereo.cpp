// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Stereo problems of KITTI sequences: what is read, and what is refused.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <turbomap/io/kitti_stereo.hpp>
#include <vector>

#include "reference/reprojection_cost.hpp"
#include "support/files.hpp"
#include "support/support.hpp"

using namespace turbomap_test;

namespace {

struct sequence_files {
  std::string calibration = "700 710 0 600 170 0.5";
  // Frame 20 is a quarter turn about y, 3 m ahead; it has few digits, as the real ones.
  std::string poses =
      "10  1 0 0 0  0 1 0 0  -0 0 1 0  0 0 0 1\n"
      "20  0 0 0.999999 0.5  0 1 0 0  -0.999999 0 0 3  0 0 0 1\n";
  std::string factors =
      "10 7 740 390 240 2 1 10\r\n"
      "20 7 600 550 100 9 9 9\n"
      "20 3 600 530.5 170 0 0 5\n";
};

turbomap::kitti_stereo_problem read(const sequence_files& files) {
  const temporary_directory folder;
  write_bytes(folder / "calibration.txt", files.calibration);
  write_bytes(folder / "poses.txt", files.poses);
  write_bytes(folder / "factors.txt", files.factors);
  return turbomap::read_kitti_stereo(folder / "calibration.txt", folder / "poses.txt", folder / "factors.txt");
}
std::string with(std::string sequence_files::*file, const std::string& part, const std::string& by) {
  sequence_files files;
  const auto at = (files.*file).find(part);
  REQUIRE(at != std::string::npos);
  (files.*file).replace(at, part.size(), by);
  return bad_file_message([&] { read(files); });
}

}  // namespace

TEST_CASE("a sequence is read, landmarks where their first frame saw them") {
  const auto p = read({});
  CHECK(p.rig[0].camera.fx == 700);
  CHECK(p.rig[0].camera.fy == 710);
  CHECK(p.rig[0].camera.cx == 600);
  CHECK(p.rig[0].camera.cy == 170);
  CHECK(p.rig[0].bf == 350);
  CHECK(p.frame_id == std::vector<std::int64_t>{10, 20});
  CHECK(p.landmark_id == std::vector<std::int64_t>{7, 3});
  CHECK(p.data.fixed == std::vector<std::uint8_t>{1, 0});
  CHECK(p.data.frame == std::vector<std::int32_t>{0, 1, 1});
  CHECK(p.data.landmark == std::vector<std::int32_t>{0, 0, 1});
  CHECK(p.data.pixel[2].x == 600);
  CHECK(p.data.pixel[2].y == 170);
  CHECK(p.data.pixel[2].z == 530.5);
  CHECK(p.data.stereo == std::vector<std::uint8_t>{1, 1, 1});
  CHECK(p.data.information == std::vector<double>{1, 1, 1});
  CHECK(p.data.T_cw[0].qw == 1);
  const auto& T = p.data.T_cw[1];
  CHECK(T.qy / T.qw == doctest::Approx(-1).epsilon(1e-5));
  CHECK(T.tx == doctest::Approx(3).epsilon(1e-5));  // -R_cw t_wc
  CHECK(T.tz == doctest::Approx(-0.5).epsilon(1e-5));
  CHECK(p.data.points[0].x == 2);
  CHECK(p.data.points[0].z == 10);
  CHECK(p.data.points[1].x == doctest::Approx(5.5));
  CHECK(p.data.points[1].z == doctest::Approx(3));
  CHECK(read({sequence_files().calibration, sequence_files().poses, ""}).data.observation_count() == 0);
}

TEST_CASE("quaternions of all rotations, half turns included") {
  for (int i = 0; i < 200; ++i) {
    const double a = 0.1 * i, b = 1.3 * i, angle = i % 4 == 0 ? std::acos(-1.0) : 0.5 * i;
    const double s = std::sin(angle / 2), x = std::sin(a) * std::cos(b), y = std::sin(a) * std::sin(b), z = std::cos(a);
    const turbomap::rigid_transform<double> q{s * x, s * y, s * z, std::cos(angle / 2), 0, 0, 0};
    const auto back = turbomap::detail::unit_quaternion(turbomap::rotation(q));
    const double dot = q.qx * back.qx + q.qy * back.qy + q.qz * back.qz + q.qw * back.qw;
    CHECK(std::abs(std::abs(dot) - 1) < 1e-14);
  }
}

TEST_CASE("what is broken is named with its file and line") {
  const auto calibration = &sequence_files::calibration, poses = &sequence_files::poses,
             factors = &sequence_files::factors;
  CHECK(has(with(calibration, "700", "-700"), "calibration.txt: line 1: a focal length is not positive"));
  CHECK(has(with(calibration, "710 0", "710 0.1"), "the skew is not 0"));
  CHECK(has(with(calibration, "0.5", "0"), "the baseline is not positive"));
  CHECK(has(with(calibration, " 0.5", ""), "the file ends before baseline"));
  CHECK(has(with(calibration, "0.5", "0.5 1"), "there is more than fx fy skew cx cy baseline"));
  CHECK(has(with(poses, "20  0 0", "10  0 0"), "poses.txt: line 2: frame 10 has a pose already"));
  CHECK(has(with(poses, "20  0 0 0.999999", "20  0 0 0.9"), "line 2: the pose has no rotation matrix"));
  CHECK(has(with(poses, "20  0 0 0.999999", "20  0 0 -0.999999"), "line 2: the pose is a reflection"));
  CHECK(has(with(poses, "0 0 0 1\n20", "0 0 1 1\n20"), "line 1: the last row of the pose is not 0 0 0 1"));
  CHECK(has(with(poses, "0.5", "nan"), "line 2: 'nan' is no element of the pose"));
  CHECK(has(with(poses, "0.5", "+-5"), "'+-5' is no element of the pose"));
  sequence_files far;
  far.poses = "10 0.6 -0.8 0 1.7e308  0.8 0.6 0 1.7e308  0 0 1 0  0 0 0 1\n";
  CHECK(has(bad_file_message([&] { read(far); }), "poses.txt: line 1: the position of the pose is too large"));
  far.poses = sequence_files().poses, far.factors = "20 7 600 550 100 1.7e308 1.7e308 1.7e308\n";
  CHECK(has(bad_file_message([&] { read(far); }), "factors.txt: line 1: the position of landmark 7 is too large"));
  CHECK(has(with(calibration, "700 710 0 600 170 0.5", "1e200 710 0 600 170 1e200"), "baseline is not finite"));
  CHECK(has(with(factors, "20 3", "21 3"), "factors.txt: line 3: frame 21 has no pose"));
  CHECK(has(with(factors, "20 3", "20 7"), "line 3: frame 20 sees landmark 7 already"));
  CHECK(has(with(factors, "0 0 5", "0 0 -5"), "line 3: landmark 3 is not in front of the camera"));
  CHECK(has(with(factors, "9 9 9", "9 9 9 9"), "line 2: there is more than eight numbers"));
  CHECK(has(with(factors, "0 0 5\n", "0 0"), "the file ends before Z"));
  CHECK(has(with(factors, "240 2", "240 2m"), "line 1: '2m' is no X"));
  CHECK(has(bad_file_message([] { read({sequence_files().calibration, "", ""}); }), "there is no pose"));
}

TEST_CASE("the published sequences reproject as they should") {
  const auto folder = data("kitti-stereo-ba");
  if (!folder) return;
  const auto check = [&](const char* calibration, const std::string& suffix, std::size_t frames, std::size_t landmarks,
                         std::size_t observations, double median) {
    const auto p = turbomap::read_kitti_stereo(*folder / calibration, *folder / ("VO_camera_poses" + suffix),
                                               *folder / ("VO_stereo_factors" + suffix));
    CHECK(p.data.frame_count() == frames);
    CHECK(p.data.points.size() == landmarks);
    REQUIRE(p.data.observation_count() == observations);
    const auto& k = p.rig[0].camera;
    cost_camera camera;
    camera.fx = k.fx, camera.fy = k.fy, camera.cx = k.cx, camera.cy = k.cy, camera.bf = p.rig[0].bf;
    std::vector<bool> seen(landmarks, false);
    std::vector<double> error;
    const auto costs = observation_costs(p.data, {camera}, 5.991, 7.815);
    double own_frame = 0;
    for (std::size_t i = 0; i < observations; ++i) {
      const auto l = static_cast<std::size_t>(p.data.landmark[i]);
      if (seen[l])
        error.push_back(std::sqrt(costs[i].chi2));
      else
        own_frame = std::max(own_frame, std::sqrt(costs[i].chi2));
      seen[l] = true;
    }
    std::nth_element(error.begin(), error.begin() + static_cast<std::ptrdiff_t>(error.size() / 2), error.end());
    MESSAGE("own frame at most " << own_frame << " px, others " << error[error.size() / 2] << " px in the median");
    CHECK(own_frame < 0.02);
    CHECK(error[error.size() / 2] < median);
  };
  check("VO_calibration00s.txt", "00s.txt", 77, 15638, 52544, 0.8);
  check("VO_calibration.txt", "_large.txt", 26, 2634, 8189, 2);
}

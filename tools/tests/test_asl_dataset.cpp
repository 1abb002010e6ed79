// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Data sets in ASL layout: numbers at the ends of their types. What else is read and refused: test_extraction_opencv.cpp.

#include "extraction/asl_dataset.hpp"

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "support/files.hpp"

using namespace turbomap_test;
namespace ext = turbomap::extraction;

TEST_CASE("a pose between two that are farther apart than an int64 tells") {
  constexpr std::int64_t least = std::numeric_limits<std::int64_t>::min(),
                         most = std::numeric_limits<std::int64_t>::max();
  const std::vector<turbomap::stamped_pose> poses{{least, {}}, {most, {0, 0, 0, 1, 2, 0, 0}}};
  Eigen::Isometry3d T;
  CHECK_FALSE(ext::pose_at(poses, 0, 1, T));
  REQUIRE(ext::pose_at(poses, 0, 1e11, T));
  CHECK(T.translation().x() == doctest::Approx(1));
  REQUIRE(ext::pose_at(poses, most, 1, T));
  CHECK(T.translation().x() == 2);
}

TEST_CASE("distortion that is not finite is refused by name") {
  const temporary_directory folder;
  for (const char* camera : {"cam0", "mocap0"}) std::filesystem::create_directories(folder / "mav0" / camera);
  write_bytes(folder / "mav0/cam0/data.csv", "10,a.png\n");
  write_bytes(folder / "mav0/mocap0/data.csv", "10,1,2,3,1,0,0,0\n");
  ext::dataset_options options;
  options.mono = true;
  const auto with = [&](const std::string& k1) {
    write_bytes(folder / "mav0/cam0/sensor.yaml",
                "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nresolution: [752, 480]\n"
                "intrinsics: [458, 457, 367, 248]\ndistortion_model: radial-tangential\n"
                "distortion_coefficients: [" +
                    k1 + ", 0.07, 2e-4, 1e-5]\n");
    return ext::read_asl_dataset(folder.path(), options).cameras.at(0).distortion.at(0);
  };
  CHECK(with("-0.28") == -0.28);
  for (const char* number : {"nan", "inf", "1e400"}) {
    CAPTURE(number);
    CHECK(has(bad_file_message([&] { with(number); }), "cam0: a coefficient of distortion is not finite"));
  }
}

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A rig from a Kalibr calibration file: the few lines of it that matter here, not YAML in general.

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <string>
#include <system_error>
#include <vector>

#include <turbomap/error.hpp>

#include "rig.hpp"

namespace turbomap::simulation {

/// The fields of a block such as `cam0:`: all numbers of a key (over `- [..]` lines too), and its text. What stands on the
/// block's own line has the key "".
struct calibration_block {
  std::map<std::string, std::vector<double>> numbers;
  std::map<std::string, std::string> text;
};

/// The numbers of a line; one that a double cannot hold, too large or too small, is not finite, so that it is refused where it is
/// used.
inline std::vector<double> numbers_in(const std::string& line) {
  std::vector<double> found;
  for (const char *at = line.data(), *end = at + line.size(); at != end;) {
    double value;
    const auto [rest, error] = std::from_chars(at, end, value);
    if (error == std::errc::result_out_of_range) value = std::numeric_limits<double>::infinity();
    if (error != std::errc::invalid_argument) found.push_back(value);
    at = error != std::errc::invalid_argument ? rest : at + 1;
  }
  return found;
}

inline std::map<std::string, calibration_block> read_calibration_blocks(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) throw bad_file("turbomap: " + file.string() + ": cannot be opened");
  std::map<std::string, calibration_block> blocks;
  std::string line, block, key;
  while (std::getline(stream, line)) {
    line.erase(std::min(line.find('#'), line.size()));
    while (!line.empty() && (line.back() == ' ' || line.back() == '\r' || line.back() == '\t')) line.pop_back();
    const std::size_t first = line.find_first_not_of(" \t");
    if (first == std::string::npos || line[0] == '%') continue;
    const std::size_t colon = line.find(':');
    std::string value = line;
    if (first == 0 && colon != std::string::npos) {
      block = line.substr(0, colon), key.clear();
      value = line.substr(colon + 1);
      blocks[block].text[key] = value.substr(std::min(value.find_first_not_of(' '), value.size()));
    } else if (line[first] != '-' && colon != std::string::npos) {
      key = line.substr(first, colon - first);
      value = line.substr(colon + 1);
      blocks[block].text[key] = value.substr(std::min(value.find_first_not_of(' '), value.size()));
    }
    auto& numbers = blocks[block].numbers[key];
    for (const double number : numbers_in(value)) numbers.push_back(number);
  }
  return blocks;
}

/// Whether a row-major matrix is a rotation, as far as the digits of a file go, and a translation of less than 1000 km.
inline bool is_rigid(const std::array<double, 16>& row_major) {
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> T(row_major.data());
  const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
  return (R.transpose() * R - Eigen::Matrix3d::Identity()).norm() < 1e-2 && R.determinant() > 0 &&
         T.topRightCorner<3, 1>().norm() < 1e6 && T.row(3) == Eigen::RowVector4d(0, 0, 0, 1);
}

inline simulated_camera camera_of(const std::filesystem::path& file, const std::string& name,
                                  calibration_block& block) {
  const auto fail = [&](const std::string& reason) {
    throw bad_file("turbomap: " + file.string() + ": " + name + ": " + reason);
  };
  const auto take = [&](const char* key, std::size_t count) {
    const auto& values = block.numbers[key];
    if (values.size() != count) fail(std::string(key) + " needs " + std::to_string(count) + " numbers");
    for (const double value : values)
      if (!std::isfinite(value)) fail(std::string(key) + " has a number that is not finite");
    return values;
  };
  simulated_camera camera;
  const auto k = take("intrinsics", 4), size = take("resolution", 2);
  if (!(k[0] > 0 && k[1] > 0)) fail("focal lengths must be positive");
  for (const double side : size)
    if (!(side > 38 && side < 65536)) fail("resolution must be more than 38 and less than 65536");
  camera.width = static_cast<int>(size[0]), camera.height = static_cast<int>(size[1]);
  const std::string model = block.text["distortion_model"];
  if (model == "equidistant") {
    const auto d = take("distortion_coeffs", 4);
    camera.model = kannala_brandt<double>{k[0], k[1], k[2], k[3], d[0], d[1], d[2], d[3]};
  } else if (model == "radtan" || model == "none" || model.empty()) {
    camera.model = pinhole<double>{k[0], k[1], k[2], k[3]};  // a recording's pinhole keypoints are undistorted
  } else {
    fail("distortion_model '" + model + "' is not equidistant, radtan or none");
  }
  const bool inverse = block.numbers.count("T_cam_imu") != 0;
  const char* const mounting = inverse ? "T_cam_imu" : "T_imu_cam";
  const auto values = take(mounting, 16);
  std::array<double, 16> matrix;
  std::copy(values.begin(), values.end(), matrix.begin());
  if (!is_rigid(matrix)) fail(std::string(mounting) + " is not a rotation and a translation");
  camera.T_bc = inverse ? rigid(matrix).inverse() : rigid(matrix);
  return camera;
}

/// The noise of an `imu0:` block, as Kalibr's imu.yaml has it; keys that are not there keep EuRoC's values. The start of
/// the biases has no key in Kalibr: ours are gyroscope_bias and accelerometer_bias.
inline imu_noise noise_of(const std::filesystem::path& file, calibration_block& block) {
  imu_noise noise;
  const auto take = [&](const char* key, double& value, double least) {
    const auto found = block.numbers.find(key);
    if (found == block.numbers.end()) return;
    if (found->second.size() != 1 || !(found->second[0] >= least && found->second[0] <= 1e4))
      throw bad_file("turbomap: " + file.string() + ": imu0: " + key + " needs one number from " + printed(least) +
                     " to 10000");
    value = found->second[0];
  };
  take("gyroscope_noise_density", noise.gyro, 0), take("accelerometer_noise_density", noise.acceleration, 0);
  take("gyroscope_random_walk", noise.gyro_walk, 0), take("accelerometer_random_walk", noise.acceleration_walk, 0);
  take("gyroscope_bias", noise.gyro_bias, 0), take("accelerometer_bias", noise.acceleration_bias, 0);
  take("update_rate", noise.rate_hz, 1);
  return noise;
}

/// Reads cam0 and, if there, cam1 and imu0. Two pinholes become a rectified pair with cam0's intrinsics and their distance as
/// baseline; two fisheye cameras stay two. Throws bad_file naming file, camera and reason.
inline simulated_rig read_rig(const std::filesystem::path& file) {
  auto blocks = read_calibration_blocks(file);
  if (blocks.count("cam0") == 0) throw bad_file("turbomap: " + file.string() + ": there is no cam0 in it");
  simulated_rig rig;
  rig.cameras = {camera_of(file, "cam0", blocks["cam0"])};
  if (blocks.count("cam1") != 0) {
    const simulated_camera second = camera_of(file, "cam1", blocks["cam1"]);
    if (second.is_fisheye() != rig.cameras[0].is_fisheye())
      throw bad_file("turbomap: " + file.string() + ": cam1: is not of the same model as cam0");
    rig.baseline = (rig.cameras[0].T_bc.inverse() * second.T_bc).translation().norm();
    if (second.is_fisheye()) rig.cameras.push_back(second);
  }
  if (blocks.count("imu0") != 0) rig.imu = noise_of(file, blocks["imu0"]);
  if (rig.cameras[0].is_fisheye()) rig.features = 1000, rig.noise_px = fisheye_noise_px;
  rig.close_depth = 40 * rig.baseline;
  return rig;
}

}  // namespace turbomap::simulation

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A data set as EuRoC and TUM-VI publish it (ASL layout): a folder mav0 with cam0, cam1, imu0 and ground truth, each a
/// data.csv and a sensor.yaml. Images are listed, not read.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <turbomap/inertial/imu_samples.hpp>
#include <turbomap/io/text_file.hpp>
#include <turbomap/io/trajectory.hpp>

#include "simulation/calibration_file.hpp"

namespace turbomap::extraction {

/// A camera as it was calibrated: of a pinhole the lens' distortion too (k1 k2 p1 p2, perhaps k3), which rectification takes
/// out.
struct calibrated_camera {
  simulation::simulated_camera camera;
  std::vector<double> distortion;
};

/// Images of the same time.
struct image_files {
  std::int64_t t_ns = 0;
  std::filesystem::path left, right;  ///< right: empty with one camera
};

struct asl_dataset {
  std::vector<calibrated_camera> cameras;  ///< one or two of the same model
  std::vector<image_files> images;
  std::vector<stamped_pose> T_wb;  ///< ground truth
  std::vector<std::int64_t> imu_t_ns;
  std::vector<imu_sample> imu;
  simulation::imu_noise noise;
};

struct dataset_options {
  bool mono = false;                 ///< cam0 only
  bool imu = false;                  ///< imu0 too
  std::filesystem::path trajectory;  ///< TUM file with the poses; empty: the data set's ground truth
  /// Kalibr file, of which imu0 is taken too where it has one. Empty: each sensor.yaml, or else TUM-VI's dso/camchain.yaml
  std::filesystem::path calibration;
};

/// A line of a data.csv: nanoseconds, then fields.
struct table_row {
  std::int64_t t_ns = 0;
  std::vector<std::string> fields;
};

/// Reads a data.csv; lines that begin with # are comments. Throws bad_file naming file, line and reason: no nanoseconds,
/// fewer than so many fields, times that do not rise, nothing at all.
inline std::vector<table_row> read_table(const std::filesystem::path& file, std::size_t fields) {
  const std::string text = detail::read_text_file(file);
  std::vector<table_row> rows;
  std::size_t line = 1;
  const auto fail = [&](const std::string& reason) {
    throw bad_file("turbomap: " + file.string() + ": line " + std::to_string(line) + ": " + reason);
  };
  for (std::size_t at = 0; at < text.size(); ++line) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    std::vector<std::string> parts(1);
    for (; at < end; ++at) {
      if (text[at] == ',')
        parts.emplace_back();
      else if (text[at] != ' ' && text[at] != '\t' && text[at] != '\r')
        parts.back() += text[at];
    }
    at = end + 1;
    if (parts[0].empty() ? parts.size() == 1 : parts[0][0] == '#') continue;
    table_row row;
    if (!detail::parse_number(parts[0].data(), parts[0].data() + parts[0].size(), row.t_ns))
      fail("'" + parts[0] + "' is not a time in nanoseconds");
    if (parts.size() <= fields) fail("has fewer than " + std::to_string(fields) + " fields after the time");
    if (!rows.empty() && row.t_ns <= rows.back().t_ns) fail("is not later than the line before");
    row.fields.assign(parts.begin() + 1, parts.end());
    rows.push_back(std::move(row));
  }
  if (rows.empty()) fail("there is no line with data in the file");
  return rows;
}

/// The first Count fields of a row as numbers.
template <std::size_t Count>
std::array<double, Count> numbers_of(const table_row& row, const std::filesystem::path& file) {
  std::array<double, Count> values{};
  for (std::size_t i = 0; i < Count; ++i) {
    const std::string& field = row.fields[i];
    if (!detail::parse_number(field.data(), field.data() + field.size(), values[i]))
      throw bad_file("turbomap: " + file.string() + ": at " + std::to_string(row.t_ns) + ": '" + field +
                     "' is not a number");
  }
  return values;
}

/// A sensor.yaml with the keys of Kalibr's blocks.
inline simulation::calibration_block read_sensor(const std::filesystem::path& file) {
  simulation::calibration_block sensor;
  for (const auto& [name, block] : simulation::read_calibration_blocks(file)) {
    const auto numbers = block.numbers.find("");
    const auto text = block.text.find("");
    if (numbers != block.numbers.end()) sensor.numbers[name] = numbers->second;
    if (text != block.text.end()) sensor.text[name] = text->second;
    if (const auto data = block.numbers.find("data"); name == "T_BS" && data != block.numbers.end())
      sensor.numbers["T_imu_cam"] = data->second;
  }
  sensor.numbers["distortion_coeffs"] = sensor.numbers["distortion_coefficients"];
  if (const auto rate = sensor.numbers.find("rate_hz"); rate != sensor.numbers.end())
    sensor.numbers["update_rate"] = rate->second;
  std::string& model = sensor.text["distortion_model"];
  if (model == "radial-tangential") model = "radtan";
  return sensor;
}

inline calibrated_camera calibrated(const std::filesystem::path& file, const std::string& name,
                                    simulation::calibration_block block) {
  calibrated_camera c{simulation::camera_of(file, name, block), {}};
  if (c.camera.is_fisheye() || block.text["distortion_model"] != "radtan") return c;
  c.distortion = block.numbers["distortion_coeffs"];
  if (c.distortion.size() != 4 && c.distortion.size() != 5)
    throw bad_file("turbomap: " + file.string() + ": " + name + ": radtan needs 4 or 5 coefficients of distortion");
  for (const double k : c.distortion)
    if (!std::isfinite(k))
      throw bad_file("turbomap: " + file.string() + ": " + name + ": a coefficient of distortion is not finite");
  return c;
}

/// A Kalibr file and its blocks.
struct kalibr_file {
  std::filesystem::path path;  ///< empty: none is used
  std::map<std::string, simulation::calibration_block> blocks;
};

inline kalibr_file read_kalibr_file(const std::filesystem::path& mav, const dataset_options& options) {
  kalibr_file kalibr{options.calibration, {}};
  if (kalibr.path.empty() && !std::filesystem::exists(mav / "cam0" / "sensor.yaml"))
    kalibr.path = mav.parent_path() / "dso" / "camchain.yaml";
  if (!kalibr.path.empty()) kalibr.blocks = simulation::read_calibration_blocks(kalibr.path);
  return kalibr;
}

inline std::vector<calibrated_camera> read_cameras(const std::filesystem::path& mav, const kalibr_file& kalibr,
                                                   bool mono) {
  std::vector<std::string> names{"cam0"};
  if (!mono) names.emplace_back("cam1");
  std::vector<calibrated_camera> cameras;
  for (const std::string& name : names) {
    if (kalibr.path.empty()) {
      cameras.push_back(calibrated(mav / name / "sensor.yaml", name, read_sensor(mav / name / "sensor.yaml")));
      continue;
    }
    if (kalibr.blocks.count(name) == 0)
      throw bad_file("turbomap: " + kalibr.path.string() + ": there is no " + name + " in it");
    cameras.push_back(calibrated(kalibr.path, name, kalibr.blocks.at(name)));
  }
  const auto& left = cameras.front().camera;
  const auto& right = cameras.back().camera;
  if (left.is_fisheye() != right.is_fisheye() || left.width != right.width || left.height != right.height)
    throw bad_file("turbomap: " + mav.string() + ": cam1: is not of the model and size of cam0");
  return cameras;
}

/// The noise of the IMU: of the Kalibr file's imu0, else of its sensor.yaml, else TUM-VI's or EuRoC's, as the cameras are.
inline simulation::imu_noise read_imu_noise(const std::filesystem::path& mav, const kalibr_file& kalibr, bool fisheye) {
  if (const auto imu = kalibr.blocks.find("imu0"); imu != kalibr.blocks.end()) {
    auto block = imu->second;
    return simulation::noise_of(kalibr.path, block);
  }
  const auto sensor = mav / "imu0" / "sensor.yaml";
  if (std::filesystem::exists(sensor)) {
    auto block = read_sensor(sensor);
    return simulation::noise_of(sensor, block);
  }
  return fisheye ? simulation::tum_vi_rig().imu : simulation::imu_noise();
}

/// Images of cam0, with those of cam1 of the same time; others are left out.
inline std::vector<image_files> read_image_list(const std::filesystem::path& mav, bool mono) {
  const auto path = [&](const char* camera, const table_row& row) { return mav / camera / "data" / row.fields[0]; };
  std::vector<image_files> images;
  std::map<std::int64_t, std::filesystem::path> right;
  if (!mono)
    for (const table_row& row : read_table(mav / "cam1" / "data.csv", 1)) right[row.t_ns] = path("cam1", row);
  for (const table_row& row : read_table(mav / "cam0" / "data.csv", 1)) {
    const auto partner = right.find(row.t_ns);
    if (mono)
      images.push_back({row.t_ns, path("cam0", row), {}});
    else if (partner != right.end())
      images.push_back({row.t_ns, path("cam0", row), partner->second});
  }
  if (images.empty()) throw bad_file("turbomap: " + mav.string() + ": no images of cam0 and cam1 have the same time");
  return images;
}

/// Ground truth: of a tracking system and an estimator (EuRoC's Vicon rooms and machine hall) or of motion capture (TUM-VI).
inline std::vector<stamped_pose> read_ground_truth(const std::filesystem::path& mav) {
  for (const char* name : {"state_groundtruth_estimate0", "mocap0"}) {
    const auto file = mav / name / "data.csv";
    if (!std::filesystem::exists(file)) continue;
    std::vector<stamped_pose> poses;
    for (const table_row& row : read_table(file, 7)) {
      const auto v = numbers_of<7>(row, file);
      const double norm = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
      if (!detail::is_trajectory_rotation(norm))
        throw bad_file("turbomap: " + file.string() + ": at " + std::to_string(row.t_ns) + ": not a unit quaternion");
      poses.push_back({row.t_ns, {v[4] / norm, v[5] / norm, v[6] / norm, v[3] / norm, v[0], v[1], v[2]}});
    }
    return poses;
  }
  throw bad_file("turbomap: " + mav.string() +
                 ": there is no ground truth in it (state_groundtruth_estimate0 or mocap0): give a trajectory");
}

/// Reads all but the images. FOLDER is mav0 or what holds it. Throws bad_file naming file and reason.
inline asl_dataset read_asl_dataset(const std::filesystem::path& folder, const dataset_options& options) {
  const auto mav = std::filesystem::is_directory(folder / "mav0") ? folder / "mav0" : folder;
  if (!std::filesystem::exists(mav / "cam0" / "data.csv"))
    throw bad_file("turbomap: " + folder.string() + ": is not a data set: there is no mav0/cam0/data.csv");
  if (!options.mono && !std::filesystem::exists(mav / "cam1" / "data.csv"))
    throw bad_file("turbomap: " + folder.string() + ": there is no cam1: take the left camera alone");
  asl_dataset d;
  const kalibr_file kalibr = read_kalibr_file(mav, options);
  d.cameras = read_cameras(mav, kalibr, options.mono);
  d.images = read_image_list(mav, options.mono);
  d.T_wb = options.trajectory.empty() ? read_ground_truth(mav) : read_trajectory(options.trajectory);
  if (!options.imu) return d;
  const auto file = mav / "imu0" / "data.csv";
  for (const table_row& row : read_table(file, 6)) {
    const auto v = numbers_of<6>(row, file);
    d.imu_t_ns.push_back(row.t_ns);
    d.imu.push_back({{v[0], v[1], v[2]}, {v[3], v[4], v[5]}});
  }
  d.noise = read_imu_noise(mav, kalibr, d.cameras[0].camera.is_fisheye());
  return d;
}

/// The pose at a time, between its neighbours; false outside, or where they are further apart than the gap.
inline bool pose_at(const std::vector<stamped_pose>& poses, std::int64_t t_ns, double gap_seconds,
                    Eigen::Isometry3d& T_wb) {
  const auto after = std::lower_bound(poses.begin(), poses.end(), t_ns,
                                      [](const stamped_pose& p, std::int64_t t) { return p.t_ns < t; });
  if (after == poses.end()) return false;
  const auto before = after->t_ns == t_ns ? after : after - (after == poses.begin() ? 0 : 1);
  if (before->t_ns > t_ns) return false;
  const auto since_before = [&](std::int64_t t) {  // of two that an int64 holds: their difference need not fit in one
    return static_cast<double>(static_cast<std::uint64_t>(t) - static_cast<std::uint64_t>(before->t_ns));
  };
  if (since_before(after->t_ns) * 1e-9 > gap_seconds) return false;
  const double share = after == before ? 0 : since_before(t_ns) / since_before(after->t_ns);
  const auto rotation = [](const stamped_pose& p) {
    return Eigen::Quaterniond(p.T_wb.qw, p.T_wb.qx, p.T_wb.qy, p.T_wb.qz);
  };
  const auto position = [](const stamped_pose& p) { return Eigen::Vector3d(p.T_wb.tx, p.T_wb.ty, p.T_wb.tz); };
  T_wb = Eigen::Isometry3d::Identity();
  T_wb.linear() = rotation(*before).slerp(share, rotation(*after)).normalized().toRotationMatrix();
  T_wb.translation() = (1 - share) * position(*before) + share * position(*after);
  return true;
}

}  // namespace turbomap::extraction

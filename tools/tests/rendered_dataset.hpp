// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Images of a slanted wall and a panel in front of it, as cameras with their lenses see them, in a folder like EuRoC's: what
/// every pixel shows is known.

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <string>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "extraction/asl_dataset.hpp"

namespace turbomap_test {

/// Where a ray from `from` first meets the scene; false where there is nothing.
inline bool cast_ray(const Eigen::Vector3d& from, const Eigen::Vector3d& ray, Eigen::Vector3d& hit, bool& on_panel) {
  double nearest = 8;  // m: nothing is seen beyond
  const auto panel = (1.8 - from.z()) / ray.z();
  const Eigen::Vector3d on = from + panel * ray;
  on_panel = panel > 0 && panel < nearest && std::abs(on.y()) < 0.5 && on.x() > -0.8 && on.x() < 0;
  const double wall = (3 + 0.3 * from.x() - from.z()) / (ray.z() - 0.3 * ray.x());
  if (!on_panel && !(wall > 0 && wall < nearest)) return false;
  hit = on_panel ? on : from + wall * ray;
  return true;
}

/// Smooth noise of several sizes: corners at every level of a pyramid.
inline cv::Mat texture() {
  cv::RNG random(7);
  cv::Mat sum = cv::Mat::zeros(1024, 1024, CV_32F);
  for (const double sigma : {1.5, 3.0, 6.0, 12.0}) {
    cv::Mat noise(sum.size(), CV_32F);
    random.fill(noise, cv::RNG::NORMAL, 0, 1);
    cv::GaussianBlur(noise, noise, {}, sigma, sigma);
    sum += noise * (22 * sigma);  // blurring divides the contrast by about 3.5 sigma
  }
  cv::Mat grey;
  sum.convertTo(grey, CV_8U, 4, 128);
  return grey;
}

/// The image of a camera at T_wc, with the lens' distortion.
inline cv::Mat render(const turbomap::extraction::calibrated_camera& c, const Eigen::Isometry3d& T_wc,
                      const cv::Mat& texture) {
  const int width = c.camera.width, height = c.camera.height;
  const auto k = c.camera.parameters();
  const double per_metre = c.camera.is_fisheye() ? 76 : 183;  // a texel is a pixel at 2.5 m
  cv::Mat columns(height, width, CV_32F, cv::Scalar(0)), rows = columns.clone(),
                                                         empty(height, width, CV_8U, cv::Scalar(0));
  std::vector<cv::Point2d> raw, ideal;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) raw.emplace_back(x, y);
  if (!c.camera.is_fisheye())
    cv::undistortPoints(raw, ideal, cv::Matx33d(k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1), c.distortion, cv::noArray(),
                        cv::noArray(), {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-10});
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const auto& at = ideal.empty() ? raw[0] : ideal[static_cast<std::size_t>(y * width + x)];
      const Eigen::Vector3d ray = c.camera.is_fisheye() ? c.camera.unproject({x, y}) : Eigen::Vector3d(at.x, at.y, 1);
      Eigen::Vector3d hit;
      bool on_panel = false;
      if (ray.z() > 0.1 && cast_ray(T_wc.translation(), T_wc.linear() * ray, hit, on_panel)) {
        columns.at<float>(y, x) = static_cast<float>(hit.x() * per_metre + 500 + (on_panel ? 333 : 0));
        rows.at<float>(y, x) = static_cast<float>(hit.y() * per_metre + 500);
      } else {
        empty.at<unsigned char>(y, x) = 1;
      }
    }
  cv::Mat image;
  cv::remap(texture, image, columns, rows, cv::INTER_LINEAR, cv::BORDER_WRAP);
  image.setTo(128, empty);
  return image;
}

/// EuRoC's pair with its lenses, or TUM-VI's; `count` images on a way to the side.
struct rendered_dataset {
  std::vector<turbomap::extraction::calibrated_camera> cameras;
  std::vector<std::int64_t> t_ns;
  std::vector<Eigen::Isometry3d> T_wb;
};

inline rendered_dataset write_dataset(const std::filesystem::path& folder, bool fisheye, int count) {
  rendered_dataset d;
  if (fisheye) {
    for (const auto& camera : turbomap::simulation::tum_vi_rig().cameras) d.cameras.push_back({camera, {}});
  } else {
    turbomap::simulation::simulated_camera camera = turbomap::simulation::euroc_rig().cameras[0];
    camera.model = turbomap::pinhole<double>{458.654, 457.296, 367.215, 248.375};
    d.cameras.push_back({camera, {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}});
    Eigen::Isometry3d T_lr = Eigen::Isometry3d::Identity();  // not quite parallel
    T_lr.linear() = Eigen::AngleAxisd(0.02, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    T_lr.translation() = Eigen::Vector3d(0.11, 0.002, -0.001);
    camera.T_bc = camera.T_bc * T_lr;
    camera.model = turbomap::pinhole<double>{457.587, 456.134, 379.999, 255.238};
    d.cameras.push_back({camera, {-0.28368365, 0.07451284, -0.00010473, -3.55590700e-05}});
  }
  const cv::Mat pattern = texture();
  for (const char* name : {"cam0", "cam1", "state_groundtruth_estimate0", "imu0"})
    std::filesystem::create_directories(folder / "mav0" / name / "data");
  std::ofstream truth(folder / "mav0/state_groundtruth_estimate0/data.csv"), imu(folder / "mav0/imu0/data.csv");
  truth << "#timestamp, p_RS_R_x [m], ...\n" << std::setprecision(17);
  std::ofstream lists[] = {std::ofstream(folder / "mav0/cam0/data.csv"), std::ofstream(folder / "mav0/cam1/data.csv")};
  for (int i = 0; i < count; ++i) {
    Eigen::Isometry3d T_wc = Eigen::Isometry3d::Identity();
    T_wc.linear() = Eigen::AngleAxisd(0.02 * i, Eigen::Vector3d::UnitY()).toRotationMatrix();
    T_wc.translation() = Eigen::Vector3d(-0.3 + 0.1 * i, 0.02 * i, 0.03 * i);
    const std::int64_t t = 1403715273262142976 + std::int64_t{500000000} * i;
    d.t_ns.push_back(t), d.T_wb.push_back(T_wc * d.cameras[0].camera.T_bc.inverse());
    for (std::size_t c = 0; c < 2; ++c) {
      const std::string name = std::to_string(t) + ".png";
      cv::imwrite((folder / "mav0" / (c == 0 ? "cam0" : "cam1") / "data" / name).string(),
                  render(d.cameras[c], d.T_wb.back() * d.cameras[c].camera.T_bc, pattern));
      lists[c] << t << "," << name << "\r\n";
    }
    const Eigen::Vector3d p = d.T_wb.back().translation();
    const Eigen::Quaterniond q(d.T_wb.back().linear());
    truth << t << "," << p.x() << "," << p.y() << "," << p.z() << "," << q.w() << "," << q.x() << "," << q.y() << ","
          << q.z() << ",0,0,0\n";
    imu << t << ",0.1,0.2,0.3,1,2,9.81\n";
  }
  std::ofstream(folder / "mav0/imu0/sensor.yaml")
      << "sensor_type: imu\nrate_hz: 200\ngyroscope_noise_density: 0.001 # x\n";
  for (std::size_t c = 0; c < 2; ++c) {
    std::ofstream yaml(folder / "mav0" / (c == 0 ? "cam0" : "cam1") / "sensor.yaml");
    const auto& camera = d.cameras[c].camera;
    const auto list = [&](const std::vector<double>& values) {
      for (std::size_t i = 0; i < values.size(); ++i) yaml << (i == 0 ? "[" : ", ") << values[i];
      yaml << "]\n";
    };
    const auto k = camera.parameters();
    yaml << std::setprecision(17) << "# General\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [";
    for (int row = 0; row < 4; ++row, yaml << (row < 4 ? ",\n         " : "]\n"))
      for (int column = 0; column < 4; ++column) yaml << (column == 0 ? "" : ", ") << camera.T_bc.matrix()(row, column);
    yaml << "rate_hz: 20\nresolution: [" << camera.width << ", " << camera.height << "]\nintrinsics: ";
    list({k[0], k[1], k[2], k[3]});
    yaml << "distortion_model: " << (fisheye ? "equidistant" : "radial-tangential") << "\ndistortion_coefficients: ";
    list(fisheye ? std::vector<double>(k.begin() + 4, k.end()) : d.cameras[c].distortion);
  }
  return d;
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Images without lens distortion, and of a pinhole pair with rows that show the same: both images as two equal cameras
/// side by side would see them (OpenCV's stereoRectify). Fisheye images stay as they are.

#include <array>
#include <filesystem>
#include <utility>
#include <vector>

#include <Eigen/Geometry>  // core/eigen.hpp asks for it to be there

#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <turbomap/error.hpp>

#include "asl_dataset.hpp"

namespace turbomap::extraction {

class image_rectifier {
 public:
  explicit image_rectifier(const std::vector<calibrated_camera>& cameras) {
    const simulation::simulated_camera& left = cameras[0].camera;
    size_ = {left.width, left.height};
    rig_.cameras = {left};
    if (cameras.size() == 2) rig_.baseline = (left.T_bc.inverse() * cameras[1].camera.T_bc).translation().norm();
    if (left.is_fisheye()) {
      if (cameras.size() == 2) rig_.cameras.push_back(cameras[1].camera);
      return;
    }
    if (cameras.size() == 1) {
      if (!cameras[0].distortion.empty()) set_map(0, cameras[0], cv::Mat::eye(3, 3, CV_64F), matrix(left));
      return;
    }
    const simulation::simulated_camera& right = cameras[1].camera;
    const Eigen::Isometry3d T_rl = right.T_bc.inverse() * left.T_bc;
    const Eigen::Matrix3d R_rl = T_rl.linear();
    const Eigen::Vector3d t_rl = T_rl.translation();
    if (!(t_rl.norm() > 1e-6))
      throw bad_file("turbomap: the calibration: cam0 and cam1 are at one place");  // stereoRectify() would fail
    cv::Mat R, t, R_left, R_right, P_left, P_right, Q;
    cv::eigen2cv(R_rl, R), cv::eigen2cv(t_rl, t);
    cv::stereoRectify(matrix(left), cameras[0].distortion, matrix(right), cameras[1].distortion, size_, R, t, R_left,
                      R_right, P_left, P_right, Q, cv::CALIB_ZERO_DISPARITY, 0);
    if (!(P_right.at<double>(0, 3) < 0))
      throw bad_file("turbomap: the calibration: cam1 does not look from the right of cam0");
    set_map(0, cameras[0], R_left, P_left), set_map(1, cameras[1], R_right, P_right);
    const double f = P_left.at<double>(0, 0);
    rig_.baseline = -P_right.at<double>(0, 3) / f;
    rig_.cameras[0].model =
        pinhole<double>{f, P_left.at<double>(1, 1), P_left.at<double>(0, 2), P_left.at<double>(1, 2)};
    Eigen::Matrix3d turn;
    cv::cv2eigen(R_left, turn);
    rig_.cameras[0].T_bc.linear() = left.T_bc.linear() * turn.transpose();
  }

  /// The cameras that the images are of: one pinhole, alone or with a baseline, or one or two fisheye cameras.
  const simulation::simulated_rig& rig() const { return rig_; }

  /// Reads an image. Throws bad_file when it is none, or not of the camera's size.
  cv::Mat read(const std::filesystem::path& file, std::size_t camera) const {
    const cv::Mat grey = cv::imread(file.string(), cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
    if (grey.empty()) throw bad_file("turbomap: " + file.string() + ": is not an image that can be read");
    if (grey.size() != size_) throw bad_file("turbomap: " + file.string() + ": is not of the camera's size");
    return (*this)(grey, camera);
  }
  cv::Mat operator()(const cv::Mat& grey, std::size_t camera) const {
    const auto& [columns, rows] = maps_[camera];
    if (columns.empty()) return grey;
    cv::Mat out;
    cv::remap(grey, out, columns, rows, cv::INTER_LINEAR);
    return out;
  }

 private:
  static cv::Mat matrix(const simulation::simulated_camera& camera) {
    const auto k = camera.parameters();
    return (cv::Mat_<double>(3, 3) << k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1);
  }
  void set_map(std::size_t camera, const calibrated_camera& c, const cv::Mat& R, const cv::Mat& P) {
    cv::initUndistortRectifyMap(matrix(c.camera), c.distortion, R, P.colRange(0, 3), size_, CV_32FC1,
                                maps_[camera].first, maps_[camera].second);
  }

  cv::Size size_;
  simulation::simulated_rig rig_;
  std::array<std::pair<cv::Mat, cv::Mat>, 2> maps_;
};

}  // namespace turbomap::extraction

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Two views with known cameras for example 01: photographs with a COLMAP text model, or a room that is rendered here.

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <turbomap/camera/brown_conrady.hpp>
#include <turbomap/io/colmap_model.hpp>
#include <turbomap/math/linear.hpp>
#include <vector>

namespace example {

struct view {
  cv::Mat image;                           ///< gray
  turbomap::brown_conrady<double> camera;  ///< of its raw pixels
  turbomap::rigid_transform<double> T_cw;  ///< world to camera
};

/// Two photographs; cameras.txt and images.txt in `model` say how they were taken.
inline std::vector<view> read_views(const std::vector<std::string>& photographs, const std::string& model) {
  const turbomap::colmap_model colmap = turbomap::read_colmap_model(model);
  std::vector<view> views;
  for (const std::string& file : photographs) {
    view v{cv::imread(file, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION), {}, {}};
    if (v.image.empty()) throw std::runtime_error(file + " cannot be read as an image");
    for (const auto& [id, image] : colmap.images)
      if (image.name == std::filesystem::path(file).filename()) {
        const turbomap::colmap_camera& camera = colmap.cameras.at(image.camera);
        if (camera.width != v.image.cols || camera.height != v.image.rows)
          throw std::runtime_error(file + " is not of the size in cameras.txt");
        v.camera = camera.model;
        v.T_cw = image.T_cw;
        views.push_back(v);
      }
  }
  if (views.size() != photographs.size()) throw std::runtime_error("a photograph is not in " + model + "/images.txt");
  return views;
}

/// The rendered room: two textured walls, {n . X = d, unit n, a direction in the wall}.
struct wall {
  turbomap::vec3<double> normal;
  double distance;
  turbomap::vec3<double> along;
};
inline const wall room[2] = {{{0, 0, 1}, 6, {1, 0, 0}}, {{0.8, 0, 0.6}, 4, {-0.6, 0, 0.8}}};

/// Metres from a point to the nearer wall.
inline double distance_to_room(const turbomap::vec3<double>& x) {
  return std::fmin(std::abs(dot(room[0].normal, x) - room[0].distance),
                   std::abs(dot(room[1].normal, x) - room[1].distance));
}

/// Casts a ray through every pixel, to the wall that it meets first.
inline std::vector<view> render_views() {
  cv::RNG random(7);
  cv::Mat coarse(512, 512, CV_8U), fine(1024, 1024, CV_8U), texture;
  random.fill(coarse, cv::RNG::UNIFORM, 0, 255);
  random.fill(fine, cv::RNG::UNIFORM, 0, 255);
  cv::resize(coarse, texture, fine.size(), 0, 0, cv::INTER_NEAREST);
  cv::addWeighted(texture, 0.7, fine, 0.3, 0, texture);
  cv::GaussianBlur(texture, texture, {0, 0}, 0.8);
  const turbomap::brown_conrady<double> camera{500, 500, 319.5, 239.5, -0.1, 0.02, 0, 0, 0};
  const double half = 0.035;  // radians: half of the turn of the second camera
  std::vector<view> views{{{}, camera, {}}, {{}, camera, {0, std::sin(half), 0, std::cos(half), -0.5, 0.1, -0.2}}};
  for (view& v : views) {
    const auto T_wc = inverse(turbomap::to_isometry<double>(v.T_cw));
    cv::Mat x(480, 640, CV_32F), y(480, 640, CV_32F);
    for (int r = 0; r < x.rows; ++r)
      for (int c = 0; c < x.cols; ++c) {
        turbomap::vec3<double> ray{};
        if (!camera.unproject(turbomap::vec2<double>{double(c), double(r)}, ray)) throw std::logic_error("no ray");
        ray = T_wc.R * ray;
        double nearest = HUGE_VAL;
        for (const wall& w : room) {
          const double t = (w.distance - dot(w.normal, T_wc.t)) / dot(w.normal, ray);
          if (!(t > 0) || t >= nearest) continue;
          nearest = t;
          const auto hit = T_wc.t + t * ray;
          x.at<float>(r, c) = static_cast<float>(500 + 80 * dot(w.along, hit));
          y.at<float>(r, c) = static_cast<float>(500 + 80 * hit.y);
        }
      }
    cv::remap(texture, v.image, x, y, cv::INTER_LINEAR, cv::BORDER_WRAP);
  }
  return views;
}

}  // namespace example

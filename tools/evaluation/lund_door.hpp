// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Search and creation on photographs with a COLMAP model: OpenCV's ORB on known poses, judged by the model's tracks and
/// points, which were made from other features. Nothing is tuned to it.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/interop/opencv.hpp>
#include <turbomap/io/colmap_model.hpp>
#include <utility>
#include <vector>

#include "statistics.hpp"

namespace turbomap::evaluation {

struct photo_evaluation_options {
  int features = 5000;      ///< of ORB, a photograph
  int neighbours = 5;       ///< those that share the most points of the model
  double nearby_px = 3;     ///< a track of the model speaks for a keypoint within so many pixels of it
  double agreement_px = 3;  ///< ... and for a match that moves as it does, within so many pixels at octave 0
};

/// Counts over all (query, neighbour) pairs.
struct photo_evaluation {
  std::size_t photos = 0, keypoints = 0, pairs = 0, ordered_differs = 0;
  std::size_t matches = 0, judged = 0, agree = 0;  ///< judged: a track of the model that both photographs see is nearby
  std::vector<double> deviation_px;                ///< of judged matches: their motion against the track's
  std::size_t reachable = 0,
              found = 0;  ///< keypoints with a track nearby and a keypoint at its other end; matched there
  std::size_t accepted = 0;
  std::vector<double> epipolar_px;  ///< of matches, undistorted: candidate to epipolar line
  std::vector<double> nearest;      ///< accepted point to the nearest point of the model, by its depth
  std::vector<double> depth_error;  ///< accepted points of judged matches: |depth - depth of the track's point| / depth
  double search_ms = 0;

  double agreement() const { return share(agree, judged); }
  double recall() const { return share(found, reachable); }
};

/// Keypoints of one photograph by place; what a model says to be beside the photograph is in the cells along its border.
class pixel_grid {
 public:
  pixel_grid(int width, int height)
      : columns_(width / size + 3),
        rows_(height / size + 3),
        cells_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)) {}
  void add(double x, double y, int index) { cells_[cell(x, y, 0, 0)].push_back({{x, y}, index}); }
  /// Calls f(index, distance) for all within `radius` <= size.
  template <class F>
  void within(double x, double y, double radius, F f) const {
    for (int dx = -1; dx <= 1; ++dx)
      for (int dy = -1; dy <= 1; ++dy) {
        const std::size_t c = cell(x, y, dx, dy);
        if (c >= cells_.size()) continue;
        for (const auto& [p, index] : cells_[c])
          if (const double d = std::hypot(p.x - x, p.y - y); d <= radius) f(index, d);
      }
  }
  int nearest(double x, double y, double radius) const {
    int best = -1;
    within(x, y, radius, [&](int i, double d) { best = d <= radius ? (radius = d, i) : best; });
    return best;
  }

 private:
  static constexpr int size = 16;
  std::size_t cell(double x, double y, int dx, int dy) const {
    const auto at = [](double v, int d, int end) {
      return static_cast<long>(std::clamp(std::floor(v / size) + 1, 0.0, end - 1.0)) + d;
    };
    return static_cast<std::size_t>(at(y, dy, rows_) * columns_ + at(x, dx, columns_));
  }
  int columns_, rows_;
  std::vector<std::vector<std::pair<vec2<double>, int>>> cells_;
};

struct photo {
  const colmap_image* image;
  const colmap_camera* camera;
  std::vector<keypoint> raw;  ///< as ORB found them
  std::vector<std::uint8_t> descriptors;
  pixel_grid keypoints, tracked;       ///< of ORB; of the model, with a point
  std::map<std::int64_t, int> tracks;  ///< point of the model -> observation
};

/// Reads the photographs and finds ORB features. Throws bad_file when one is not there or not of the camera's size.
inline std::vector<photo> read_photos(const std::filesystem::path& folder, const colmap_model& model, int features) {
  std::vector<photo> photos;
  const auto orb = cv::ORB::create(features);
  for (const auto& [id, image] : model.images) {
    const colmap_camera& camera = model.cameras.at(image.camera);
    const cv::Mat gray =
        cv::imread((folder / image.name).string(), cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
    if (gray.cols != camera.width || gray.rows != camera.height)
      throw bad_file("turbomap: " + (folder / image.name).string() + ": not a photograph of the camera's size");
    std::vector<cv::KeyPoint> keypoints;
    cv::Mat descriptors;
    orb->detectAndCompute(gray, {}, keypoints, descriptors);
    photo p{&image, &camera, keypoints_from_opencv(keypoints), {}, {gray.cols, gray.rows}, {gray.cols, gray.rows}, {}};
    const auto rows = descriptors_from_opencv<binary_descriptor<256>>(descriptors);
    p.descriptors.assign(rows.begin(), rows.end());
    for (std::size_t i = 0; i < p.raw.size(); ++i) p.keypoints.add(p.raw[i].x, p.raw[i].y, static_cast<int>(i));
    for (std::size_t i = 0; i < image.observations.size(); ++i) {
      const colmap_observation& o = image.observations[i];
      if (o.point == -1 || !p.tracks.emplace(o.point, static_cast<int>(i)).second) continue;
      p.tracked.add(o.pixel.x, o.pixel.y, static_cast<int>(i));
    }
    photos.push_back(std::move(p));
  }
  return photos;
}

}  // namespace turbomap::evaluation

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// ORB features spread over the image: OpenCV finds far more than are wanted, and of each cell of a grid the strongest few
/// stay. Without a grid, the strongest of an image lie on a few textured objects.

#include <algorithm>
#include <cstring>
#include <vector>

#include <opencv2/features2d.hpp>

#include <turbomap/camera/full_image_keypoint.hpp>
#include <turbomap/error.hpp>
#include <turbomap/interop/opencv.hpp>
#include <turbomap/io/recording_data.hpp>

namespace turbomap::extraction {

struct feature_options {
  int columns = 12, rows = 8;  ///< cells of the grid: 63 x 60 px of EuRoC's images, twice ORB's patch of 31 px
  int per_cell = 12;           ///< 1152 keypoints at most; the recorded system takes 1200 (pinhole) and 1000 (fisheye)
  int levels = 8;
  float scale_factor = 1.2F;  ///< as in the recordings [ORB-SLAM3]
  /// FAST's threshold: low, so that dark cells have corners too [ORB-SLAM3: 7 where 20 finds nothing]. The strongest win.
  int fast_threshold = 7;
  int surplus = 5;  ///< so many times as many are found before the grid chooses
};

/// Keypoints of one image, in pixels of the full image, and a descriptor each.
struct image_features {
  std::vector<keypoint> keypoints;
  std::vector<descriptor_bytes> descriptors;
};

/// Finds features in grey images. Throws std::invalid_argument for options that are not positive.
class grid_features {
 public:
  explicit grid_features(const feature_options& o) : options_(o) {
    require(o.columns > 0, "columns", o.columns, "must be positive");
    require(o.rows > 0, "rows", o.rows, "must be positive");
    require(o.per_cell > 0, "per_cell", o.per_cell, "must be positive");
    require(o.surplus > 0, "surplus", o.surplus, "must be positive");
    orb_ = cv::ORB::create(o.surplus * o.per_cell * o.columns * o.rows, o.scale_factor, o.levels, 31, 0, 2,
                           cv::ORB::HARRIS_SCORE, 31, o.fast_threshold);
  }

  /// \param camera  of the keypoints
  image_features operator()(const cv::Mat& grey, std::uint8_t camera = 0) const {
    std::vector<cv::KeyPoint> found;
    cv::Mat descriptors;
    orb_->detectAndCompute(grey, {}, found, descriptors);
    std::vector<std::vector<std::size_t>> cells(static_cast<std::size_t>(options_.columns * options_.rows));
    for (std::size_t i = 0; i < found.size(); ++i) {
      const auto part = [](float at, int size, int count) {
        return std::clamp(static_cast<int>(at * static_cast<float>(count) / static_cast<float>(size)), 0, count - 1);
      };
      const int column = part(found[i].pt.x, grey.cols, options_.columns);
      cells[static_cast<std::size_t>(part(found[i].pt.y, grey.rows, options_.rows) * options_.columns + column)]
          .push_back(i);
    }
    image_features out;
    for (auto& cell : cells) {
      std::sort(cell.begin(), cell.end(), [&](std::size_t a, std::size_t b) {
        return found[a].response != found[b].response ? found[a].response > found[b].response : a < b;
      });
      cell.resize(std::min(cell.size(), static_cast<std::size_t>(options_.per_cell)));
      for (const std::size_t i : cell) {
        out.keypoints.push_back(
            in_full_image(from_opencv(found[i], camera), grey.cols, grey.rows, options_.scale_factor));
        out.descriptors.emplace_back();
        std::memcpy(out.descriptors.back().data(), descriptors.ptr(static_cast<int>(i)), sizeof(descriptor_bytes));
      }
    }
    return out;
  }

 private:
  feature_options options_;
  cv::Ptr<cv::ORB> orb_;
};

}  // namespace turbomap::extraction

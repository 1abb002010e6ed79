// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Depth of keypoints from a rectified pair. A keypoint's partner in the right image lies on the same row: the one with the
/// nearest descriptor says where, and correlating the patch around the keypoint with the right image says it to a fraction
/// of a pixel (Mur-Artal and Tardos, T-RO 2017, section III.A).

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "grid_features.hpp"
#include "simulation/descriptors.hpp"

namespace turbomap::extraction {

struct row_stereo_options {
  double rows = 2;  ///< a partner is so many pixels of its level off the row at most: error of the two corners
  int octaves = 1;  ///< ... and so many levels
  double nearest_depth = 0.3;         ///< m: the largest disparity that is looked for
  double furthest = 400;              ///< baselines: the smallest disparity; about 1 px of EuRoC's pair
  std::uint32_t most_different = 64;  ///< bits of 256; different patches are at 119 +- 18 (simulation/descriptors.hpp)
  int half_patch = 5, half_search = 4;  ///< px of the level: 11 x 11 as in the source; what a corner may be off
  double correlation = 0.8;             ///< normalised, at least
};

class row_stereo {
 public:
  /// \param focal_px, baseline_m  of the rectified pair
  row_stereo(const row_stereo_options& options, float scale_factor, int levels, double focal_px, double baseline_m)
      : options_(options), factor_(scale_factor), levels_(levels), focal_(focal_px), baseline_(baseline_m) {}

  /// Sets u_right and depth of the left keypoints that have a partner. Returns how many have.
  std::size_t operator()(const cv::Mat& left, const cv::Mat& right, const image_features& right_features,
                         image_features& left_features) const {
    std::vector<cv::Mat> left_levels, right_levels;
    std::vector<std::vector<std::size_t>> row_of(static_cast<std::size_t>(left.rows));
    for (int o = 0; o < levels_; ++o) left_levels.push_back(level(left, o)), right_levels.push_back(level(right, o));
    for (std::size_t i = 0; i < right_features.keypoints.size(); ++i) {
      const auto row = static_cast<long>(std::lround(right_features.keypoints[i].y));
      row_of[static_cast<std::size_t>(std::clamp<long>(row, 0, left.rows - 1))].push_back(i);
    }
    std::size_t found = 0;
    for (std::size_t i = 0; i < left_features.keypoints.size(); ++i) {
      keypoint& k = left_features.keypoints[i];
      const long partner = nearest(k, left_features.descriptors[i], right_features, row_of);
      if (partner < 0) continue;
      const double start = k.x - right_features.keypoints[static_cast<std::size_t>(partner)].x;
      double disparity = 0;
      if (!refine(left_levels[k.octave], right_levels[k.octave], left.size(), k, start, disparity)) continue;
      if (!allowed(disparity)) continue;
      k.u_right = static_cast<float>(k.x - disparity);
      if (k.u_right < 0) {
        k.u_right = -1;  // beyond the image: it would say that there is none
        continue;
      }
      k.depth = static_cast<float>(focal_ * baseline_ / disparity);
      ++found;
    }
    return found;
  }

 private:
  double scale(int octave) const { return std::pow(static_cast<double>(factor_), octave); }
  cv::Mat level(const cv::Mat& image, int octave) const {
    if (octave == 0) return image;
    cv::Mat out;
    const double s = scale(octave);
    cv::resize(image, out, {cvRound(image.cols / s), cvRound(image.rows / s)}, 0, 0, cv::INTER_AREA);
    return out;
  }
  bool allowed(double disparity) const {
    return disparity <= focal_ * baseline_ / options_.nearest_depth && disparity >= focal_ / options_.furthest;
  }

  long nearest(const keypoint& k, const descriptor_bytes& descriptor, const image_features& right,
               const std::vector<std::vector<std::size_t>>& row_of) const {
    const double reach = options_.rows * scale(k.octave);
    const auto last = static_cast<long>(row_of.size()) - 1;
    const long begin = std::clamp<long>(std::lround(k.y - reach), 0, last);
    const long end = std::clamp<long>(std::lround(k.y + reach), 0, last);
    long best = -1;
    std::uint32_t distance = options_.most_different + 1;
    for (long row = begin; row <= end; ++row)
      for (const std::size_t j : row_of[static_cast<std::size_t>(row)]) {
        const keypoint& r = right.keypoints[j];
        if (std::abs(int(r.octave) - int(k.octave)) > options_.octaves) continue;
        if (!allowed(static_cast<double>(k.x) - r.x)) continue;
        const std::uint32_t d = simulation::hamming(descriptor, right.descriptors[j]);
        if (d < distance) distance = d, best = static_cast<long>(j);
      }
    return best;
  }

  /// Slides the patch along the row of the level and fits a parabola through the best place.
  bool refine(const cv::Mat& left, const cv::Mat& right, cv::Size full, const keypoint& k, double start,
              double& disparity) const {
    const double zoom_x = static_cast<double>(full.width) / left.cols;
    const double zoom_y = static_cast<double>(full.height) / left.rows;
    const double x = (k.x + 0.5) / zoom_x - 0.5, y = (k.y + 0.5) / zoom_y - 0.5, d = start / zoom_x;
    const int patch = 2 * options_.half_patch + 1, strip = patch + 2 * options_.half_search;
    const double margin = options_.half_patch + 1;
    const double right_x = x - d;
    if (x < margin || y < margin || x > left.cols - 1 - margin || y > left.rows - 1 - margin) return false;
    if (right_x < margin + options_.half_search || right_x > right.cols - 1 - margin - options_.half_search)
      return false;
    cv::Mat from, to, score;
    cv::getRectSubPix(left, {patch, patch}, cv::Point2f(static_cast<float>(x), static_cast<float>(y)), from, CV_32F);
    cv::getRectSubPix(right, {strip, patch}, cv::Point2f(static_cast<float>(right_x), static_cast<float>(y)), to,
                      CV_32F);
    cv::matchTemplate(to, from, score, cv::TM_CCOEFF_NORMED);
    const float* s = score.ptr<float>(0);
    const int best = static_cast<int>(std::max_element(s, s + score.cols) - s);
    if (best == 0 || best == score.cols - 1 || !(s[best] >= options_.correlation)) return false;
    const double curve = static_cast<double>(s[best - 1]) - 2.0 * s[best] + s[best + 1];
    if (!(curve < 0)) return false;
    const double fraction = 0.5 * (static_cast<double>(s[best - 1]) - s[best + 1]) / curve;
    disparity = (d - (best - options_.half_search + fraction)) * zoom_x;
    return true;
  }

  row_stereo_options options_;
  float factor_;
  int levels_;
  double focal_, baseline_;
};

}  // namespace turbomap::extraction

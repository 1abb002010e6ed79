// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Search and creation on a recorded map with known poses, judged by the map's own observations. Nothing is tuned to it.

#include <algorithm>
#include <cmath>
#include <map>
#include <turbomap/camera/brown_conrady.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <utility>
#include <vector>

#include "judged_search.hpp"
#include "keyframe_map.hpp"
#include "statistics.hpp"

namespace turbomap::evaluation {

struct map_evaluation_options {
  int neighbours = 10;               ///< those that share the most good landmarks
  double max_distance = 75;          ///< of 384 bits: the default's share of 256, 50
  double sigma_px = 1;               ///< of a keypoint: widens the gates of search and creation alike
  std::uint32_t submaps = 7;         ///< submaps 0 .. 6; the last one of the file (landing) is poor
  double min_baseline_ratio = 0.01;  ///< baseline / median depth of the neighbour [ORB-SLAM3, monocular]
};

/// Counts over all (query, neighbour) pairs.
struct map_evaluation {
  std::size_t queries = 0, pairs = 0, short_baselines = 0, ordered_differs = 0;
  // Recall: of the observations of one good landmark by both keyframes ...
  std::size_t common = 0;      ///< all
  std::size_t within = 0;      ///< whose descriptors are within max_distance
  std::size_t consistent = 0;  ///< and whose keypoints pass the epipolar test
  std::size_t found = 0;       ///< that the search matched
  // Precision: of the matches ...
  std::size_t matches = 0;
  std::size_t correct = 0;  ///< one good landmark on both sides
  /// Two good landmarks: how far each projects from the other's keypoint, the larger of both, px. The map has many points
  /// twice (it never merged them): small values are its duplicates, large ones are wrong matches.
  std::vector<double> disagreement_px;
  // Creation.
  std::size_t accepted = 0, accepted_of_correct = 0, accepted_of_wrong = 0;
  std::vector<double> distance_m, distance_relative;  ///< accepted point to landmark; divided by its depth in the query
  double search_ms = 0;                               ///< all epipolar-ordered searches

  /// What the description of the data calls a duplicate: a landmark within so many pixels of a keypoint of another one.
  static constexpr double duplicate_px = 8;

  std::size_t duplicates() const {
    return static_cast<std::size_t>(
        std::count_if(disagreement_px.begin(), disagreement_px.end(), [](double d) { return d <= duplicate_px; }));
  }
  std::size_t wrong() const { return disagreement_px.size() - duplicates(); }
  double recall() const { return share(found, common); }
  double precision() const { return share(correct, correct + disagreement_px.size()); }
  double precision_with_duplicates() const { return share(correct + duplicates(), correct + disagreement_px.size()); }
};

/// Raw pixels and the model of the lens (curved epipolar lines), or pixels of a pinhole camera, undistorted beforehand.
inline const brown_conrady<double>& camera_of_pixels(const keyframe_map& map, brown_conrady<double>*) {
  return map.camera;
}
inline pinhole<double> camera_of_pixels(const keyframe_map& map, pinhole<double>*) {
  return {map.camera.fx, map.camera.fy, map.camera.cx, map.camera.cy};
}

template <class Camera>
class map_evaluator {
 public:
  using descriptor = binary_descriptor<384>;

  map_evaluator(const keyframe_map& map, const map_evaluation_options& options)
      : map_(map), options_(options), camera_(camera_of_pixels(map, static_cast<Camera*>(nullptr))) {
    require(map.descriptor_bytes == descriptor::bytes, "descriptor_bytes", map.descriptor_bytes, "must be 48");
    for (const map_keyframe& k : map.keyframes) insert(k);
  }

  map_evaluation run() {
    for (std::size_t k = 0; k < map_.keyframes.size(); ++k)
      if (map_.keyframes[k].submap < options_.submaps) evaluate(k);
    result_.search_ms = search_.ordered_ms();
    result_.ordered_differs = search_.ordered_differs();
    return std::move(result_);
  }

 private:
  void insert(const map_keyframe& k) {
    std::vector<keypoint> keypoints(k.pixels.size());
    std::map<int, std::vector<int>>& observers = observers_.emplace_back();
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      vec2<double> pixel = cast<double>(k.pixels[i]);
      vec3<double> ray;
      require(map_.camera.unproject(pixel, ray), "keypoint", i, "has no ray");
      require(camera_.project(ray, pixel), "keypoint", i, "does not project");  // raw: the pixel itself
      keypoints[i].x = static_cast<float>(pixel.x), keypoints[i].y = static_cast<float>(pixel.y);
      const int l = k.landmarks[i];
      if (l >= 0 && map_.landmarks[static_cast<std::size_t>(l)].good()) observers[l].push_back(static_cast<int>(i));
    }
    search_.insert(camera_, keypoints, k.descriptors);
    std::vector<double> depths;
    for (const auto& [l, unused] : observers) depths.push_back(depth(k, l));
    median_depth_.push_back(median(depths));
  }

  double depth(const map_keyframe& k, int landmark) const {
    return (to_isometry<double>(k.T_cw) * map_.landmarks[static_cast<std::size_t>(landmark)].position).z;
  }

  /// Other keyframes of the same submap (landmarks are its own), those with most common landmarks first.
  std::vector<std::size_t> neighbours_of(std::size_t query) {
    std::vector<std::pair<int, std::size_t>> ranked;
    for (std::size_t k = 0; k < search_.size(); ++k) {
      if (k == query || map_.keyframes[k].submap != map_.keyframes[query].submap) continue;
      int common = 0;
      for (const auto& [l, unused] : observers_[query]) common += observers_[k].count(l) != 0;
      if (common > 0) ranked.emplace_back(-common, k);
    }
    std::sort(ranked.begin(), ranked.end());
    if (ranked.size() > static_cast<std::size_t>(options_.neighbours))
      ranked.resize(static_cast<std::size_t>(options_.neighbours));
    std::vector<std::size_t> result;
    const auto centre = [&](std::size_t k) { return camera_centre(to_isometry<double>(map_.keyframes[k].T_cw)); };
    for (const auto& [unused, k] : ranked) {
      if (norm(centre(k) - centre(query)) < options_.min_baseline_ratio * median_depth_[k])
        ++result_.short_baselines;
      else
        result.push_back(k);
    }
    return result;
  }

  void evaluate(std::size_t query) {
    const std::vector<std::size_t> neighbours = neighbours_of(query);
    if (neighbours.empty()) return;
    search_options search;
    search.max_distance = options_.max_distance;
    search.scales.levels = 1;  // the detector's scale is constant
    search.line_chi2 *= options_.sigma_px * options_.sigma_px;
    search.reprojection_chi2 *= options_.sigma_px * options_.sigma_px;
    creation_options creation;
    creation.scales = search.scales;
    creation.mono_chi2 *= options_.sigma_px * options_.sigma_px;
    ++result_.queries;
    result_.pairs += neighbours.size();
    const auto pose_of = [this](std::size_t k) { return map_.keyframes[k].T_cw; };
    const auto judge_all = [&](const auto& view, const auto& plan, const std::vector<created_point>& points) {
      count_recall(query, neighbours, view, plan);
      for (const created_point& p : points) judge(query, neighbours[static_cast<std::size_t>(p.neighbour)], p);
    };
    search_(query, neighbours, pose_of, search, creation, judge_all);
  }

  template <class Plan>
  void count_recall(std::size_t query, const std::vector<std::size_t>& neighbours,
                    const search_view<descriptor, Camera>& search, const Plan& plan) {
    std::map<std::pair<int, int>, int> found;
    for (const auto& m : plan) found[{m.neighbour, m.query}] = m.candidate;
    for (int n = 0; n < search.neighbour_count; ++n)
      for (const auto& [landmark, keypoints] : observers_[query]) {
        const auto& there = observers_[neighbours[static_cast<std::size_t>(n)]];
        const auto seen = there.find(landmark);
        if (seen == there.end()) continue;
        for (const int q : keypoints) {
          ++result_.common;
          bool within = false, consistent = false, hit = false;
          for (const int c : seen->second) {
            if (descriptor::distance(search.query().descriptor_of(q), search.neighbour(n).descriptor_of(c)) >
                options_.max_distance)
              continue;
            within = true;
            consistent = consistent || candidate_scan<descriptor, Camera>(search, n, q).consistent(c);
            const auto match = found.find({n, q});
            hit = hit || (match != found.end() && match->second == c);
          }
          result_.within += within, result_.consistent += consistent, result_.found += hit;
        }
      }
  }

  void judge(std::size_t query, std::size_t neighbour, const created_point& p) {
    const map_keyframe &a = map_.keyframes[query], &b = map_.keyframes[neighbour];
    const int la = a.landmarks[static_cast<std::size_t>(p.query)],
              lb = b.landmarks[static_cast<std::size_t>(p.candidate)];
    const bool accepted = p.outcome == creation_outcome::accepted;
    ++result_.matches;
    result_.accepted += accepted;
    const auto good = [&](int l) { return l >= 0 && map_.landmarks[static_cast<std::size_t>(l)].good(); };
    if (!good(la) || !good(lb)) return;
    if (la == lb) {
      ++result_.correct;
      if (!accepted) return;
      ++result_.accepted_of_correct;
      const double d = norm(p.position - map_.landmarks[static_cast<std::size_t>(la)].position);
      result_.distance_m.push_back(d);
      result_.distance_relative.push_back(d / depth(a, la));
    } else {
      const double d = std::max(distance_px(b, la, p.candidate), distance_px(a, lb, p.query));
      result_.disagreement_px.push_back(d);
      result_.accepted_of_wrong += accepted && d > map_evaluation::duplicate_px;
    }
  }

  /// From the projection of a landmark to a keypoint; infinite where it does not project.
  double distance_px(const map_keyframe& k, int landmark, int keypoint) const {
    vec2<double> pixel{};
    const vec3<double> x = to_isometry<double>(k.T_cw) * map_.landmarks[static_cast<std::size_t>(landmark)].position;
    if (!map_.camera.project(x, pixel)) return HUGE_VAL;
    const vec2<float>& seen = k.pixels[static_cast<std::size_t>(keypoint)];
    return std::hypot(pixel.x - seen.x, pixel.y - seen.y);
  }

  const keyframe_map& map_;
  map_evaluation_options options_;
  Camera camera_;
  judged_search<descriptor, Camera> search_;
  std::vector<std::map<int, std::vector<int>>> observers_;  // by keyframe: good landmark -> keypoints
  std::vector<double> median_depth_;
  map_evaluation result_;
};

}  // namespace turbomap::evaluation

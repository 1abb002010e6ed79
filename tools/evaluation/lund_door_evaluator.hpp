// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The evaluation itself: searches, creates, and holds the results against the model.

#include "judged_search.hpp"
#include "lund_door.hpp"

namespace turbomap::evaluation {

/// With Camera = brown_conrady<double> on raw pixels, with pinhole<double> on pixels undistorted beforehand.
template <class Camera>
class photo_evaluator {
 public:
  using descriptor = binary_descriptor<256>;

  photo_evaluator(const colmap_model& model, const std::vector<photo>& photos, const photo_evaluation_options& options)
      : model_(model), photos_(photos), options_(options) {
    result_.photos = photos.size();
    for (const photo& p : photos) insert(p);
  }

  photo_evaluation run() {
    for (std::size_t p = 0; p < photos_.size(); ++p) evaluate(p);
    result_.search_ms = search_.ordered_ms();
    result_.ordered_differs = search_.ordered_differs();
    return std::move(result_);
  }

 private:
  static Camera camera_of(const photo& p) {
    const auto& m = p.camera->model;
    if constexpr (std::is_same_v<Camera, pinhole<double>>)
      return {m.fx, m.fy, m.cx, m.cy};
    else
      return m;
  }

  void insert(const photo& p) {
    const Camera camera = camera_of(p);
    std::vector<keypoint> keypoints = p.raw;
    for (keypoint& k : keypoints) {
      vec2<double> pixel{k.x, k.y};
      vec3<double> ray;
      require(p.camera->model.unproject(pixel, ray) && camera.project(ray, pixel), "keypoint x", k.x, "has no ray");
      k.x = static_cast<float>(pixel.x), k.y = static_cast<float>(pixel.y);
    }
    result_.keypoints += keypoints.size();
    search_.insert(camera, keypoints, p.descriptors);
  }

  std::vector<std::size_t> neighbours_of(std::size_t query) const {
    std::vector<std::pair<int, std::size_t>> ranked;
    for (std::size_t p = 0; p < photos_.size(); ++p) {
      int common = 0;
      for (const auto& [point, unused] : photos_[query].tracks) common += photos_[p].tracks.count(point) != 0;
      if (p != query && common > 0) ranked.emplace_back(-common, p);
    }
    std::sort(ranked.begin(), ranked.end());
    ranked.resize(std::min(ranked.size(), static_cast<std::size_t>(options_.neighbours)));
    std::vector<std::size_t> result;
    for (const auto& [unused, p] : ranked) result.push_back(p);
    return result;
  }

  void evaluate(std::size_t query) {
    const std::vector<std::size_t> neighbours = neighbours_of(query);
    result_.pairs += neighbours.size();
    const auto pose_of = [this](std::size_t p) { return photos_[p].image->T_cw; };
    const auto judge_all = [&](const auto&, const auto&, const std::vector<created_point>& points) {
      std::vector<std::map<int, int>> found(neighbours.size());
      for (const created_point& p : points) {
        judge(photos_[query], photos_[neighbours[static_cast<std::size_t>(p.neighbour)]], p);
        found[static_cast<std::size_t>(p.neighbour)][p.query] = p.candidate;
      }
      for (std::size_t n = 0; n < neighbours.size(); ++n)
        count_recall(photos_[query], photos_[neighbours[n]], found[n]);
    };
    search_(query, neighbours, pose_of, search_options{}, creation_options{}, judge_all);
  }

  /// Pixels by which the match moves otherwise than the nearest common track of the model; negative: there is none.
  double deviation(const photo& a, const photo& b, int query, int candidate, std::int64_t& point) const {
    const keypoint &ka = a.raw[static_cast<std::size_t>(query)], &kb = b.raw[static_cast<std::size_t>(candidate)];
    double closest = options_.nearby_px, result = -1;
    a.tracked.within(ka.x, ka.y, options_.nearby_px, [&](int i, double d) {
      const auto& oa = a.image->observations[static_cast<std::size_t>(i)];
      const auto other = b.tracks.find(oa.point);
      if (other == b.tracks.end() || d > closest) return;
      const auto& ob = b.image->observations[static_cast<std::size_t>(other->second)];
      closest = d;
      point = oa.point;
      result = std::hypot(kb.x - ka.x - (ob.pixel.x - oa.pixel.x), kb.y - ka.y - (ob.pixel.y - oa.pixel.y));
    });
    return result;
  }
  /// Keypoints of coarse octaves are less exact.
  double tolerance(const photo& a, int query) const {
    return options_.agreement_px * std::pow(1.2, a.raw[static_cast<std::size_t>(query)].octave);
  }

  void judge(const photo& a, const photo& b, const created_point& p) {
    ++result_.matches;
    result_.epipolar_px.push_back(epipolar_distance(a, b, p));
    std::int64_t point = -1;
    const double d = deviation(a, b, p.query, p.candidate, point);
    if (d >= 0) {
      ++result_.judged;
      result_.agree += d <= tolerance(a, p.query);
      result_.deviation_px.push_back(d);
    }
    if (p.outcome != creation_outcome::accepted) return;
    ++result_.accepted;
    const auto T = to_isometry<double>(a.image->T_cw);
    const double depth = (T * p.position).z;
    if (result_.accepted % 10 == 0) {  // every tenth is enough for a median
      double nearest = HUGE_VAL;
      for (const auto& [unused, x] : model_.points) nearest = std::min(nearest, squared_norm(x - p.position));
      result_.nearest.push_back(std::sqrt(nearest) / depth);
    }
    if (d >= 0) {
      const double expected = (T * model_.points.at(point)).z;
      result_.depth_error.push_back(std::abs(depth - expected) / expected);
    }
  }

  /// Of undistorted pixels, by the poses of the model.
  double epipolar_distance(const photo& a, const photo& b, const created_point& p) const {
    const auto ray = [](const photo& ph, int i) {
      vec3<double> r{};
      ph.camera->model.unproject(
          vec2<double>{ph.raw[static_cast<std::size_t>(i)].x, ph.raw[static_cast<std::size_t>(i)].y}, r);
      return r;
    };
    const auto T = to_isometry<double>(b.image->T_cw) * inverse(to_isometry<double>(a.image->T_cw));
    const vec3<double> n = cross(T.t, T.R * ray(a, p.query)), r = ray(b, p.candidate);
    const double f = b.camera->model.fx;
    return std::abs(dot(n, r)) / r.z / std::hypot(n.x / f, n.y / f);
  }

  /// A keypoint near an observation of the model whose other end has a keypoint too: was one of those matched?
  void count_recall(const photo& a, const photo& b, const std::map<int, int>& found) {
    for (std::size_t q = 0; q < a.raw.size(); ++q) {
      const int i = a.tracked.nearest(a.raw[q].x, a.raw[q].y, 1.0);
      if (i < 0) continue;
      const auto& oa = a.image->observations[static_cast<std::size_t>(i)];
      const auto other = b.tracks.find(oa.point);
      if (other == b.tracks.end()) continue;
      const auto& ob = b.image->observations[static_cast<std::size_t>(other->second)].pixel;
      if (b.keypoints.nearest(ob.x, ob.y, 1.0) < 0) continue;
      ++result_.reachable;
      const auto match = found.find(static_cast<int>(q));
      if (match == found.end()) continue;
      std::int64_t unused = -1;
      const double d = deviation(a, b, static_cast<int>(q), match->second, unused);
      result_.found += d >= 0 && d <= tolerance(a, static_cast<int>(q));
    }
  }

  const colmap_model& model_;
  const std::vector<photo>& photos_;
  photo_evaluation_options options_;
  judged_search<descriptor, Camera> search_;
  photo_evaluation result_;
};

}  // namespace turbomap::evaluation

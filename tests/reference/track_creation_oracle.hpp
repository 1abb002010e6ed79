// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Points from tracks as their definition reads, one track after the other, in plain double. Two views are decided by the
/// oracle of pairs.

#include <turbomap/matching/track_joiner.hpp>
#include <turbomap/math/dual.hpp>

#include <cstdlib>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "creation_oracle.hpp"
#include "descriptor_oracle.hpp"
#include "search_oracle.hpp"

namespace turbomap_test {

/// What became of one track.
struct oracle_track_point {
  turbomap::creation_outcome outcome;
  turbomap::creation_method method = turbomap::creation_method::none;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  std::vector<char> kept;  ///< by view of the track
  bool doubtful = false;   ///< hung on a close call
};

TURBOMAP_TEST_EIGEN_BEGIN
template <class Camera>
class track_oracle {
 public:
  using outcome = turbomap::creation_outcome;
  using sight = oracle_sight<Camera>;

  /// \param keyframes  of each view; 0: the query
  track_oracle(std::vector<sight> views, std::vector<int> keyframes, const turbomap::creation_options& options)
      : views_(std::move(views)), keyframes_(std::move(keyframes)), options_(options) {}

  oracle_track_point operator()() {
    result_.kept.assign(views_.size(), 1);
    result_.outcome = of_enough_keyframes() ? decide() : outcome::too_few_keyframes;
    if (result_.outcome == outcome::accepted && !of_enough_keyframes()) result_.outcome = outcome::too_few_keyframes;
    result_.doubtful = calls_.any;
    return result_;
  }

 private:
  struct fit {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d descent = Eigen::Vector3d::Zero();
    double cost = 0, farthest = 0, excess = 0;
    std::size_t worst = 0;
    bool behind = false;
  };

  std::vector<std::size_t> left() const {
    std::vector<std::size_t> all;
    for (std::size_t i = 0; i < views_.size(); ++i)
      if (result_.kept[i] != 0) all.push_back(i);
    return all;
  }
  bool of_enough_keyframes() const {
    std::set<int> keyframes;
    for (const std::size_t i : left()) keyframes.insert(keyframes_[i]);
    return static_cast<int>(keyframes.size()) >= options_.fewest_keyframes;
  }
  Eigen::Vector3d centre(std::size_t i) const { return views_[i].T_cw.inverse().t; }
  Eigen::Vector3d direction(std::size_t i) const { return (views_[i].T_cw.R.transpose() * views_[i].ray).normalized(); }

  outcome decide() {
    for (auto views = left(); views.size() > 2; views = left()) {
      Eigen::Vector3d x;
      if (!begin(views, x)) return outcome::low_parallax;
      const fit f = refine(views, x);
      if (!f.behind && !calls_.less(1, f.excess)) return accept(f, x);
      result_.kept[f.worst] = 0;
    }
    const auto views = left();
    turbomap::created_point p{};
    p.method = turbomap::creation_method::none;
    const outcome o = oracle_outcome(views_[views[0]], views_[views[1]], options_, p, calls_);
    result_.method = p.method;
    if (o != outcome::accepted) return o;
    const Eigen::Vector3d x(p.position.x, p.position.y, p.position.z);
    Eigen::Vector3d refined = x;
    const fit f = refine(views, refined);
    if (f.behind || calls_.less(1, f.excess)) return accept(compare(views, x), x);
    return accept(f, refined);
  }

  outcome accept(const fit& f, const Eigen::Vector3d& x) {
    if (options_.max_distance > 0 && !calls_.less(f.farthest, options_.max_distance)) return outcome::too_far;
    result_.position = x;
    result_.covariance = (f.information + Eigen::Matrix3d::Identity() / (f.farthest * f.farthest)).inverse();
    return outcome::accepted;
  }

  bool begin(const std::vector<std::size_t>& views, Eigen::Vector3d& x) {
    result_.method = turbomap::creation_method::none;
    double limit = 2;
    const std::size_t none = views_.size();
    std::size_t stereo = none;
    for (const std::size_t i : views)
      if (views_[i].stereo && views_[i].depth > 0 && calls_.less(views_[i].parallax, limit, 1))
        limit = views_[i].parallax, stereo = i;
    if (stereo == none) limit = options_.max_parallax_cosine;
    bool suffice = false;
    for (std::size_t a = 0; a < views.size(); ++a)
      for (std::size_t b = a + 1; b < views.size(); ++b) {
        const double cosine = direction(views[a]).dot(direction(views[b]));
        if (calls_.less(cosine, limit, 1) && calls_.less(0, cosine, 1)) suffice = true;
      }
    using method = turbomap::creation_method;
    if (suffice) {
      result_.method = method::triangulated;
      Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
      Eigen::Vector3d b = Eigen::Vector3d::Zero();
      for (const std::size_t i : views) {
        const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - direction(i) * direction(i).transpose();
        A += across, b += across * (centre(i) - centre(views[0]));
      }
      x = centre(views[0]) + A.ldlt().solve(b);
      return true;
    }
    if (stereo == none) return false;
    result_.method = keyframes_[stereo] == 0 ? method::stereo_query : method::stereo_neighbour;
    x = views_[stereo].stereo_point();
    return true;
  }

  fit refine(const std::vector<std::size_t>& views, Eigen::Vector3d& x) {
    fit f = compare(views, x);
    for (int step = 0; step < options_.refinement_steps && !f.behind; ++step) {
      // A direction that is hardly known: both lose digits, and what leaves may hang on that.
      calls_.any = calls_.any || !(f.information.ldlt().rcond() > 1e-7);
      const Eigen::Vector3d move = f.information.ldlt().solve(f.descent);
      if (!calls_.less(options_.refinement_tolerance, f.descent.dot(move))) break;
      const fit g = compare(views, x + move);
      if (g.behind || !calls_.less(g.cost, f.cost)) break;
      x += move;
      f = g;
    }
    return f;
  }

  fit compare(const std::vector<std::size_t>& views, const Eigen::Vector3d& x) {
    fit f;
    double first_size = 0;
    for (const std::size_t i : views) {
      const sight& s = views_[i];
      const Eigen::Vector3d x_c = s.T_cw * x;
      Eigen::Vector3d e;
      Eigen::Matrix3d J;
      if (!project(s, x_c, e, J) || !calls_.less(0, x_c.z(), x_c.norm())) {
        f.worst = i, f.behind = true;
        return f;
      }
      Eigen::Matrix3d N = s.sigma2 * Eigen::Matrix3d::Identity();
      if (s.stereo) N(0, 2) = N(2, 0) = options_.stereo_correlation * s.sigma2;
      const Eigen::Matrix3d W = N.inverse();
      f.information += J.transpose() * W * J;
      f.descent -= J.transpose() * W * e;
      f.cost += e.dot(W * e);
      const double distance = (x - centre(i)).norm(), size = distance * s.scale;
      if (i == views[0]) first_size = size;
      f.farthest = std::max(f.farthest, distance);
      const double error = e.squaredNorm() / (s.sigma2 * (s.stereo ? options_.stereo_chi2 : options_.mono_chi2));
      const double ratio = std::max(size / first_size, first_size / size) /
                           (options_.scale_tolerance * static_cast<double>(options_.scales.scale_factor));
      const double excess = std::max(error, ratio);
      if (i == views[0] || calls_.less(f.excess, excess)) f.worst = i, f.excess = excess;
    }
    return f;
  }

  /// Error and derivative by the point in the world; without u_right the third row is 0.
  static bool project(const sight& s, const Eigen::Vector3d& x, Eigen::Vector3d& e, Eigen::Matrix3d& J) {
    using D = turbomap::dual<3>;
    turbomap::vec2<D> p;
    const turbomap::vec3<D> X{D::variable(x.x(), 0), D::variable(x.y(), 1), D::variable(x.z(), 2)};
    if (!s.camera->project(X, p)) return false;
    const D right = p.x - D(s.bf) / X.z;
    e.setZero(), J.setZero();
    e[0] = p.x.a - s.pixel.x(), e[1] = p.y.a - s.pixel.y();
    for (int k = 0; k < 3; ++k) J(0, k) = p.x.d[k], J(1, k) = p.y.d[k];
    if (s.stereo) {
      e[2] = right.a - s.u_right;
      for (int k = 0; k < 3; ++k) J(2, k) = right.d[k];
    }
    J = (J * s.T_cw.R).eval();
    return true;
  }

  std::vector<sight> views_;
  std::vector<int> keyframes_;
  turbomap::creation_options options_;
  close_calls calls_;
  oracle_track_point result_;
};
TURBOMAP_TEST_EIGEN_END

/// Whether keypoints beside so many views of the track as the options say see one point of the map.
/// \param numbers  by keyframe: the number of the point at each keypoint, -1: none
template <class Descriptor, class Camera>
bool known_oracle(const std::vector<turbomap::posed_keyframe<Descriptor, Camera>>& keyframes,
                  const std::vector<std::vector<std::int32_t>>& numbers,
                  turbomap::span<const turbomap::track_view> views, const turbomap::creation_options& options) {
  std::map<std::int32_t, std::set<std::size_t>> seen;  // views by point
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto k = static_cast<std::size_t>(views[i].keyframe);
    const auto& view = keyframes[k].view;
    for (int j = 0; j < view.keypoint_count; ++j) {
      if (view.camera_of(j) != views[i].camera || numbers[k][static_cast<std::size_t>(j)] < 0) continue;
      if (std::abs(int{view.octave[j]} - int{view.octave[views[i].keypoint]}) > options.known_octaves) continue;
      const double d2 = (pixel_of(view, j) - pixel_of(view, views[i].keypoint)).squaredNorm();
      const double sigma2 = static_cast<double>(oracle_sigma2(options.scales, view.octave[j])) +
                            static_cast<double>(oracle_sigma2(options.scales, view.octave[views[i].keypoint]));
      if (d2 <= options.known_chi2 * sigma2) seen[numbers[k][static_cast<std::size_t>(j)]].insert(i);
    }
  }
  for (const auto& s : seen)
    if (options.known_views > 0 && s.second.size() >= static_cast<std::size_t>(options.known_views)) return true;
  return false;
}

/// Whether two keypoints of a keyframe, of different cameras, are hardly more alike than one of them and another of the other camera
/// that is neither beside its match nor off the curve, or that lies in the direction of a landmark far away.
template <class Descriptor, class Camera>
bool lookalike_oracle(const turbomap::posed_keyframe<Descriptor, Camera>& keyframe, int a, int b,
                      const turbomap::creation_options& options, const turbomap::search_options& search,
                      close_calls& calls) {
  const auto& view = keyframe.view;
  if (view.is_stereo(a) || view.is_stereo(b)) return false;
  const auto alike = [&](int i, int j) {
    return static_cast<double>(Descriptor::distance(view.descriptor_of(i), view.descriptor_of(j)));
  };
  bool found = false;
  for (const auto& [i, match] : {std::pair{a, b}, std::pair{b, a}}) {
    const auto pair = make_oracle_pair(keyframe, view.camera_of(i), keyframe, view.camera_of(match));
    for (int j = 0; j < view.keypoint_count; ++j) {
      if (j == match || view.camera_of(j) != view.camera_of(match)) continue;
      if (above_ratio<Descriptor>(alike(i, match), options.lookalike_ratio, alike(i, j), calls) < 0) continue;
      const double sigma2 = static_cast<double>(oracle_sigma2(options.scales, view.octave[j]) +
                                                oracle_sigma2(options.scales, view.octave[match]));
      if (calls.at_most((pixel_of(view, j) - pixel_of(view, match)).squaredNorm(), options.known_chi2 * sigma2))
        continue;
      const bool far = !pair.straight && calls.less(search.max_parallax_cosine,
                                                    (pair.T_ba.R * bearing_of(view, i)).dot(bearing_of(view, j)), 1);
      found = far || oracle_consistent(pair, view, i, view, j, search, calls) || found;
    }
  }
  return found;
}

/// What becomes of each track. The views are in host memory.
template <class Descriptor, class Camera>
std::vector<oracle_track_point> track_creation_oracle(
    const turbomap::posed_keyframe<Descriptor, Camera>& query,
    turbomap::span<const turbomap::posed_keyframe<Descriptor, Camera>> neighbours, const turbomap::track_list& tracks,
    const turbomap::creation_options& options, const turbomap::search_options& search) {
  std::vector<oracle_track_point> points;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    std::vector<oracle_sight<Camera>> views;
    std::vector<int> in;
    for (auto i = static_cast<std::size_t>(tracks.offsets[t]); i < static_cast<std::size_t>(tracks.offsets[t + 1]);
         ++i) {
      const auto& v = tracks.views[i];
      const auto& keyframe = v.keyframe == 0 ? query : neighbours[static_cast<std::size_t>(v.keyframe) - 1];
      views.push_back(oracle_look(keyframe, v.keypoint, options.scales));
      in.push_back(v.keyframe);
    }
    auto p = track_oracle<Camera>(std::move(views), in, options)();
    std::vector<turbomap::track_view> left;
    for (std::size_t i = 0; i < p.kept.size(); ++i)
      if (p.kept[i] != 0) left.push_back(tracks.views[static_cast<std::size_t>(tracks.offsets[t]) + i]);
    if (p.outcome == turbomap::creation_outcome::accepted && left.size() == 2 && left[0].keyframe == left[1].keyframe &&
        options.lookalike_ratio > 0) {
      const auto k = static_cast<std::size_t>(left[0].keyframe);
      close_calls calls;
      if (lookalike_oracle(k == 0 ? query : neighbours[k - 1], left[0].keypoint, left[1].keypoint, options, search,
                           calls))
        p.outcome = turbomap::creation_outcome::lookalike;
      p.doubtful = p.doubtful || calls.any;
    }
    points.push_back(std::move(p));
  }
  return points;
}

}  // namespace turbomap_test

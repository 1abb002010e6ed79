// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Local mapping as systems in the field write it, before they meet this library: one loop after the other over objects behind
/// shared_ptr, every read through a getter that locks and copies, candidates of one visual word, a grid of keypoints, a change of
/// the map wherever one is found. Written from the published rules [ORB-SLAM3], for one rectified stereo camera, without
/// adjustment. It uses nothing of the library but its plain types, and the thresholds in its options.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include <turbomap/camera/pinhole.hpp>
#include <turbomap/mapping/local_mapper_options.hpp>

#include "../objects_map/objects_map.hpp"

namespace turbomap_before_after {

using turbomap::mapping_stage;
using turbomap_program::keyframe_ptr;
using turbomap_program::point_ptr;

/// What never changes in a keyframe: descriptors, keypoints by word and by cell.
struct features {
  using descriptor = std::array<std::uint8_t, 32>;
  std::vector<descriptor> descriptors;
  std::map<std::uint32_t, std::vector<std::size_t>> words;
  std::vector<std::vector<std::size_t>> cells;  ///< column by column
};

/// World to camera.
struct pose {
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
  explicit pose(const keyframe_ptr& k) {
    const auto T = k->pose();
    R = Eigen::Quaterniond(T.qw, T.qx, T.qy, T.qz).toRotationMatrix();
    t = {T.tx, T.ty, T.tz};
  }
  Eigen::Vector3d centre() const { return -R.transpose() * t; }
};

class sequential_mapping {
 public:
  using camera = turbomap::pinhole<float>;
  using map_type = turbomap_program::objects_map<camera>;

  /// \param bf  of the stereo pair, px m   \param columns, rows  of the grid of keypoints
  sequential_mapping(map_type& map, const camera& c, double bf, const turbomap::image_bounds& bounds, int columns,
                     int rows, const turbomap::local_mapper_options& options)
      : map_(map), bf_(bf), bounds_(bounds), columns_(columns), rows_(rows), options_(options) {
    K_ << c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1;
    K_inverse_ = K_.inverse();
    float scale = 1;
    for (int o = 0; o < options.search.scales.levels; ++o, scale *= options.search.scales.scale_factor)
      scale_.push_back(scale), sigma2_.push_back(scale * scale);
  }

  void insert(const keyframe_ptr& k, const std::uint8_t* descriptors) {
    features f;
    f.descriptors.resize(k->keypoints.size());
    f.cells.resize(static_cast<std::size_t>(columns_ * rows_));
    for (std::size_t i = 0; i < k->keypoints.size(); ++i) {
      std::memcpy(f.descriptors[i].data(), descriptors + 32 * i, 32);
      const auto& keypoint = k->keypoints[i];
      if (keypoint.group != turbomap::keypoint::no_group) f.words[keypoint.group].push_back(i);
      const int column = cell(keypoint.x - bounds_.min_x, inverse_width());
      const int row = cell(keypoint.y - bounds_.min_y, inverse_height());
      if (column >= 0 && column < columns_ && row >= 0 && row < rows_)
        f.cells[static_cast<std::size_t>(column * rows_ + row)].push_back(i);
    }
    features_[k->id] = std::move(f);
  }
  void watch(const std::vector<point_ptr>& created) {
    for (const point_ptr& p : created) recent_.push_back({p, now_});
  }

  /// \param erasing  erasing(keyframe), before it is taken out
  /// \return milliseconds of each stage, without those of counting shared points: see covisible_ms()
  template <class Erasing>
  turbomap::per_stage<double> process(const keyframe_ptr& current, const Erasing& erasing) {
    turbomap::per_stage<double> ms{};
    const auto timed = [&](mapping_stage s, auto work) {
      const double begin = now_ms(), counted = covisible_ms_;
      work();
      ms[s] = now_ms() - begin - (covisible_ms_ - counted);
    };
    covisible_ms_ = 0;
    timed(mapping_stage::process, [&] {
      for (std::size_t i = 0; i < current->keypoints.size(); ++i)
        if (const point_ptr p = current->point(i)) describe(p);
    });
    timed(mapping_stage::point_culling, [&] { cull_points(); });
    timed(mapping_stage::search, [&] { search(current); });
    timed(mapping_stage::creation, [&] { create(current); });
    timed(mapping_stage::fusion, [&] { fuse(current); });
    timed(mapping_stage::keyframe_culling, [&] { cull_keyframes(current, erasing); });
    ++now_;
    return ms;
  }
  /// Of the last process(): counting which keyframes share points.
  double covisible_ms() const { return covisible_ms_; }

 private:
  static double now_ms() {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
  }
  static int cell(float offset, float inverse) { return static_cast<int>(std::round(offset * inverse)); }
  float inverse_width() const { return static_cast<float>(columns_) / (bounds_.max_x - bounds_.min_x); }
  float inverse_height() const { return static_cast<float>(rows_) / (bounds_.max_y - bounds_.min_y); }
  static int distance(const std::uint8_t* a, const std::uint8_t* b) {
    int bits = 0;
    for (int word = 0; word < 4; ++word) {
      std::uint64_t x, y;
      std::memcpy(&x, a + 8 * word, 8), std::memcpy(&y, b + 8 * word, 8);
      bits += __builtin_popcountll(x ^ y);
    }
    return bits;
  }

  // ---- Changes of the map: always both sides. -----------------------------------------------------------------------
  static bool observe(const point_ptr& p, const keyframe_ptr& k, std::size_t i) {
    if (k->point(i) || p->seen_by(k)) return false;
    p->add_observation(k, i);
    k->set_point(i, p);
    return true;
  }
  void erase(const point_ptr& p, const point_ptr& replacement = nullptr) {
    for (const auto& v : map_.observations(p)) {
      p->erase_observation(v.keyframe, v.keypoint);
      v.keyframe->set_point(v.keypoint, nullptr);
    }
    map_.retire(p, replacement);
  }
  void replace(const point_ptr& from, const point_ptr& into) {
    const auto views = map_.observations(from);
    erase(from, into);
    for (const auto& v : views) observe(into, v.keyframe, v.keypoint);
  }
  void forget(const keyframe_ptr& k, std::size_t i, const point_ptr& p) {
    p->erase_observation(k, i);
    k->set_point(i, nullptr);
    if (p->reference() != k) return;
    keyframe_ptr first;
    for (const auto& v : map_.observations(p))
      if (!first || v.keyframe->id < first->id) first = v.keyframe;
    if (first) p->set_reference(first);
  }

  // ---- Descriptor, normal and range of a point. ---------------------------------------------------------------------
  void describe(const point_ptr& p, bool geometry = true) {
    if (p->bad()) return;
    auto views = map_.observations(p);
    if (views.empty()) return;
    std::sort(views.begin(), views.end(), [](const auto& a, const auto& b) { return a.keyframe->id < b.keyframe->id; });
    std::vector<const std::uint8_t*> descriptors;
    for (const auto& v : views) descriptors.push_back(features_.at(v.keyframe->id).descriptors[v.keypoint].data());
    std::size_t best = 0;
    int least = 257;
    for (std::size_t a = 0; a < descriptors.size(); ++a) {
      std::vector<int> row;
      for (const std::uint8_t* other : descriptors) row.push_back(distance(descriptors[a], other));
      std::sort(row.begin(), row.end());
      const int median = row[(row.size() - 1) / 2];
      if (median < least) least = median, best = a;
    }
    auto look = p->appearance();
    if (geometry) {
      const auto X = p->position();
      const Eigen::Vector3d x(X.x, X.y, X.z);
      const keyframe_ptr named = p->reference();
      const auto* reference = &views.front();
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (const auto& v : views) {
        sum += (x - pose(v.keyframe).centre()).normalized();
        if (v.keyframe == named) reference = &v;
      }
      sum /= static_cast<double>(views.size());
      const auto octave = reference->keyframe->keypoints[reference->keypoint].octave;
      const double most = (x - pose(reference->keyframe).centre()).norm() * static_cast<double>(scale_[octave]);
      look.normal = {static_cast<float>(sum.x()), static_cast<float>(sum.y()), static_cast<float>(sum.z())};
      look.max_distance = static_cast<float>(most);
      look.min_distance = static_cast<float>(most / static_cast<double>(scale_.back()));
    }
    p->set_appearance(look, descriptors[best]);
  }

  // ---- The stages. --------------------------------------------------------------------------------------------------
  void cull_points() {
    const auto& o = options_.point_culling;
    std::vector<std::pair<point_ptr, std::int64_t>> kept;
    for (const auto& [p, since] : recent_) {
      if (p->bad()) continue;
      if (p->found_ratio() < o.min_found_ratio ||
          (now_ - since >= o.patience && p->measurements() <= o.fewest_measurements))
        erase(p);
      else if (now_ - since < o.probation)
        kept.push_back({p, since});
    }
    recent_.swap(kept);
  }

  /// Most shared points first. They are counted when asked for, as the library does. Systems keep them in a graph that commits
  /// update now and then, which saves most of this; so its time is told apart.
  std::vector<keyframe_ptr> covisible(const keyframe_ptr& query, int limit) {
    const double begin = now_ms();
    std::map<keyframe_ptr, int> shared;
    for (std::size_t i = 0; i < query->keypoints.size(); ++i) {
      const point_ptr p = query->point(i);
      if (!p || p->bad()) continue;
      for (const auto& [weak, views] : p->observations())
        if (const keyframe_ptr k = weak.lock(); k && k != query) ++shared[k];
    }
    std::vector<std::pair<int, keyframe_ptr>> ranked;
    for (const auto& [k, count] : shared) ranked.push_back({count, k});
    std::sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) {
      return a.first != b.first ? a.first > b.first : a.second->id < b.second->id;
    });
    std::vector<keyframe_ptr> best;
    for (const auto& [count, k] : ranked)
      if (static_cast<int>(best.size()) < limit &&
          (count >= options_.neighbours.neighbourhood.min_shared_points || best.empty()))
        best.push_back(k);
    covisible_ms_ += now_ms() - begin;
    return best;
  }

  void search(const keyframe_ptr& current) {
    matches_.clear();
    const pose T_a(current);
    const features& a = features_.at(current->id);
    const auto& o = options_.search;
    std::vector<bool> taken_a;
    for (std::size_t i = 0; i < current->keypoints.size(); ++i) taken_a.push_back(current->point(i) != nullptr);
    for (const keyframe_ptr& n : covisible(current, options_.neighbours.neighbourhood.neighbours)) {
      const pose T_b(n);
      if ((T_a.centre() - T_b.centre()).norm() < options_.neighbours.stereo_baseline) continue;
      const features& b = features_.at(n->id);
      const Eigen::Matrix3d R = T_b.R * T_a.R.transpose();
      const Eigen::Vector3d t = T_b.t - R * T_a.t;
      Eigen::Matrix3d cross;
      cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
      const Eigen::Matrix3d F = K_inverse_.transpose() * cross * R * K_inverse_;
      const Eigen::Vector2d epipole = (K_ * t).hnormalized();
      std::vector<bool> taken_b;
      for (std::size_t j = 0; j < n->keypoints.size(); ++j) taken_b.push_back(n->point(j) != nullptr);
      std::vector<std::int64_t> match(current->keypoints.size(), -1);
      auto wa = a.words.begin();
      auto wb = b.words.begin();
      while (wa != a.words.end() && wb != b.words.end()) {
        if (wa->first < wb->first) {
          wa = a.words.lower_bound(wb->first);
        } else if (wb->first < wa->first) {
          wb = b.words.lower_bound(wa->first);
        } else {
          for (const std::size_t i : wa->second) {
            if (taken_a[i]) continue;
            const auto& ka = current->keypoints[i];
            const Eigen::Vector3d line = F * Eigen::Vector3d(ka.x, ka.y, 1);
            const double norm2 = line.head<2>().squaredNorm();
            int best = static_cast<int>(o.max_distance);
            for (const std::size_t j : wb->second) {
              if (taken_b[j]) continue;
              const int d = distance(a.descriptors[i].data(), b.descriptors[j].data());
              if (d > best) continue;  // of equal ones the last wins
              const auto& kb = n->keypoints[j];
              if (ka.u_right < 0 && kb.u_right < 0) {
                const double radius = o.epipole_radius * std::sqrt(static_cast<double>(scale_[kb.octave]));
                if ((epipole - Eigen::Vector2d(kb.x, kb.y)).norm() < radius) continue;
              }
              const double off = line.dot(Eigen::Vector3d(kb.x, kb.y, 1));
              if (!(norm2 > 0) || !(off * off < o.line_chi2 * static_cast<double>(sigma2_[kb.octave]) * norm2))
                continue;
              best = d, match[i] = static_cast<std::int64_t>(j);
            }
          }
          ++wa, ++wb;
        }
      }
      matches_.push_back({n, std::move(match)});
    }
  }

  /// A keypoint as triangulation sees it.
  struct sight {
    const turbomap::keypoint& keypoint;
    const pose& T;
    Eigen::Vector3d ray;
    double parallax = 2;  ///< cosine of that of the stereo pair
  };
  sight look(const keyframe_ptr& k, std::size_t i, const pose& T) const {
    const auto& keypoint = k->keypoints[i];
    sight s{keypoint, T, K_inverse_ * Eigen::Vector3d(keypoint.x, keypoint.y, 1)};
    if (keypoint.u_right >= 0)
      s.parallax = std::cos(2 * std::atan2(bf_ / K_(0, 0) / 2, static_cast<double>(keypoint.depth)));
    return s;
  }
  bool reprojects(const sight& s, const Eigen::Vector3d& x_c) const {
    const auto& o = options_.creation;
    const double sigma2 = static_cast<double>(sigma2_[s.keypoint.octave]);
    const Eigen::Vector2d e = (K_ * x_c).hnormalized() - Eigen::Vector2d(s.keypoint.x, s.keypoint.y);
    if (s.keypoint.u_right < 0) return e.squaredNorm() <= o.mono_chi2 * sigma2;
    const double right =
        e.x() + static_cast<double>(s.keypoint.x) - bf_ / x_c.z() - static_cast<double>(s.keypoint.u_right);
    return e.squaredNorm() + right * right <= o.stereo_chi2 * sigma2;
  }
  bool make_point(const sight& a, const sight& b, Eigen::Vector3d& x) const {
    const auto& o = options_.creation;
    const bool stereo_a = a.keypoint.u_right >= 0, stereo_b = b.keypoint.u_right >= 0;
    const double parallax = (a.T.R.transpose() * a.ray).normalized().dot((b.T.R.transpose() * b.ray).normalized());
    if (parallax < std::min(a.parallax, b.parallax) && parallax > 0 &&
        (stereo_a || stereo_b || parallax < o.max_parallax_cosine)) {
      Eigen::Matrix4d A;
      const auto rows = [&A](int at, const sight& s) {
        Eigen::Matrix<double, 3, 4> P;
        P << s.T.R, s.T.t;
        A.row(at) = s.ray.x() * P.row(2) - P.row(0);
        A.row(at + 1) = s.ray.y() * P.row(2) - P.row(1);
      };
      rows(0, a), rows(2, b);
      const Eigen::Vector4d h = Eigen::JacobiSVD<Eigen::Matrix4d>(A, Eigen::ComputeFullV).matrixV().col(3);
      if (h[3] == 0) return false;
      x = h.head<3>() / h[3];
    } else if (stereo_a && a.parallax < b.parallax) {
      if (!(a.keypoint.depth > 0)) return false;
      x = a.T.R.transpose() * (static_cast<double>(a.keypoint.depth) * a.ray - a.T.t);
    } else if (stereo_b && b.parallax < a.parallax) {
      if (!(b.keypoint.depth > 0)) return false;
      x = b.T.R.transpose() * (static_cast<double>(b.keypoint.depth) * b.ray - b.T.t);
    } else {
      return false;
    }
    const Eigen::Vector3d x_a = a.T.R * x + a.T.t, x_b = b.T.R * x + b.T.t;
    if (!(x_a.z() > 0) || !(x_b.z() > 0) || !reprojects(a, x_a) || !reprojects(b, x_b)) return false;
    const double distances = x_b.norm() / x_a.norm();
    const double octaves =
        static_cast<double>(scale_[a.keypoint.octave]) / static_cast<double>(scale_[b.keypoint.octave]);
    const double tolerance = o.scale_tolerance * static_cast<double>(o.scales.scale_factor);
    return !(distances * tolerance < octaves) && !(octaves * tolerance < distances);
  }
  void create(const keyframe_ptr& current) {
    const pose T_a(current);
    for (const auto& [n, match] : matches_) {
      const pose T_b(n);
      for (std::size_t i = 0; i < match.size(); ++i) {
        if (match[i] < 0) continue;
        const auto j = static_cast<std::size_t>(match[i]);
        Eigen::Vector3d x;
        if (current->point(i) || n->point(j) || !make_point(look(current, i, T_a), look(n, j, T_b), x)) continue;
        const point_ptr p = map_.add_point({x.x(), x.y(), x.z()}, current);
        observe(p, current, i);
        observe(p, n, j);
        describe(p);
        recent_.push_back({p, now_});
      }
    }
  }

  void fuse(const keyframe_ptr& current) {
    std::vector<keyframe_ptr> targets;
    std::set<keyframe_ptr> listed{current};
    const auto& o = options_.neighbours.neighbourhood;
    const auto neighbours = covisible(current, o.neighbours);
    for (const keyframe_ptr& k : neighbours)
      if (listed.insert(k).second) targets.push_back(k);
    for (const keyframe_ptr& n : neighbours)
      for (const keyframe_ptr& k : covisible(n, o.second_neighbours))
        if (listed.insert(k).second) targets.push_back(k);
    std::set<point_ptr> touched;
    const auto points = points_of({current});
    for (const keyframe_ptr& k : targets) fuse_into(k, points, touched);
    fuse_into(current, points_of(targets), touched);
    for (const point_ptr& p : touched) describe(p);
  }
  static std::vector<point_ptr> points_of(const std::vector<keyframe_ptr>& keyframes) {
    std::vector<point_ptr> points;
    std::set<point_ptr> listed;
    for (const keyframe_ptr& k : keyframes)
      for (std::size_t i = 0; i < k->keypoints.size(); ++i)
        if (const point_ptr p = k->point(i); p && !p->bad() && listed.insert(p).second) points.push_back(p);
    return points;
  }
  void fuse_into(const keyframe_ptr& target, const std::vector<point_ptr>& points, std::set<point_ptr>& touched) {
    const pose T(target);
    std::vector<std::pair<point_ptr, std::size_t>> found;
    for (const point_ptr& p : points) {
      if (p->bad() || p->seen_by(target)) continue;
      const std::int64_t at = find(p, target, T);
      if (at >= 0) found.push_back({p, static_cast<std::size_t>(at)});
    }
    std::vector<point_ptr> survivors;
    for (const auto& [searched, i] : found) {
      point_ptr p = searched;
      while (p && p->bad()) p = p->replacement();
      if (!p || p->seen_by(target)) continue;
      const point_ptr holder = target->point(i);
      if (!holder) {
        observe(p, target, i);
        touched.insert(p);
        continue;
      }
      const bool holder_stays = holder->measurements() > p->measurements();
      const point_ptr from = holder_stays ? p : holder, into = holder_stays ? holder : p;
      replace(from, into);
      touched.insert(into), survivors.push_back(into);
    }
    for (const point_ptr& p : survivors) describe(p, false);
  }
  /// The keypoint that looks most like the point where it should be seen; -1: none.
  std::int64_t find(const point_ptr& p, const keyframe_ptr& target, const pose& T) const {
    const auto& o = options_.fusion.search;
    const auto X = p->position();
    const auto look = p->appearance();
    const Eigen::Vector3d x(X.x, X.y, X.z), x_c = T.R * x + T.t;
    if (!(x_c.z() > 0)) return -1;
    const Eigen::Vector2d uv = (K_ * x_c).hnormalized();
    if (!(uv.x() >= static_cast<double>(bounds_.min_x) && uv.x() < static_cast<double>(bounds_.max_x) &&
          uv.y() >= static_cast<double>(bounds_.min_y) && uv.y() < static_cast<double>(bounds_.max_y)))
      return -1;
    const Eigen::Vector3d ray = x - T.centre();
    const double range = ray.norm();
    if (range < static_cast<double>(static_cast<float>(o.min_range_factor) * look.min_distance) ||
        range > static_cast<double>(static_cast<float>(o.max_range_factor) * look.max_distance))
      return -1;
    if (ray.dot(Eigen::Vector3d(look.normal.x, look.normal.y, look.normal.z)) < o.min_view_cosine * range) return -1;
    int level = 0;
    while (level < o.scales.levels - 1 && static_cast<double>(look.max_distance) / range >
                                              static_cast<double>(scale_[static_cast<std::size_t>(level)]))
      ++level;
    const double radius = o.radius * static_cast<double>(scale_[static_cast<std::size_t>(level)]);
    const auto clamped = [](int c, int count) { return std::min(std::max(c, 0), count - 1); };
    const auto offset = [](double at, float from) { return static_cast<float>(at - static_cast<double>(from)); };
    const int first_column = clamped(cell(offset(uv.x() - radius, bounds_.min_x), inverse_width()), columns_);
    const int last_column = clamped(cell(offset(uv.x() + radius, bounds_.min_x), inverse_width()), columns_);
    const int first_row = clamped(cell(offset(uv.y() - radius, bounds_.min_y), inverse_height()), rows_);
    const int last_row = clamped(cell(offset(uv.y() + radius, bounds_.min_y), inverse_height()), rows_);
    const features& f = features_.at(target->id);
    std::int64_t best = -1;
    int least = 257;
    for (int column = first_column; column <= last_column; ++column)
      for (int row = first_row; row <= last_row; ++row)
        for (const std::size_t i : f.cells[static_cast<std::size_t>(column * rows_ + row)]) {
          const auto& k = target->keypoints[i];
          const Eigen::Vector2d e = Eigen::Vector2d(k.x, k.y) - uv;
          if (!(std::abs(e.x()) < radius && std::abs(e.y()) < radius)) continue;
          if (k.octave < level - 1 || k.octave > level) continue;
          const bool stereo = k.u_right >= 0;
          const double right = stereo ? static_cast<double>(k.u_right) - (uv.x() - bf_ / x_c.z()) : 0;
          if ((e.squaredNorm() + right * right) / static_cast<double>(sigma2_[k.octave]) >
              (stereo ? o.stereo_chi2 : o.mono_chi2))
            continue;
          const int d = distance(p->descriptor(), f.descriptors[i].data());
          if (d < least) least = d, best = static_cast<std::int64_t>(i);
        }
    return static_cast<double>(least) <= o.max_distance ? best : -1;
  }

  template <class Erasing>
  void cull_keyframes(const keyframe_ptr& current, const Erasing& erasing) {
    const auto& o = options_.keyframe_culling;
    std::set<point_ptr> touched;
    int erased = 0;
    for (const keyframe_ptr& k : covisible(current, o.most_candidates)) {
      if (erased == o.most_erased) break;
      if (k->id == 0 || k->bad()) continue;
      int points = 0, redundant = 0;
      for (std::size_t i = 0; i < k->keypoints.size(); ++i) {
        const point_ptr p = k->point(i);
        if (!p || p->bad()) continue;
        const auto& keypoint = k->keypoints[i];
        if (keypoint.depth > o.max_depth || keypoint.depth < 0) continue;
        ++points;
        if (p->measurements() <= o.observers) continue;
        int others = 0;
        for (const auto& [weak, views] : p->observations()) {
          const keyframe_ptr other = weak.lock();
          if (!other || other == k) continue;
          const auto& seen = other->keypoints[static_cast<std::size_t>(views.keypoint[0])];
          if (seen.octave <= keypoint.octave + o.octave_slack && ++others > o.observers) break;
        }
        redundant += others > o.observers ? 1 : 0;
      }
      if (!(static_cast<float>(redundant) > o.redundant_share * static_cast<float>(points))) continue;
      erasing(k);
      for (std::size_t i = 0; i < k->keypoints.size(); ++i) {
        const point_ptr p = k->point(i);
        if (!p) continue;
        forget(k, i, p);
        if (p->measurements() <= o.fewest_measurements)
          erase(p);
        else
          touched.insert(p);
      }
      map_.erase_keyframe(k);
      features_.erase(k->id);
      ++erased;
    }
    for (const point_ptr& p : touched) describe(p);
  }

  map_type& map_;
  Eigen::Matrix3d K_, K_inverse_;
  double bf_;
  turbomap::image_bounds bounds_;
  int columns_, rows_;
  turbomap::local_mapper_options options_;
  std::vector<float> scale_, sigma2_;
  std::map<std::uint64_t, features> features_;  ///< by keyframe
  std::vector<std::pair<point_ptr, std::int64_t>> recent_;
  std::vector<std::pair<keyframe_ptr, std::vector<std::int64_t>>> matches_;
  std::int64_t now_ = 0;
  double covisible_ms_ = 0;
};

}  // namespace turbomap_before_after

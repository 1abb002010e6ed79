// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Epipolar order: the candidates of a neighbour sorted by the angle of their epipolar plane, so that those which can match
/// a query keypoint are a short window. Exact: a candidate outside the window cannot pass the epipolar test.
///
/// All planes through the baseline of two views are ordered by one angle. A keypoint that may be off by r pixels fixes its
/// plane up to a half-width w, large for coarse octaves and near the epipole. Candidates are sorted into classes of w, each
/// class into buckets of angle (one counting sort); a query reads, of each class, the buckets that overlap its own angle
/// +- (its w + the class's w). Half-widths are upper bounds with a slack far above float rounding: the windows may be too
/// long, never too short.

#include <cmath>
#include <cstdint>

#include "../config.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Shape of the classes and buckets: a compromise between comparing too much and reading too many windows, measured; no
/// influence on results.
struct epipolar_order_layout {
  static constexpr int class_count = 2;  ///< each class is 4 times as wide as the one before; candidates wider than the
                                         ///< last are compared with every query
  static constexpr float typical = 2;    ///< class 0 is this times the mean half-width of the table's candidates
  static constexpr float widest = 1.0F / 3;  ///< but not wider, rad
  static constexpr float slack = 3e-4F;      ///< rad, added to every half-width
  static constexpr float pi = 3.14159265F;

  static constexpr int bucket_count(int k) { return 1024 >> (2 * k); }  ///< over the full circle
  static constexpr int first_bucket(int k) { return k == 0 ? 0 : first_bucket(k - 1) + bucket_count(k - 1); }
  /// All buckets, and one more for the candidates of every query.
  static constexpr int total_buckets() { return first_bucket(class_count) + 1; }
};

/// An approximation of atan2 in [0, 2 pi), wrong by less than 1e-4: what decides comes later.
inline float plane_angle(float y, float x) {
  const float ax = std::fabs(x), ay = std::fabs(y);
  const float big = ax > ay ? ax : ay, small = ax > ay ? ay : ax;
  const float t = big > 0 ? small / big : 0.0F, t2 = t * t;
  float angle =
      t * (0.99997726F +
           t2 * (-0.33262347F + t2 * (0.19354346F + t2 * (-0.11643287F + t2 * (0.05265332F - t2 * 0.01172120F)))));
  angle = ax > ay ? angle : epipolar_order_layout::pi / 2 - angle;
  angle = x < 0 ? epipolar_order_layout::pi - angle : angle;
  return y < 0 ? 2 * epipolar_order_layout::pi - angle : angle;
}

/// Upper bound of asin on [0, 1], exact at both ends.
inline float asin_bound(float s) { return s + 0.5708F * s * s * s; }

/// Where a keypoint's plane is, and how far off it may be.
struct plane_interval {
  float angle;       ///< [0, 2 pi); straight images: twice the angle of the full plane, which repeats after pi
  float half_width;  ///< in the same measure; < 0: unbounded, matches every angle
};

/// One side of a pair of cameras: what turns a bearing into a plane interval. Straight images accept both sides of the
/// epipole, so their planes are full planes with period pi: angle and width are doubled, and the circle is the same for both.
class plane_measure {
 public:
  /// Straight images: the keypoint may be `chi` standard deviations off its line; `focal` is the smaller focal length.
  static plane_measure line(const pair_geometry& g, double chi, double focal) {
    return {g, static_cast<float>(chi / focal), nullptr};
  }
  /// Curved images: the keypoint may be `chi` standard deviations off the projection of the point.
  static plane_measure ray(const pair_geometry& g, double chi, const resolution_profile& resolution) {
    return {g, resolution.known() ? static_cast<float>(chi) : 1e30F, &resolution};
  }

  /// Interval of a keypoint of `scale` px standard deviation whose bearing in the neighbour's frame is `b`.
  /// \param cosine  of the angle between the bearing and its own camera's optical axis
  plane_interval operator()(const vec3<float>& b, float cosine, float scale) const {
    const float px = b.x * x_.x + b.y * x_.y + b.z * x_.z, py = b.x * y_.x + b.y * y_.y + b.z * y_.z;
    const float distance = std::sqrt(px * px + py * py);  // sine of the angle to the baseline
    // Straight: |sin(difference)| < chi scale / (focal m), m = distance to the baseline on the image plane z = 1.
    // Curved: the ray may turn by chi scale / (pixels per radian), seen from the baseline over the sine of its angle to it.
    const float s = resolution_ == nullptr ? reach_ * scale * b.z : reach_ * scale / resolution_->at(cosine);
    // The profile holds near the keypoint only.
    const bool near = resolution_ == nullptr || reach_ * scale <= static_cast<float>(resolution_profile::margin);
    if (!near || !(s < distance) || distance < 1e-3F) return {0, -1};
    const float width = asin_bound(s / distance) * 1.01F + epipolar_order_layout::slack;
    float angle = plane_angle(py, px);
    if (resolution_ != nullptr) return {angle, width};
    if (angle >= epipolar_order_layout::pi) angle -= epipolar_order_layout::pi;
    return {2 * angle, 2 * width};
  }

 private:
  plane_measure(const pair_geometry& g, float reach, const resolution_profile* resolution)
      : x_(g.plane_x), y_(g.plane_y), reach_(reach), resolution_(resolution) {
    if (g.baseline.x == 0 && g.baseline.y == 0 && g.baseline.z == 0) reach_ = 1e30F;
  }

  vec3<float> x_, y_;
  float reach_;
  const resolution_profile* resolution_;
};

/// The sorted candidates of one (neighbour, query camera, neighbour camera).
struct epipolar_table {
  using layout = epipolar_order_layout;

  std::int32_t* offsets;     ///< total_buckets() + 1
  std::int32_t* candidates;  ///< by class, then bucket; within a bucket in no particular order
  float* narrowest;          ///< half-width of class 0, rad

  float class_width(int k) const { return *narrowest * static_cast<float>(1 << (2 * k)); }
  /// Class of a half-width: the first that is wide enough, or class_count when none is.
  int width_class(float half_width) const {
    int k = half_width < 0 ? layout::class_count : 0;
    while (k < layout::class_count && half_width > class_width(k)) ++k;
    return k;
  }
  static int bucket_of(int k, float angle) {
    const int n = layout::bucket_count(k);
    const int bucket = static_cast<int>(angle * (static_cast<float>(n) / (2 * layout::pi)));
    return bucket < 0 ? 0 : bucket >= n ? n - 1 : bucket;
  }

  /// Sorts `count` candidates: chooses the classes by their intervals, then one counting sort by bucket.
  /// \param keys  scratch of `count`
  void build(const std::int32_t* keypoints, const plane_interval* intervals, std::int32_t* keys, int count) {
    float sum = 0;
    int bounded = 0;
    for (int i = 0; i < count; ++i) {
      sum += intervals[i].half_width < 0 ? 0 : intervals[i].half_width;
      bounded += intervals[i].half_width < 0 ? 0 : 1;
    }
    const float typical = bounded == 0 ? layout::widest : layout::typical * sum / static_cast<float>(bounded);
    *narrowest = typical < layout::widest ? typical : layout::widest;
    for (int i = 0; i <= layout::total_buckets(); ++i) offsets[i] = 0;
    for (int i = 0; i < count; ++i) {
      const int k = width_class(intervals[i].half_width);
      keys[i] = k == layout::class_count ? layout::total_buckets() - 1
                                         : layout::first_bucket(k) + bucket_of(k, intervals[i].angle);
      ++offsets[keys[i] + 1];
    }
    for (int i = 0; i < layout::total_buckets(); ++i) offsets[i + 1] += offsets[i];
    // Filling moves every offset to the end of its bucket, which is the start of the next: shifted back afterwards.
    for (int i = 0; i < count; ++i) candidates[offsets[keys[i]]++] = keypoints[i];
    for (int i = layout::total_buckets(); i > 0; --i) offsets[i] = offsets[i - 1];
    offsets[0] = 0;
  }

  bool empty() const { return offsets[layout::total_buckets()] == 0; }

  /// Calls visit(first, last) for ranges of `candidates` that together hold every candidate whose interval meets `q`.
  template <class Visit>
  void windows(const plane_interval& q, Visit visit) const {
    constexpr int everywhere = layout::total_buckets() - 1;
    if (q.half_width < 0) {
      visit(offsets[0], offsets[everywhere + 1]);
      return;
    }
    for (int k = 0; k < layout::class_count; ++k) {
      const int first = layout::first_bucket(k), n = layout::bucket_count(k);
      if (offsets[first] == offsets[first + n]) continue;
      const float half = q.half_width + class_width(k), per_bucket = static_cast<float>(n) / (2 * layout::pi);
      const int low = static_cast<int>(std::floor((q.angle - half) * per_bucket));
      const int high = static_cast<int>(std::floor((q.angle + half) * per_bucket));
      if (high - low + 1 >= n) {
        visit(offsets[first], offsets[first + n]);
      } else if (low < 0) {
        visit(offsets[first], offsets[first + high + 1]);
        visit(offsets[first + n + low], offsets[first + n]);
      } else if (high >= n) {
        visit(offsets[first], offsets[first + high - n + 1]);
        visit(offsets[first + low], offsets[first + n]);
      } else {
        visit(offsets[first + low], offsets[first + high + 1]);
      }
    }
    visit(offsets[everywhere], offsets[everywhere + 1]);
  }
};

TURBOMAP_END_NAMESPACE

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
/// +- (its w + the class's w). One class is enough: the few wider candidates are compared with every query. Half-widths are
/// upper bounds with a slack far above float rounding: the windows may be too long, never too short.

#include <cmath>
#include <cstdint>

#include "../config.hpp"
#include "../math/pack.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Shape of the classes and buckets: a compromise between comparing too much and reading too many windows, measured; no
/// influence on results.
struct epipolar_order_layout {
  static constexpr int class_count =
      1;                               ///< candidates wider than the last are compared with every query; if there were
                                       ///< more classes, each would be 4 times as wide as the one before
  static constexpr float typical = 4;  ///< class 0 is this times the mean half-width of the table's candidates
  static constexpr float widest = 1.0F / 3;  ///< but not wider, rad
  static constexpr float slack = 3e-4F;      ///< rad, added to every half-width
  static constexpr float pi = 3.14159265F;

  static constexpr int bucket_count(int k) { return 1024 >> (2 * k); }  ///< over the full circle
  static constexpr int first_bucket(int k) { return k == 0 ? 0 : first_bucket(k - 1) + bucket_count(k - 1); }
  /// All buckets, and one more for the candidates of every query.
  static constexpr int total_buckets() { return first_bucket(class_count) + 1; }
};

/// An approximation of atan2 in [0, 2 pi), wrong by less than 1e-4: what decides comes later. F: float, or a pack of them.
template <class F>
F plane_angle(F y, F x) {
  const F zero(0.0F), pi(epipolar_order_layout::pi), ax = larger(x, -x), ay = larger(y, -y);
  const F big = larger(ax, ay), small = select_greater(ax, ay, ay, ax);
  const F t = small / select_greater(big, zero, big, F(1.0F)), t2 = t * t;
  F angle = F(0.05265332F) - t2 * F(0.01172120F);
  angle = F(0.19354346F) + t2 * (F(-0.11643287F) + t2 * angle);
  angle = t * (F(0.99997726F) + t2 * (F(-0.33262347F) + t2 * angle));
  angle = select_greater(ax, ay, angle, pi * F(0.5F) - angle);
  angle = select_greater(zero, x, pi - angle, angle);
  return select_greater(zero, y, F(2.0F) * pi - angle, angle);
}

/// Upper bound of asin on [0, 1], exact at both ends.
template <class F>
F asin_bound(F s) {
  return s + F(0.5708F) * s * s * s;
}

/// Where a keypoint's plane is, and how far off it may be.
struct plane_interval {
  float angle;       ///< [0, 2 pi); straight images: twice the angle of the full plane, which repeats after pi
  float half_width;  ///< in the same measure; < 0: unbounded, matches every angle
};

/// Rays of keypoints, measured together. Places behind the last are read, so they hold numbers.
struct ray_batch {
  static constexpr int size = 64;
  float x[size] = {}, y[size] = {}, z[size] = {};
  float spread[size] = {};  ///< plane_measure::spread()

  void set(int i, const vec3<float>& ray, float ray_spread) {
    x[i] = ray.x, y[i] = ray.y, z[i] = ray.z, spread[i] = ray_spread;
  }
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

  /// How far a keypoint of `scale` px standard deviation may be off. It does not depend on the other camera.
  /// Straight: |sin(difference)| < chi scale / (focal m), m = distance to the baseline on the image plane z = 1.
  /// Curved: the ray may turn by chi scale / (pixels per radian), seen from the baseline over the sine of its angle to it.
  /// \param cosine  of the angle between the bearing and its own camera's optical axis: its z there
  float spread(float cosine, float scale) const {
    if (resolution_ == nullptr) return reach_ * scale * cosine;
    // The profile holds near the keypoint only.
    const float off = reach_ * scale;
    return off <= static_cast<float>(resolution_profile::margin) ? off / resolution_->at(cosine) : unbounded;
  }
  /// The same measure, for bearings in the frame of the query's camera.
  plane_measure turned(const mat3<decision>& R_ba) const {
    const auto turn = [&](const vec3<float>& v) {
      const auto column = [&](int c) {
        return static_cast<float>(R_ba.m[c].value) * v.x + static_cast<float>(R_ba.m[c + 3].value) * v.y +
               static_cast<float>(R_ba.m[c + 6].value) * v.z;
      };
      return vec3<float>{column(0), column(1), column(2)};
    };
    plane_measure m = *this;
    m.x_ = turn(x_), m.y_ = turn(y_);
    return m;
  }
  /// Interval of a keypoint whose bearing is `b`. \param s  spread()
  plane_interval operator()(const vec3<float>& b, float s) const {
    plane_interval interval;
    measure(b.x, b.y, b.z, s, interval.angle, interval.half_width);
    return interval;
  }
  /// Those of `count` keypoints.
  void operator()(const ray_batch& rays, int count, plane_interval* intervals) const {
    using P = pack<float, 8>;
    static_assert(ray_batch::size % P::lanes == 0);
    for (int i = 0; i < count; i += P::lanes) {
      P angle, half_width;
      measure(P::load(rays.x + i), P::load(rays.y + i), P::load(rays.z + i), P::load(rays.spread + i), angle,
              half_width);
      float angles[P::lanes], widths[P::lanes];
      angle.store(angles), half_width.store(widths);
      for (int l = 0; l < P::lanes && i + l < count; ++l) intervals[i + l] = {angles[l], widths[l]};
    }
  }

 private:
  static constexpr float unbounded = 1e30F;

  plane_measure(const pair_geometry& g, float reach, const resolution_profile* resolution)
      : x_(g.plane_x),
        y_(g.plane_y),
        reach_(reach),
        least_(g.baseline.x == 0 && g.baseline.y == 0 && g.baseline.z == 0 ? unbounded : 1e-3F),
        resolution_(resolution) {}

  template <class F>
  void measure(F bx, F by, F bz, F s, F& angle, F& half_width) const {
    using std::sqrt;
    const F px = bx * F(x_.x) + by * F(x_.y) + bz * F(x_.z), py = bx * F(y_.x) + by * F(y_.y) + bz * F(y_.z);
    const F distance = sqrt(px * px + py * py);  // sine of the angle to the baseline
    const F width = asin_bound(s / larger(distance, F(1e-30F))) * F(1.01F) + F(epipolar_order_layout::slack);
    angle = plane_angle(py, px);
    F w = width;
    if (resolution_ == nullptr) {
      const F pi(epipolar_order_layout::pi);
      angle = F(2.0F) * select_greater(pi, angle, angle, angle - pi);
      w = F(2.0F) * width;
    }
    // What is no number is unbounded.
    half_width = select_greater(distance, s, select_greater(distance, F(least_), w, F(-1.0F)), F(-1.0F));
  }

  vec3<float> x_, y_;
  float reach_;
  float least_;  ///< nearer to the baseline a plane is unknown
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

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Epipolar order: the candidates of a neighbour sorted by the angle of their epipolar plane, so that those which can match
/// a query keypoint are a short window. Exact: a candidate outside the window cannot pass the epipolar test.
///
/// All planes through the baseline of two views are ordered by one angle. A keypoint that may be off by r pixels fixes its
/// plane up to a half-width w, large for coarse octaves and near the epipole. Candidates of up to some w are sorted into buckets
/// of angle (one counting sort); a query reads the buckets that overlap its own angle +- (its w + that w). The few wider
/// candidates are compared with every query. In a window the intervals of the candidates are compared one by one before their
/// descriptors (plane_codes.hpp). Half-widths are upper bounds with a slack far above float rounding: the windows may be
/// too long, never too short.

#include <cmath>
#include <cstdint>

#include "../config.hpp"
#include "../math/pack.hpp"
#include "plane_codes.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Shape of the buckets: a compromise between comparing too much and reading too many windows, measured; no influence on
/// results.
struct epipolar_order_layout {
  /// Candidates are sorted up to this times the mean half-width of the table's; wider ones are compared with every query.
  static constexpr int typical = 4;
  static constexpr float widest = 1.0F / 3;  ///< but not beyond, rad
  static constexpr float slack = 3e-4F;      ///< rad, added to every half-width
  static constexpr float pi = 3.14159265F;   ///< half a turn, rad

  static constexpr int bucket_count = 1024;  ///< over the full circle
  /// All buckets, and one more for the candidates of every query.
  static constexpr int total_buckets() { return bucket_count + 1; }
  /// Where each bucket begins, the end of the last one, and one entry that sorting needs.
  static constexpr int offset_count() { return total_buckets() + 2; }
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
  /// Curved images: within which the angle of the ray to the baseline is, rad. A point in space is seen at a greater angle by the
  /// query's camera, towards which the baseline points, than by the candidate's: candidates whose `least` is above the query's
  /// `most` lie on the wrong side of it.
  float least = 0;
  float most = 4;  ///< see least
};

/// Rays of keypoints, measured together. Places behind the last are read, so they hold numbers.
struct ray_batch {
  static constexpr int size = plane_code_batch::size;  ///< rays in a batch
  /// @{
  /// Coordinates of each ray, in the frame of its camera.
  float x[size] = {}, y[size] = {}, z[size] = {};
  /// @}
  float spread[size] = {};  ///< plane_measure::spread()

  /// Sets ray i (not checked).
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
    m.x_ = turn(x_), m.y_ = turn(y_), m.baseline_ = turn(baseline_);
    return m;
  }
  /// Interval of a keypoint whose bearing is `b`. \param s  spread()
  plane_interval operator()(const vec3<float>& b, float s) const {
    plane_interval interval;
    measure(b.x, b.y, b.z, s, interval.angle, interval.half_width, interval.least, interval.most);
    return interval;
  }
  /// Those of `count` keypoints, as codes.
  void operator()(const ray_batch& rays, int count, plane_code_batch& codes) const {
    using P = pack<float, 8>;
    static_assert(ray_batch::size % P::lanes == 0);
    for (int i = 0; i < count; i += P::lanes) {
      P angle, half_width, least, most;
      measure(P::load(rays.x + i), P::load(rays.y + i), P::load(rays.z + i), P::load(rays.spread + i), angle,
              half_width, least, most);
      codes.set(i, plane_code_numbers<P>::of(angle, half_width, least, most));
    }
  }

 private:
  static constexpr float unbounded = 1e30F;

  plane_measure(const pair_geometry& g, float reach, const resolution_profile* resolution)
      : x_(g.plane_x),
        y_(g.plane_y),
        baseline_(g.baseline),
        reach_(reach),
        least_(g.baseline.x == 0 && g.baseline.y == 0 && g.baseline.z == 0 ? unbounded : 1e-3F),
        resolution_(resolution) {}

  template <class F>
  void measure(F bx, F by, F bz, F s, F& angle, F& half_width, F& least, F& most) const {
    using std::sqrt;
    const F px = bx * F(x_.x) + by * F(x_.y) + bz * F(x_.z), py = bx * F(y_.x) + by * F(y_.y) + bz * F(y_.z);
    const F distance = sqrt(px * px + py * py);  // sine of the angle to the baseline
    const F width = asin_bound(s / larger(distance, F(1e-30F))) * F(1.01F) + F(epipolar_order_layout::slack);
    angle = plane_angle(py, px);
    F w = width;
    least = F(0.0F), most = F(4.0F);
    if (resolution_ != nullptr) {
      const F to = plane_angle(distance, bx * F(baseline_.x) + by * F(baseline_.y) + bz * F(baseline_.z));
      const F off = s * F(1.01F) + F(epipolar_order_layout::slack);
      least = to - off, most = to + off;
    } else {
      const F pi(epipolar_order_layout::pi);
      angle = F(2.0F) * select_greater(pi, angle, angle, angle - pi);
      w = F(2.0F) * width;
    }
    // What is no number is unbounded.
    half_width = select_greater(distance, s, select_greater(distance, F(least_), w, F(-1.0F)), F(-1.0F));
  }

  vec3<float> x_, y_, baseline_;
  float reach_;
  float least_;  ///< nearer to the baseline a plane is unknown
  const resolution_profile* resolution_;
};

/// The sorted candidates of one (neighbour, query camera, neighbour camera).
struct epipolar_table {
  using layout = epipolar_order_layout;  ///< sizes

  std::int32_t* offsets;        ///< layout::offset_count()
  std::int32_t* candidates;     ///< by bucket; within a bucket in no particular order
  plane_codes codes;            ///< of `candidates`; null: not made
  std::uint16_t* sorted_width;  ///< half-width up to which candidates are sorted, as in their codes

  /// In sixteen bits.
  static plane_code code_of(const plane_interval& at) {
    return plane_code::of(at.angle, at.half_width, at.least, at.most);
  }

  /// Sorts `count` candidates: chooses by their codes which are sorted, then one counting sort by bucket.
  /// \param given  their codes; `most` does not matter
  void build(const std::int32_t* keypoints, const plane_codes& given, int count) const {
    *sorted_width = width_to_sort(given.half_widths, count);
    const auto key_of = [&](int i) {
      return given.half_widths[i] <= *sorted_width ? given.angles[i] / bucket_units : layout::bucket_count;
    };
    // Counted two places behind: then offsets[key + 1] is where the bucket begins, and where the next one does once it is full.
    for (int i = 0; i < layout::offset_count(); ++i) offsets[i] = 0;
    for (int i = 0; i < count; ++i) ++offsets[key_of(i) + 2];
    for (int i = 2; i < layout::offset_count(); ++i) offsets[i] += offsets[i - 1];
    for (int i = 0; i < count; ++i) {
      const std::int32_t to = offsets[key_of(i) + 1]++;
      candidates[to] = keypoints[i];
      if (codes.angles != nullptr) codes.set(to, {given.angles[i], given.half_widths[i], given.least[i], 0});
    }
    if (codes.angles != nullptr) codes.set_end(count);
  }

  /// Whether no candidate is in the table.
  bool empty() const { return offsets[layout::total_buckets()] == 0; }

  /// Ranges [first, last) of `candidates`: the second is often empty.
  struct window {
    /// @{
    /// Of both ranges.
    std::int32_t first[2], last[2];
    /// @}

    /// Candidates in both ranges.
    std::int32_t size() const { return last[0] - first[0] + last[1] - first[1]; }
  };
  /// Every candidate whose code meets `q`, and others. Without a branch that depends on `q`, so that windows of many queries
  /// can be read at once.
  window window_of(plane_code q) const {
    // Those of every query come last. Where the circle wraps, the second range is the end of it with them, else they alone.
    constexpr int n = layout::bucket_count, end = layout::total_buckets(), turns = 2;
    const int reach = q.half_width + *sorted_width;
    const int low = (q.angle - reach + turns * 65536) / bucket_units - turns * n;  // rounded down
    const int high = (q.angle + reach) / bucket_units;
    const bool all = q.half_width == plane_code::unbounded || high - low + 1 >= n, before = low < 0, after = high >= n;
    const int first = all || before || after ? 0 : low;
    const int last = all ? n : before ? high + 1 : after ? high - n + 1 : high + 1;
    const int rest = all ? n : before ? n + low : after ? low : n;
    return {{offsets[first], offsets[rest]}, {offsets[last], offsets[end]}};
  }
  /// Calls visit(first, last) for ranges of `candidates` that together hold every candidate whose code meets `q`.
  template <class Visit>
  void windows(plane_code q, Visit visit) const {
    const window w = window_of(q);
    for (int i = 0; i < 2; ++i) visit(w.first[i], w.last[i]);
  }

 private:
  static constexpr int bucket_units = 65536 / layout::bucket_count;  ///< units of plane_code::angle in a bucket

  /// The half-width up to which candidates are sorted, for those of `half_widths`.
  static std::uint16_t width_to_sort(const std::uint16_t* half_widths, int count) {
    constexpr auto widest = static_cast<std::int64_t>(layout::widest * 65536 / (2 * layout::pi));
    std::int64_t sum = 0, bounded = 0;
    for (int i = 0; i < count; ++i) {
      const bool is_bounded = half_widths[i] != plane_code::unbounded;
      sum += is_bounded ? half_widths[i] : 0, bounded += is_bounded ? 1 : 0;
    }
    const std::int64_t typical = bounded == 0 ? widest : layout::typical * sum / bounded;
    return static_cast<std::uint16_t>(typical < widest ? typical : widest);
  }
};

TURBOMAP_END_NAMESPACE

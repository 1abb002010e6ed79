// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The first questions of the prefilter (projection_prefilter.hpp) for several points at once, on the host: whether a point is in front of
/// the camera, in range, seen from its own side and inside the image. Most points of a search end there. It keeps the margins of the
/// prefilter, so its answers may differ from the prefilter's only where either is right: the plan is the same.

#include <cstdint>

#include "../camera/camera_concept.hpp"
#include "../camera/known_models.hpp"
#include "../config.hpp"
#include "../math/pack_convert.hpp"
#include "../math/pack_functions.hpp"
#include "projection_prefilter.hpp"
#include "projection_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Whether projection_lanes is to be used: without vectors the prefilter itself is as fast.
inline constexpr bool has_projection_lanes = TURBOMAP_VECTOR_BYTES > 0;

/// For one camera of one target. \tparam Most  points of one call
template <class Descriptor, class Camera, int Most>
class projection_lanes {
 public:
  /// \param search,camera  must outlive this
  projection_lanes(const projection_view<Descriptor, Camera>& search, const projection_camera& camera)
      : search_(search), camera_(camera), view_(search.keyframes[camera.of.target]) {
    const Camera& model = view_.cameras[camera.of.camera].camera;
    straight_ =
        may_be_pinhole_v<Camera> && as_pinhole(model, K_);  // what another model calls equivalent is for its curves
    round_ = !straight_ && as_kannala_brandt(model, fisheye_);
    const auto& T = camera.T_cw;
    for (int i = 0; i < 9; ++i) R_[i] = lane(T.R.m[i].value);
    t_ = {lane(T.t.x.value), lane(T.t.y.value), lane(T.t.z.value)};
    centre_ = {lane(camera.centre.x.value), lane(camera.centre.y.value), lane(camera.centre.z.value)};
    offset_ = absolute(t_.x) + absolute(t_.y) + absolute(t_.z);
  }

  /// Whether the camera is of a model that is computed in packs; else find() must not be called.
  bool is_known() const { return straight_ || round_; }

  /// Calls ask(point) for points [first, last) of which nothing is known, and at(point, pixel, z, distance) for those that are in the image
  /// and may be in range: what projection_prefilter::may_match_at() takes. The others certainly have no match, or are to be skipped.
  template <class Ask, class At>
  void find(int first, int last, const Ask& ask, const At& at) {
    list(first, last);
    if (count_ == 0) return;
    place();
    project();
    for (int i = 0; i < count_; ++i) {
      const int k = kept_[i];
      if (doubtful_[i] != 0)
        ask(point_[k]);
      else
        at(point_[k], vec2<double>{u_[i], v_[i]}, z_[k], distance_[k]);
    }
  }

 private:
  static constexpr int lanes = 4;
  using lane = pack<double, lanes>;

  static lane absolute(const lane& a) { return larger(a, -a); }
  static lane numbers_of(const float* a, const int* index, int stride) {
    return convert<double>(pack<float, lanes>::gather(a, index, stride));
  }

  /// The points that are not to be skipped, and copies of the last one up to a whole pack.
  void list(int first, int last) {
    count_ = 0;
    const std::uint8_t* const skip = camera_.of.skip;
    for (int p = first; p < last; ++p) {
      point_[count_] = p;
      count_ += skip != nullptr && skip[p] != 0 ? 0 : 1;
    }
    fill(point_, count_);
  }
  static void fill(int* list, int count) {
    if (count > 0)
      for (int i = count; i % lanes != 0; ++i) list[i] = list[count - 1];
  }

  /// Moves the points into the camera, and keeps those that may be seen: by number in point_.
  void place() {
    const projection_options& options = search_.options;
    const lane loose(detail::loose), more(1 + detail::loose), less(1 - detail::loose), zero(0.0);
    const pack<float, lanes> min_factor(search_.min_range_factor), max_factor(search_.max_range_factor);
    int kept = 0;
    for (int i = 0; i < count_; i += lanes) {
      const int* const index = point_ + i;
      const double* const positions = &search_.points.position->x;
      const vec3<lane> X{lane::gather(positions, index, 3), lane::gather(positions + 1, index, 3),
                         lane::gather(positions + 2, index, 3)};
      const lane z = R_[6] * X.x + R_[7] * X.y + R_[8] * X.z + t_.z;
      const lane size = absolute(X.x) + absolute(X.y) + absolute(X.z) + offset_;
      const vec3<lane> ray{X.x - centre_.x, X.y - centre_.y, X.z - centre_.z};
      const lane distance = sqrt(ray.x * ray.x + ray.y * ray.y + ray.z * ray.z);
      lane off = zero;           // > 0: certainly not seen
      if (options.range_gate) {  // bounds are rounded to float, as the decision's
        const lane least =
            convert<double>(min_factor * pack<float, lanes>::gather(search_.points.min_distance, index, 1));
        const lane most =
            convert<double>(max_factor * pack<float, lanes>::gather(search_.points.max_distance, index, 1));
        off = larger(least - distance * more, distance * less - most);
      }
      if (options.min_view_cosine > -1) {
        const float* const normals = &search_.points.normal->x;
        const lane nx = numbers_of(normals, index, 3), ny = numbers_of(normals + 1, index, 3),
                   nz = numbers_of(normals + 2, index, 3);
        const lane margin = loose * (lane(1.0) + absolute(nx) + absolute(ny) + absolute(nz));
        const lane along = ray.x * nx + ray.y * ny + ray.z * nz;
        off = larger((lane(options.min_view_cosine) - margin) * distance - along, off);
      }
      const lane deep = lane(detail::well_conditioned) * z;
      off = larger(-(loose * size) - z, select_greater(deep, size, off, zero));
      (R_[0] * X.x + R_[1] * X.y + R_[2] * X.z + t_.x).store(x_ + i);
      (R_[3] * X.x + R_[4] * X.y + R_[5] * X.z + t_.y).store(y_ + i);
      z.store(z_ + i);
      select_greater(deep, size, distance, lane(-1.0)).store(distance_ + i);  // -1: not known well
      double gone[lanes];
      off.store(gone);
      const int left = count_ - i < lanes ? count_ - i : lanes;
      for (int l = 0; l < left; ++l) {
        kept_[kept] = i + l;
        kept += gone[l] > 0 ? 0 : 1;
      }
    }
    count_ = kept;
    fill(kept_, count_);
  }

  /// Projects them, and keeps those that may be in the image.
  void project() {
    const image_bounds& b = view_.cells.bounds;
    const double m = detail::loose_pixels;
    const lane min_x(static_cast<double>(b.min_x) - m), max_x(static_cast<double>(b.max_x) + m);
    const lane min_y(static_cast<double>(b.min_y) - m), max_y(static_cast<double>(b.max_y) + m);
    const lane zero(0.0), one(1.0);
    int kept = 0;
    for (int i = 0; i < count_; i += lanes) {
      const int* const index = kept_ + i;
      const lane x = lane::gather(x_, index, 1), y = lane::gather(y_, index, 1), z = lane::gather(z_, index, 1);
      lane u, v, doubtful = select_greater(zero, lane::gather(distance_, index, 1), one, zero);
      if (straight_) {
        u = lane(K_.fx) * (x / z) + lane(K_.cx), v = lane(K_.fy) * (y / z) + lane(K_.cy);
      } else {
        lane scale;
        doubtful = select_greater(round_scale(x, y, z, scale), zero, one, doubtful);
        u = lane(fisheye_.fx) * (scale * x) + lane(fisheye_.cx),
        v = lane(fisheye_.fy) * (scale * y) + lane(fisheye_.cy);
      }
      const lane outside = larger(larger(min_x - u, u - max_x), larger(min_y - v, v - max_y));
      double gone[lanes], us[lanes], vs[lanes], doubts[lanes];
      select_greater(doubtful, zero, zero, outside).store(gone);
      u.store(us), v.store(vs), doubtful.store(doubts);
      const int left = count_ - i < lanes ? count_ - i : lanes;
      for (int l = 0; l < left; ++l) {
        kept_[kept] = index[l];  // never beyond what has been read
        u_[kept] = us[l], v_[kept] = vs[l], doubtful_[kept] = doubts[l];
        kept += gone[l] > 0 ? 0 : 1;
      }
    }
    count_ = kept;
  }

  /// theta_d / r of kannala_brandt. \return  > 0 where the point is near the optical axis, or may be beyond a fold of the polynomial: there
  ///         it is not computed
  lane round_scale(const lane& x, const lane& y, const lane& z, lane& scale) const {
    const lane one(1.0), zero(0.0), r2 = x * x + y * y, r = sqrt(r2), angle = polar_angle(r, z), q = angle * angle;
    const double k[4] = {fisheye_.k1, fisheye_.k2, fisheye_.k3, fisheye_.k4};
    lane factor(k[3]), least(9 * (k[3] < 0 ? k[3] : 0));
    for (int i = 2; i >= 0; --i) {
      factor = multiply_add(factor, q, lane(k[i]));
      least = multiply_add(least, q, lane((2 * i + 3) * (k[i] < 0 ? k[i] : 0)));
    }
    factor = multiply_add(factor, q, one), least = multiply_add(least, q, one);
    scale = angle * factor / r;
    return select_greater(least, zero, select_greater(r2, lane(1e-6) * (z * z), zero, one), one);
  }

  const projection_view<Descriptor, Camera>& search_;
  const projection_camera& camera_;
  const keyframe_view<Descriptor, Camera>& view_;
  pinhole<double> K_;
  kannala_brandt<double> fisheye_;
  bool straight_, round_;
  lane R_[9];
  vec3<lane> t_, centre_;
  lane offset_;
  int count_ = 0;
  int point_[Most + lanes], kept_[Most + lanes];
  double x_[Most + lanes], y_[Most + lanes], z_[Most + lanes], distance_[Most + lanes];
  double u_[Most + lanes], v_[Most + lanes], doubtful_[Most + lanes];
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The appearance of one map point: mean viewing direction, distance range, representative descriptor and, where asked for, the
/// covariance of its position, from all its observations. Geometry in strict arithmetic: normal, range and covariance decide
/// later, so they are the same bits everywhere.

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "../camera/point_uncertainty.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../math/linear.hpp"
#include "../math/strict.hpp"
#include "../prefetch.hpp"
#include "../store/keyframe_view.hpp"
#include "appearance_view.hpp"
#include "medoid.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The inputs of one call in the memory of its policy.
template <class Descriptor, class Camera>
struct appearance_inputs {
  const keyframe_view<Descriptor, Camera>* keyframes;
  const rigid_transform<double>* T_cw;     ///< of the keyframes
  const vec3<double>* position;            ///< null without geometry
  const std::int32_t* observation_offset;  ///< of the points
  const point_observation* observations;
  const std::int32_t* reference;     ///< null without geometry
  const float* scale;                ///< s^octave, 256
  vec3<double>* centre;              ///< [keyframe][camera]: camera centres in the world; null without geometry
  isometry<double>* T_camera_world;  ///< [keyframe][camera]; null without covariance
  double stereo_correlation;
  int cameras;  ///< the most of any keyframe
  int last_level;
  int most_views;  ///< 0: all
};

/// Index = keyframe * cameras + camera: computes one camera centre, and keeps the camera's pose where covariances need it.
template <class Descriptor, class Camera>
struct find_camera_centre {
  appearance_inputs<Descriptor, Camera> in;

  TURBOMAP_HD void operator()(int i) const {
    const int k = i / in.cameras, c = i % in.cameras;
    if (c >= in.keyframes[k].camera_count) return;  // a rig with fewer cameras than another one
    using S = strict<double>;
    const auto T = to_isometry<S>(in.keyframes[k].cameras[c].T_camera_body) * to_isometry<S>(in.T_cw[k]);
    const vec3<S> o = camera_centre(T);
    in.centre[i] = {o.x.value, o.y.value, o.z.value};
    if (in.T_camera_world != nullptr) in.T_camera_world[i] = cast<double>(T);
  }
};

/// Which views of a point take part: all, or `most` of them at equal steps in their order, beginning with the first.
struct chosen_views {
  int views;  ///< of the point
  int count;  ///< that take part

  TURBOMAP_HD chosen_views(int n, int most) : views(n), count(most > 0 && most < n ? most : n) {}
  /// Number of the j-th, among all.
  TURBOMAP_HD int operator()(int j) const {
    return count == views ? j : static_cast<int>(static_cast<std::int64_t>(j) * views / count);
  }
};

/// The observed descriptors of one point, those that take part, by number.
template <class Descriptor, class Camera>
struct observed_descriptors {
  const keyframe_view<Descriptor, Camera>* keyframes;
  const point_observation* observations;
  chosen_views chosen;

  TURBOMAP_HD const typename Descriptor::element* operator()(int j) const {
    const point_observation o = observations[chosen(j)];
    return keyframes[o.keyframe].descriptor_of(o.keypoint);
  }
};

/// Mean viewing direction, distance range and covariance of points: what each view gives, and what follows from all of them.
template <class Descriptor, class Camera>
struct appearance_geometry {
  using S = strict<double>;
  appearance_inputs<Descriptor, Camera> in;

  /// What one view gives.
  TURBOMAP_HD int camera_of(const point_observation& o) const { return in.keyframes[o.keyframe].camera_of(o.keypoint); }
  TURBOMAP_HD vec3<S> ray(int i, int keyframe, int camera) const {
    return cast<S>(in.position[i]) - cast<S>(in.centre[keyframe * in.cameras + camera]);
  }
  /// From the camera to point i, of length 1; 0 where the point is in the centre of the camera.
  TURBOMAP_HD vec3<S> direction(int i, const point_observation& o) const {
    const vec3<S> r = ray(i, o.keyframe, camera_of(o));
    const S length = norm(r);
    if (length > S(0)) return (S(1) / length) * r;
    return {S(0), S(0), S(0)};
  }
  /// How a camera sees a point.
  struct view {
    projected_point<S> projected;
    S distance, sigma2;
    bool is_projected, is_stereo;
  };
  TURBOMAP_HD view look(int i, const point_observation& o) const {
    const keyframe_view<Descriptor, Camera>& keyframe = in.keyframes[o.keyframe];
    const int camera = camera_of(o);
    view v;
    v.distance = norm(ray(i, o.keyframe, camera));
    const rig_camera<Camera>& c = keyframe.cameras[camera];
    v.is_stereo = c.bf > 0 && keyframe.is_stereo(o.keypoint);
    const S scale(in.scale[keyframe.octave[o.keypoint]]);
    v.sigma2 = scale * scale;
    v.is_projected = project_point(c.camera, cast<S>(in.T_camera_world[o.keyframe * in.cameras + camera]),
                                   S(v.is_stereo ? c.bf : 0), cast<S>(in.position[i]), v.projected);
    return v;
  }

  /// From the views that take part: their number, the sum of their directions; and the keypoint in the reference keyframe.
  TURBOMAP_HD void measure(int i, int n, const vec3<S>& sum, int keypoint, point_appearance& p) const {
    const int reference = in.reference[i];
    const S count(n);
    p.normal = {static_cast<float>((sum.x / count).value), static_cast<float>((sum.y / count).value),
                static_cast<float>((sum.z / count).value)};
    // The range in float, as the recorded peer has it; the distance from camera 0, whichever camera saw the point.
    const strict<float> distance = static_cast<float>(norm(ray(i, reference, 0)).value);
    const strict<float> most = distance * strict<float>(in.scale[in.keyframes[reference].octave[keypoint]]);
    p.max_distance = most.value;
    p.min_distance = (most / strict<float>(in.scale[in.last_level])).value;
  }
  /// Information and largest distance of the views so far.
  struct spread {
    symmetric3<S> information;
    S farthest = S(0);
  };
  TURBOMAP_HD void add(const view& v, spread& sum) const {
    if (v.distance > sum.farthest) sum.farthest = v.distance;
    if (v.is_projected) add_information(sum.information, v.projected, v.is_stereo, v.sigma2, S(in.stereo_correlation));
  }
  /// The covariance of the position. A point in the centre of all its cameras has none.
  TURBOMAP_HD void invert(const spread& sum, point_appearance& p) const {
    if (!(sum.farthest > S(0))) return;
    const symmetric3<S> C = covariance_from(sum.information, sum.farthest);
    const auto f = [](S a) { return static_cast<float>(a.value); };
    p.covariance = {f(C.xx), f(C.yx), f(C.yy), f(C.zx), f(C.zy), f(C.zz)};
  }
};

/// Index = point. For threads of the host.
template <class Descriptor, class Camera>
struct compute_appearance {
  appearance_inputs<Descriptor, Camera> in;
  int count;  ///< of the points
  point_appearance* points;
  typename Descriptor::element* descriptors;  ///< [point][element]; null: not asked for

  /// Computes point i, and asks memory for the descriptors of the next one.
  void operator()(int i) const {
    if (descriptors != nullptr && i + 1 < count) prefetch(i + 1);
    const point_observation* seen = in.observations + in.observation_offset[i];
    const int n = in.observation_offset[i + 1] - in.observation_offset[i];
    point_appearance p{};
    p.medoid = -1;
    const appearance_geometry<Descriptor, Camera> geometry{in};
    if (in.centre != nullptr && n > 0) measure(geometry, i, seen, n, p);
    if (in.T_camera_world != nullptr && n > 0) {
      typename appearance_geometry<Descriptor, Camera>::spread sum;
      for (int j = 0; j < n; ++j) geometry.add(geometry.look(i, seen[j]), sum);
      geometry.invert(sum, p);
    }
    if (descriptors != nullptr) represent(i, p);
    points[i] = p;
  }

 private:
  observed_descriptors<Descriptor, Camera> descriptors_of(int i) const {
    const int first = in.observation_offset[i], n = in.observation_offset[i + 1] - first;
    return {in.keyframes, in.observations + first, chosen_views(n, in.most_views)};
  }
  void prefetch(int i) const {
    const auto all = descriptors_of(i);
    for (int j = 0; j < all.chosen.count; ++j) prefetch_line(all(j));
  }
  void measure(const appearance_geometry<Descriptor, Camera>& geometry, int i, const point_observation* seen, int n,
               point_appearance& p) const {
    using S = strict<double>;
    const chosen_views chosen(n, in.most_views);
    vec3<S> sum{S(0), S(0), S(0)};
    for (int j = 0; j < chosen.count; ++j) sum = sum + geometry.direction(i, seen[chosen(j)]);
    int keypoint = -1;  // of the point in its reference keyframe: camera 0's, else the first
    for (int j = 0; j < n; ++j) {
      if (seen[j].keyframe != in.reference[i]) continue;
      const bool is_left = geometry.camera_of(seen[j]) == 0;
      if (is_left || keypoint < 0) keypoint = seen[j].keypoint;
      if (is_left) break;
    }
    geometry.measure(i, chosen.count, sum, keypoint, p);
  }
  void represent(int i, point_appearance& p) const {
    typename Descriptor::element* mine = descriptors + static_cast<std::size_t>(i) * Descriptor::elements;
    const auto all = descriptors_of(i);
    if (all.chosen.count == 0) {
      std::memset(static_cast<void*>(mine), 0, Descriptor::bytes);
      return;
    }
    const int medoid = medoid_with_table<Descriptor>(all.chosen.count, all);
    std::memcpy(static_cast<void*>(mine), all(medoid), Descriptor::bytes);
    p.medoid = all.chosen(medoid);
  }
};

}  // namespace detail

/// Computes the centres of all cameras.
template <class Derived, class Descriptor, class Camera>
void launch_find_camera_centres(const thrust::execution_policy<Derived>& policy,
                                const detail::appearance_inputs<Descriptor, Camera>& in, int keyframe_count) {
  for_each_index(derived(policy), keyframe_count * in.cameras, detail::find_camera_centre<Descriptor, Camera>{in});
}

/// Computes points 0 ... count - 1.
template <class Derived, class Descriptor, class Camera>
void launch_compute_appearance(const thrust::execution_policy<Derived>& policy,
                               const detail::appearance_inputs<Descriptor, Camera>& in, int count,
                               point_appearance* points, typename Descriptor::element* descriptors) {
  for_each_index(derived(policy), count,
                 detail::compute_appearance<Descriptor, Camera>{in, count, points, descriptors});
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/compute_appearance.cuh"
#endif

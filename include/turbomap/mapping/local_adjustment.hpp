// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Bundle adjustment around one keyframe on the user's map: snapshot, adjust, commit [ORB-SLAM3].

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../adjustment/levenberg_marquardt.hpp"
#include "../adjustment/problem.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../map/covisibility.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/numbering.hpp"
#include "../map/validate.hpp"
#include "../math/functions.hpp"
#include "../math/scale_table.hpp"
#include "timed_guard.hpp"

namespace turbomap {

/// Options of local_adjustment. Defaults are those of [ORB-SLAM3].
struct local_adjustment_options {
  adjustment_options solve;
  pyramid scales;                 ///< information of a keypoint: scale_factor^(-2 octave) px^-2
  int min_shared_points = 15;     ///< keyframes that share so many with the current one move with it
  double mono_chi2 = 5.991;       ///< Huber's delta^2, and outlier beyond it: 95 %, 2 dof
  double stereo_chi2 = 7.815;     ///< 95 %, 3 dof
  double stereo_correlation = 0;  ///< of the errors of u and u_right: see reprojections; 0 [ORB-SLAM3]
  int fewest_measurements = 2;    ///< a point dies when outliers leave it so many measurements or fewer

  local_adjustment_options() { solve.min_relative_decrease = 1e-3; }  // three slow iterations in a row end it
};

/// What one local adjustment did.
struct local_adjustment_summary {
  adjustment_summary solve;
  std::size_t free_keyframes = 0, fixed_keyframes = 0, points = 0, observations = 0;
  std::size_t outliers = 0;       ///< observations taken out of the map
  std::size_t points_erased = 0;  ///< that outliers left with too few
  bool stale = false;             ///< a free keyframe was moved or erased meanwhile: nothing was written
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {
template <class M, class T>
using map_origin_member = decltype(T::is_origin(std::declval<const M&>(), std::declval<keyframe_of<T>>()));
template <class M, class T>
using map_first_camera_member = decltype(T::first_camera(std::declval<const M&>(), std::declval<keyframe_of<T>>()));
}  // namespace detail

/// Make one and use it for every keyframe: its memory is reused. Of one context.
///
/// Free are the keyframe and those that share enough points with it; all their points are free; other keyframes that see
/// these points are fixed, and so is the origin of the map (optional member is_origin(map, keyframe) of the traits). Where
/// nothing would be fixed, the oldest keyframe is. Huber kernels, information by octave; then observations beyond their
/// gate, or behind their camera, are taken out of the map.
template <class Map, class Policy>
class local_adjustment {
 public:
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using camera = typename traits::camera;

  /// \param rig  of all keyframes; copied. Keyframes of several rigs: all cameras one after the other, and the optional
  ///             member first_camera(map, keyframe) of the traits says where a keyframe's begin
  local_adjustment(context<Policy>& ctx, rig_view<camera> rig)
      : rig_(rig.cameras, rig.cameras + rig.count), problem_(ctx) {
    validate_rig(rig);
  }

  /// The guard is held to copy what is adjusted and to write the result, not between. The map is left as it is where a
  /// free keyframe moved or died meanwhile (summary.stale), and where nothing better was found (summary.solve.accepted is
  /// 0, and end says why). Points that moved or died meanwhile keep what they have.
  /// \throws std::invalid_argument  an option or the traits' camera is out of range; inconsistent_map where an outlier's point
  ///         contradicts the map: nothing is written then
  local_adjustment_summary operator()(context<Policy>& ctx, Map& map, keyframe current,
                                      const local_adjustment_options& options, guard_times& held) {
    check(options);
    local_adjustment_summary summary;
    {
      const timed_guard<Map> guard(map, held);
      gather(map, current, options, summary);
    }
    if (summary.free_keyframes == 0 || frame_.empty()) {
      summary.solve.end = frame_.empty() ? adjustment_end::no_observations : adjustment_end::nothing_free;
      return summary;
    }
    reprojections<camera> rows;
    rows.rig = {rig_.data(), static_cast<int>(rig_.size())};
    rows.frame = frame_, rows.landmark = landmark_, rows.pixel = pixel_, rows.information = information_;
    rows.camera = camera_;
    rows.stereo_correlation = options.stereo_correlation;
    rows.mono_kernel.delta2 = options.mono_chi2, rows.stereo_kernel.delta2 = options.stereo_chi2;
    problem_.assign(ctx, {before_, fixed_}, {positions_before_, {}}, rows);
    summary.solve = adjust(ctx, problem_, options.solve);
    if (summary.solve.accepted == 0) return summary;
    problem_.frames(ctx, T_cw_);
    problem_.landmarks(ctx, positions_);
    problem_.template chi2<0>(ctx, chi2_, depth_);
    const timed_guard<Map> guard(map, held);
    commit(map, options, summary);
    return summary;
  }

  /// The points of the last adjustment: their normals and ranges are due.
  const std::vector<point>& points() const { return points_; }
  /// Those of them that lost an observation as an outlier and live on: their descriptors are due too.
  const std::vector<point>& points_that_lost_views() const { return lost_views_; }

 private:
  static bool same(const rigid_transform<double>& a, const rigid_transform<double>& b) {
    return a.qx == b.qx && a.qy == b.qy && a.qz == b.qz && a.qw == b.qw && a.tx == b.tx && a.ty == b.ty && a.tz == b.tz;
  }
  static vec3<double> position_of(const Map& map, point p) {
    const auto& x = traits::position(map, p);
    return {x.x, x.y, x.z};
  }
  static void check(const local_adjustment_options& o) {
    const auto positive = [](double x) { return detail::is_finite(x) && x > 0; };
    require(o.scales.scale_factor >= 1 && detail::is_finite(o.scales.scale_factor), "options.scales.scale_factor",
            o.scales.scale_factor, "must be finite and at least 1");
    require(positive(o.mono_chi2), "options.mono_chi2", o.mono_chi2, "must be finite and positive");
    require(positive(o.stereo_chi2), "options.stereo_chi2", o.stereo_chi2, "must be finite and positive");
    require_correlation(o.stereo_correlation, "options.stereo_correlation");
    require(o.fewest_measurements >= 0, "options.fewest_measurements", o.fewest_measurements, "must not be negative");
  }

  void gather(const Map& map, keyframe current, const local_adjustment_options& options,
              local_adjustment_summary& summary) {
    float scale[scale_table_size], sigma2[scale_table_size];
    fill_scales(options.scales, scale, sigma2);
    frames_.clear(), frame_numbers_.clear(), point_numbers_.clear(), points_.clear(), lost_views_.clear();
    before_.clear(), fixed_.clear(), positions_before_.clear();
    frame_.clear(), landmark_.clear(), pixel_.clear(), information_.clear(), camera_.clear(), keypoint_.clear();
    summary.stale = !traits::alive(map, current);
    if (summary.stale) return;
    add_frame(map, current, is_origin(map, current));
    for (const auto& c : covisibility_(map, current, options.min_shared_points))
      add_frame(map, c.keyframe, is_origin(map, c.keyframe));
    const std::size_t local = frames_.size();
    for (std::size_t f = 0; f < local; ++f) {
      const std::size_t keypoints = traits::keypoint_count(map, frames_[f]);
      for (std::size_t i = 0; i < keypoints; ++i) {
        const point p = traits::point_at(map, frames_[f], i);
        if (p == point{} || !traits::alive(map, p)) continue;
        const std::size_t known = points_.size();
        if (point_numbers_.place(map, p) != known) continue;
        points_.push_back(p);
        positions_before_.push_back(position_of(map, p));
        traits::for_each_observation(map, p, [&](keyframe k, std::size_t keypoint) {
          add_row(map, k, keypoint, static_cast<std::int32_t>(known), sigma2);
        });
      }
    }
    bool any_fixed = false;
    for (const auto fixed : fixed_) any_fixed = any_fixed || fixed != 0;
    if (!any_fixed) {
      std::size_t oldest = 0;
      for (std::size_t f = 1; f < local; ++f)
        if (traits::id(map, frames_[f]) < traits::id(map, frames_[oldest])) oldest = f;
      fixed_[oldest] = 1;
    }
    for (const auto fixed : fixed_) ++(fixed != 0 ? summary.fixed_keyframes : summary.free_keyframes);
    summary.points = points_.size();
    summary.observations = frame_.size();
  }
  static bool is_origin([[maybe_unused]] const Map& map, [[maybe_unused]] keyframe k) {
    if constexpr (detail::map_has_v<Map, detail::map_origin_member>)
      return traits::is_origin(map, k);
    else
      return false;
  }
  void add_frame(const Map& map, keyframe k, bool fixed) {
    if (frame_numbers_.place(map, k) != frames_.size()) return;
    frames_.push_back(k);
    before_.push_back(pose_of(map, k));
    fixed_.push_back(fixed ? 1 : 0);
  }
  void add_row(const Map& map, keyframe k, std::size_t keypoint, std::int32_t landmark, const float* sigma2) {
    add_frame(map, k, true);
    const auto& z = traits::keypoint(map, k, keypoint);
    std::size_t camera = z.camera;
    if constexpr (detail::map_has_v<Map, detail::map_first_camera_member>)
      camera += static_cast<std::size_t>(traits::first_camera(map, k));
    require(camera < rig_.size(), "keypoint.camera", camera, "is not a camera of the rig");
    frame_.push_back(static_cast<std::int32_t>(frame_numbers_.find(map, k)));
    landmark_.push_back(landmark);
    pixel_.push_back({static_cast<double>(z.x), static_cast<double>(z.y), static_cast<double>(z.u_right)});
    information_.push_back(1 / static_cast<double>(sigma2[z.octave]));
    camera_.push_back(static_cast<std::uint8_t>(camera));
    keypoint_.push_back(keypoint);
  }

  bool unmoved(const Map& map, std::size_t p) const {
    if (!traits::alive(map, points_[p])) return false;
    const vec3<double> now = position_of(map, points_[p]), &then = positions_before_[p];
    return now.x == then.x && now.y == then.y && now.z == then.z;
  }
  void commit(Map& map, const local_adjustment_options& options, local_adjustment_summary& summary) {
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      if (fixed_[f] != 0) continue;
      summary.stale = summary.stale || !traits::alive(map, frames_[f]) || !same(pose_of(map, frames_[f]), before_[f]);
    }
    if (summary.stale) return;
    outliers_.clear(), lost_views_.clear();
    for (std::size_t row = 0; row < frame_.size(); ++row) {
      const bool stereo = pixel_[row].z >= 0 && detail::is_finite(pixel_[row].z) && rig_[camera_[row]].bf > 0;
      if (chi2_[row] <= (stereo ? options.stereo_chi2 : options.mono_chi2) && depth_[row] > 0) continue;
      const keyframe k = frames_[static_cast<std::size_t>(frame_[row])];
      const auto l = static_cast<std::size_t>(landmark_[row]);
      const point p = points_[l];
      if (!traits::alive(map, k) || !unmoved(map, l) || !(traits::point_at(map, k, keypoint_[row]) == p)) continue;
      require_consistent(map, p);
      outliers_.push_back(row);
    }
    lost_views_.reserve(outliers_.size());
    for (std::size_t f = 0; f < frames_.size(); ++f)
      if (fixed_[f] == 0) traits::set_pose(map, frames_[f], T_cw_[f]);
    for (std::size_t p = 0; p < points_.size(); ++p)
      if (unmoved(map, p)) traits::set_position(map, points_[p], positions_[p]);
    for (const std::size_t row : outliers_) {
      const keyframe k = frames_[static_cast<std::size_t>(frame_[row])];
      const point p = traits::point_at(map, k, keypoint_[row]);
      if (p == point{}) continue;  // it died of an outlier before
      if (fade(map, k, keypoint_[row], options.fewest_measurements))
        ++summary.points_erased;
      else
        lost_views_.push_back(p);
      ++summary.outliers;
    }
  }

  std::vector<rig_camera<camera>> rig_;
  bundle_problem<Policy, pose_frame, reprojections<camera>> problem_;
  covisibility<Map> covisibility_;
  keyframe_numbering<Map> frame_numbers_;
  point_numbering<Map> point_numbers_;
  std::vector<keyframe> frames_;
  std::vector<point> points_, lost_views_;
  std::vector<rigid_transform<double>> before_, T_cw_;
  std::vector<std::uint8_t> fixed_;
  std::vector<vec3<double>> positions_before_, positions_;
  // By observation.
  std::vector<std::int32_t> frame_, landmark_;
  std::vector<vec3<double>> pixel_;
  std::vector<double> information_, chi2_, depth_;
  std::vector<std::uint8_t> camera_;
  std::vector<std::size_t> keypoint_, outliers_;
};

TURBOMAP_END_NAMESPACE

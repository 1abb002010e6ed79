// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that adjusts poses and points around a keyframe, so that every point is seen where it lies [ORB-SLAM3]. It
/// minimises the reprojection errors of a window of the map by bundle adjustment, writes the result back, and takes out of
/// the map the observations that still do not fit.

#include <cstddef>
#include <cstdint>

#include "../adjustment/levenberg_marquardt.hpp"
#include "../adjustment/problem.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/validate.hpp"
#include "../plain_vector.hpp"
#include "../store/argument_checks.hpp"
#include "adjustment_window.hpp"
#include "local_adjustment_options.hpp"
#include "look_again.hpp"
#include "stage.hpp"
#include "window_measurements.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// adjust() on a user's map. Of one context. Huber kernels, information by octave; cameras are those of the keyframes in the
/// store. Observations beyond their gate, or behind their pinhole camera, are taken out of the map.
/// \tparam Methods  the solvers and precisions that the options may ask for: see adjust()
template <class Map, class Policy, class Methods = adjustment_methods<>>
class local_adjustment {
 public:
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using camera = typename traits::camera;
  using scope = mapping_scope<Map, Policy>;

  /// One for the scope's map and context: `local_adjustment adjust(scope);`.
  explicit local_adjustment(const scope& s) : local_adjustment(s.ctx) {}
  explicit local_adjustment(context<Policy>& ctx) : measurements_(ctx), problem_(ctx) {
    static_assert(detail::map_has_v<Map, detail::map_adjust_member>,
                  "turbomap: local_adjustment needs map_traits with set_pose and set_position; see docs/map.md");
  }

  /// The map is left as it is where a free keyframe moved or died meanwhile (summary.stale; what was written before that stays,
  /// see options.points_per_guard), and where nothing better was found (summary.solve.accepted is 0, and end says why). Points
  /// that moved or died meanwhile keep what they have.
  /// \throws std::invalid_argument  an option out of range, a keyframe that is not in the store; inconsistent_map where an
  ///         outlier's point contradicts the map, unless the scope notes faults: nothing is written then; where it came to
  ///         contradict it between two parts, the parts before stay
  local_adjustment_summary operator()(const scope& s, keyframe current, const local_adjustment_options& options) {
    local_adjustment_summary summary;
    snapshot(s, current, options, summary);
    if (summary.stale || !compute(s, options, summary)) return summary;
    commit(s, options, summary);
    return summary;
  }

  /// The window around the keyframe.
  void snapshot(const scope& s, keyframe current, const local_adjustment_options& options,
                local_adjustment_summary& summary) {
    check(options);
    const auto guard = s.guard();
    lost_views_.clear();
    summary.stale = current == keyframe{} || !traits::alive(s.map, current);
    if (summary.stale) {
      summary.solve.end = adjustment_end::no_observations;
      return window_.clear();
    }
    s.stored.at(traits::id(s.map, current));  // throws when it is not there
    window_.gather(s, current, options.min_shared_points, options.second_min_shared_points);
    for (const auto fixed : window_.fixed()) ++(fixed != 0 ? summary.fixed_keyframes : summary.free_keyframes);
    summary.points = window_.points().size();
    summary.observations = window_.row_count();
  }

  /// Adjusts it. \return whether there is something to write
  bool compute(const scope& s, const local_adjustment_options& options, local_adjustment_summary& summary) {
    if (summary.free_keyframes == 0 || summary.observations == 0) {
      summary.solve.end = summary.observations == 0 ? adjustment_end::no_observations : adjustment_end::nothing_free;
      return false;
    }
    measurements_.gather(s, window_, options.scales);
    reprojections<camera> rows;
    rows.rig = measurements_.cameras();
    rows.frame = window_.frame_of_row(), rows.landmark = window_.landmark_of_row();
    rows.pixel = measurements_.pixel(), rows.information = measurements_.information();
    rows.camera = measurements_.camera_of_row();
    rows.stereo_correlation = options.stereo_correlation;
    rows.mono_kernel.delta2 = options.mono_chi2, rows.stereo_kernel.delta2 = options.stereo_chi2;
    problem_.assign(s.ctx, {window_.frames().T_cw(), window_.fixed()}, {window_.positions(), {}}, rows);
    summary.solve = adjust<Methods>(s.ctx, problem_, options.solve);
    if (summary.solve.accepted == 0) return false;
    problem_.frames(s.ctx, T_cw_);
    problem_.landmarks(s.ctx, positions_);
    problem_.template chi2<0>(s.ctx, chi2_, depth_);
    return true;
  }

  /// Writes poses and positions, and takes out the outliers, in parts. Before each part it looks whether the poses are those
  /// that it knows: once somebody else has moved a keyframe, the rest of the result no longer fits.
  void commit(const scope& s, const local_adjustment_options& options, local_adjustment_summary& summary) {
    {
      const auto guard = s.guard();
      known_ = window_.frames().T_cw();
      if (!poses_are_known(s.map)) summary.stale = true;
      if (summary.stale) return;
      find_outliers(s.map, options, s.faults);
      lost_views_.reserve(outliers_.size());
      write_poses(s.map);
      const auto most = static_cast<std::size_t>(options.points_per_guard);
      if (most == 0 || points().size() + 4 * outliers_.size() <= most) {
        write_positions(s.map, 0, points().size());
        return take_out(s, 0, outliers_.size(), options, summary);
      }
    }
    const auto most = static_cast<std::size_t>(options.points_per_guard);
    in_parts(s, points().size(), most, summary,
             [&](std::size_t begin, std::size_t end) { write_positions(s.map, begin, end); });
    in_parts(s, outliers_.size(), (most + 3) / 4, summary, [&](std::size_t begin, std::size_t end) {
      checks_.assign(points().size(), unchecked);
      take_out(s, begin, end, options, summary);
    });
  }

  /// The points of the last adjustment: their normals and ranges are due.
  const list_of<point>& points() const { return window_.points(); }
  /// Those of them that lost an observation as an outlier and live on: their descriptors are due too.
  const list_of<point>& points_that_lost_views() const { return lost_views_; }

 private:
  static bool same(const rigid_transform<double>& a, const rigid_transform<double>& b) {
    return a.qx == b.qx && a.qy == b.qy && a.qz == b.qz && a.qw == b.qw && a.tx == b.tx && a.ty == b.ty && a.tz == b.tz;
  }
  static void check(const local_adjustment_options& o) {
    check_scales(o.scales);
    check_positive("options.mono_chi2", o.mono_chi2);
    check_positive("options.stereo_chi2", o.stereo_chi2);
    require_correlation(o.stereo_correlation, "options.stereo_correlation");
    require(o.second_min_shared_points >= 0, "options.second_min_shared_points", o.second_min_shared_points,
            "must not be negative");
    require(o.fewest_measurements >= 0, "options.fewest_measurements", o.fewest_measurements, "must not be negative");
    require(o.points_per_guard >= 0, "options.points_per_guard", o.points_per_guard, "must not be negative");
  }

  template <class Write>
  void in_parts(const scope& s, std::size_t count, std::size_t most, local_adjustment_summary& summary, Write write) {
    for (std::size_t begin = 0; begin < count && !summary.stale; begin += most) {
      const auto guard = s.guard();
      if (poses_are_known(s.map))
        write(begin, count - begin < most ? count : begin + most);
      else
        summary.stale = true;
    }
  }
  bool poses_are_known(const Map& map) const {
    const auto& frames = window_.frames();
    for (std::size_t f = 0; f < frames.size(); ++f) {
      if (window_.fixed()[f] != 0) continue;
      look_again(map, frames[f]);
      if (!traits::alive(map, frames[f]) || !same(pose_of(map, frames[f]), known_[f])) return false;
    }
    return true;
  }
  void write_poses(Map& map) {
    const auto& frames = window_.frames();
    for (std::size_t f = 0; f < frames.size(); ++f) {
      if (window_.fixed()[f] != 0) continue;
      traits::set_pose(map, frames[f], T_cw_[f]);
      known_[f] = pose_of(map, frames[f]);  // the map may round it
    }
  }
  void write_positions(Map& map, std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p)
      if (unmoved(map, p)) traits::set_position(map, points()[p], positions_[p]);
  }
  void take_out(const scope& s, std::size_t begin, std::size_t end, const local_adjustment_options& options,
                local_adjustment_summary& summary) {
    for (std::size_t i = begin; i < end; ++i) {
      // Its point may have died of an outlier before, or been changed by somebody else.
      if (!is_held(s.map, outliers_[i], s.faults)) continue;
      const auto row = window_.at(outliers_[i]);
      const keyframe k = window_.frames()[static_cast<std::size_t>(row.frame)];
      if (fade(s.map, k, static_cast<std::size_t>(row.keypoint), options.fewest_measurements))
        ++summary.points_erased;
      else
        lost_views_.push_back(points()[static_cast<std::size_t>(row.landmark)]);
      ++summary.outliers;
    }
  }
  /// Whether the keypoint of a row sees its point yet, and neither contradicts the map. Each point is looked at once while the
  /// guard is held: see checks_.
  bool is_held(const Map& map, std::size_t i, fault_sink faults) {
    const auto row = window_.at(i);
    const keyframe k = window_.frames()[static_cast<std::size_t>(row.frame)];
    const auto l = static_cast<std::size_t>(row.landmark), keypoint = static_cast<std::size_t>(row.keypoint);
    std::uint8_t& check = checks_[l];
    if (check == unchecked) {
      look_again(map, points()[l]);
      check = looked_at;
    }
    look_again(map, k, keypoint);
    if (!traits::alive(map, k) || !(traits::point_at(map, k, keypoint) == points()[l])) return false;
    if (!require_consistent_slot(map, k, keypoint, faults)) return false;
    if (check == looked_at) check = require_consistent(map, points()[l], faults) ? sound : contradicts;
    return check == sound;
  }
  bool unmoved(const Map& map, std::size_t p) const {
    look_at_position(map, points()[p]);
    if (!traits::alive(map, points()[p])) return false;
    const vec3<double> now = adjustment_window<Map>::position_of(map, points()[p]), &then = window_.positions()[p];
    return now.x == then.x && now.y == then.y && now.z == then.z;
  }
  /// Rows beyond their gate that the map still has. Throws inconsistent_map before anything is written.
  void find_outliers(const Map& map, const local_adjustment_options& options, fault_sink faults) {
    outliers_.clear();
    checks_.assign(points().size(), unchecked);
    for (std::size_t i = 0; i < window_.row_count(); ++i) {
      const bool fits = chi2_[i] <= (measurements_.is_stereo(i) ? options.stereo_chi2 : options.mono_chi2);
      if (fits && (depth_[i] > 0 || !measurements_.is_straight(i))) continue;
      if (unmoved(map, static_cast<std::size_t>(window_.at(i).landmark)) && is_held(map, i, faults))
        outliers_.push_back(i);
    }
  }

  enum : std::uint8_t { unchecked, looked_at, sound, contradicts };

  adjustment_window<Map> window_;
  window_measurements<Map, Policy> measurements_;
  bundle_problem<Policy, pose_frame, reprojections<camera>> problem_;
  plain_vector<rigid_transform<double>> T_cw_;   ///< by frame, adjusted
  plain_vector<rigid_transform<double>> known_;  ///< by frame, as this stage read or wrote it last
  plain_vector<vec3<double>> positions_;         ///< by point, adjusted
  plain_vector<double> chi2_, depth_;            ///< by row, at the end
  plain_vector<std::size_t> outliers_;           ///< rows
  plain_vector<std::uint8_t> checks_;            ///< by point, since the guard was taken
  list_of<point> lost_views_;
};

template <class Map, class Policy>
local_adjustment(const mapping_scope<Map, Policy>&) -> local_adjustment<Map, Policy>;

TURBOMAP_END_NAMESPACE

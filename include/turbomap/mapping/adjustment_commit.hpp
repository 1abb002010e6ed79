// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How the result of an adjustment is written back to the user's map, which others may have changed since it was read: the poses
/// if all are those that were read, then the points that are where they were, then the observations that do not fit are
/// taken out. What all adjusting stages share.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/validate.hpp"
#include "../plain_vector.hpp"
#include "adjustment_window.hpp"
#include "local_adjustment_options.hpp"
#include "look_again.hpp"
#include "stage.hpp"
#include "window_measurements.hpp"

namespace turbomap {

/// What a free frame has besides its pose: nothing. For adjustments of poses and points.
struct pose_alone {
  /// Whether what a free frame has besides its pose is as it was read.
  template <class Map, class Keyframe>
  bool unchanged(const Map&, const Keyframe&, std::size_t) const {
    return true;
  }
  /// Writes what a free frame has besides its pose.
  template <class Map, class Keyframe>
  void write(Map&, const Keyframe&, std::size_t) {}
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// The results of a window, and their commit. Make one and use it again: its memory is reused.
template <class Map, class Policy>
class adjustment_commit {
 public:
  /// @{
  /// Types of the map, as its traits name them; `scope` is what a stage is called with.
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using scope = mapping_scope<Map, Policy>;
  /// @}

  /// \name Results, which the stage fills in
  /// @{
  plain_vector<rigid_transform<double>> T_cw;  ///< by frame, adjusted
  plain_vector<vec3<double>> positions;        ///< by point, adjusted
  plain_vector<double> chi2, depth;            ///< by row, at the end
  /// @}

  /// \param window,measurements  those of the stage; must outlive this
  explicit adjustment_commit(const adjustment_window<Map>& window, const window_measurements<Map, Policy>& measurements)
      : window_(window), measurements_(measurements) {}

  /// A window is read anew: nothing of it was written, or has lost a view.
  void clear() { lost_views_.clear(), wrote_ = false; }
  /// Whether anything of the window was written to the map.
  bool wrote() const { return wrote_; }

  /// Finds the outliers, writes poses and positions, and takes the outliers out, in parts; all poses are written in one. Before each
  /// part it looks whether the poses are those that it knows: once somebody else has moved a keyframe, the rest of the result
  /// no longer fits.
  /// \param more  what else a free frame has: see pose_alone
  template <class More>
  void operator()(const scope& s, const local_adjustment_options& options, local_adjustment_summary& summary,
                  More more) {
    known_ = window_.frames().T_cw();
    find_rows_beyond_gates(options);
    const auto most = static_cast<std::size_t>(options.points_per_guard);
    const std::size_t most_rows = most == 0 ? beyond_.size() : (most + 3) / 4;
    outliers_.clear();
    std::size_t looked_at_rows = 0;
    do {
      const auto guard = s.guard();
      if (!poses_are_known(s.map) || !more_is_known(s.map, more)) summary.stale = true;
      if (summary.stale) return;
      looked_at_rows = find_outliers(s.map, looked_at_rows, most_rows, s.faults);
      if (looked_at_rows < beyond_.size()) continue;
      if (beyond_.size() > most_rows) keep_unmoved_outliers(s.map);
      lost_views_.reserve(outliers_.size());
      write_poses(s.map, more);
      if (most == 0 || points().size() + 4 * outliers_.size() <= most) {
        write_positions(s.map, 0, points().size());
        return take_out(s, 0, outliers_.size(), options, summary);
      }
    } while (looked_at_rows < beyond_.size());
    in_parts(s, points().size(), most, summary,
             [&](std::size_t begin, std::size_t end) { write_positions(s.map, begin, end); });
    in_parts(s, outliers_.size(), most_rows, summary, [&](std::size_t begin, std::size_t end) {
      nothing_is_checked();
      take_out(s, begin, end, options, summary);
    });
  }

  /// Numbers of the rows whose chi2 was beyond the gate, or whose point was behind its camera, at the last commit;
  /// ascending.
  const plain_vector<std::size_t>& rows_beyond_gates() const { return beyond_; }
  /// The points that lost an observation as an outlier and live on.
  const list_of<point>& points_that_lost_views() const { return lost_views_; }

 private:
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
      if (!traits::alive(map, frames[f]) || !is_same_pose(pose_of(map, frames[f]), known_[f])) return false;
    }
    return true;
  }
  template <class More>
  bool more_is_known(const Map& map, const More& more) const {
    const auto& frames = window_.frames();
    for (std::size_t f = 0; f < frames.size(); ++f)
      if (window_.fixed()[f] == 0 && !more.unchanged(map, frames[f], f)) return false;
    return true;
  }
  template <class More>
  void write_poses(Map& map, More& more) {
    wrote_ = true;
    const auto& frames = window_.frames();
    for (std::size_t f = 0; f < frames.size(); ++f) {
      if (window_.fixed()[f] != 0) continue;
      traits::set_pose(map, frames[f], T_cw[f]);
      known_[f] = pose_of(map, frames[f]);  // the map may round it
      more.write(map, frames[f], f);
    }
  }
  void write_positions(Map& map, std::size_t begin, std::size_t end) {
    for_each_named_ahead<static_cast<unsigned>(point_data::entry)>(
        map, end - begin, [&](std::size_t i) -> const point& { return points()[begin + i]; },
        [&](std::size_t i, const point& p) {
          if (unmoved(map, begin + i)) traits::set_position(map, p, positions[begin + i]);
        });
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
  /// The guard was just taken.
  void nothing_is_checked() {
    checks_.assign(points().size(), unchecked);
    alive_.clear();
  }
  /// Whether the keypoint of a row sees its point yet, and neither contradicts the map. Each point is looked at once while the
  /// guard is held: see checks_.
  bool is_held(const Map& map, std::size_t i, fault_sink faults) {
    const auto row = window_.at(i);
    const keyframe k = window_.frames()[static_cast<std::size_t>(row.frame)];
    const auto l = static_cast<std::size_t>(row.landmark), keypoint = static_cast<std::size_t>(row.keypoint);
    std::uint8_t& check = checks_[l];
    if (check == unchecked) {
      look_at_point(map, points()[l], alive_);
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
    const vec3<double> now = position_of(map, points()[p]), &then = window_.positions()[p];
    return now.x == then.x && now.y == then.y && now.z == then.z;
  }
  double gate_of(std::size_t row, const local_adjustment_options& options) const {
    if (measurements_.is_stereo(row)) return options.outlier_factor * options.stereo_chi2;
    const double near = depth[row] < options.near_depth ? options.near_mono_factor : 1;
    return near * options.outlier_factor * options.mono_chi2;
  }
  /// What may be outliers; no guard is needed for it.
  void find_rows_beyond_gates(const local_adjustment_options& options) {
    beyond_.clear();
    for (std::size_t i = 0; i < window_.row_count(); ++i) {
      const bool fits = chi2[i] <= gate_of(i, options);
      if (!fits || !(depth[i] > 0 || !measurements_.is_straight(i))) beyond_.push_back(i);
    }
  }
  /// Those of them that the map still has: of the next `most`. Throws inconsistent_map before anything is written. \return the
  /// end of what was looked at
  std::size_t find_outliers(const Map& map, std::size_t begin, std::size_t most, fault_sink faults) {
    nothing_is_checked();
    const std::size_t end = beyond_.size() - begin < most ? beyond_.size() : begin + most;
    for (std::size_t n = begin; n < end; ++n)
      if (unmoved(map, static_cast<std::size_t>(window_.at(beyond_[n]).landmark)) && is_held(map, beyond_[n], faults))
        outliers_.push_back(beyond_[n]);
    return end;
  }

  /// Of outliers that were found in several parts: somebody may have moved a point since, which keeps what it has.
  void keep_unmoved_outliers(const Map& map) {
    std::size_t kept = 0;
    for (const std::size_t row : outliers_)
      if (unmoved(map, static_cast<std::size_t>(window_.at(row).landmark))) outliers_[kept++] = row;
    outliers_.resize(kept);
  }

  const list_of<point>& points() const { return window_.points(); }

  enum : std::uint8_t { unchecked, looked_at, sound, contradicts };

  const adjustment_window<Map>& window_;
  const window_measurements<Map, Policy>& measurements_;
  plain_vector<rigid_transform<double>> known_;  ///< by frame, as this commit read or wrote it last
  plain_vector<std::size_t> beyond_, outliers_;  ///< rows beyond their gate; those of them that are taken out
  plain_vector<std::uint8_t> checks_;            ///< by point, since the guard was taken
  list_of<keyframe> alive_;                      ///< see look_at_point()
  list_of<point> lost_views_;
  bool wrote_ = false;
};

TURBOMAP_END_NAMESPACE

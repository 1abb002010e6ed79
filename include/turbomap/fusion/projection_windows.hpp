// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The last question of the prefilter (projection_prefilter.hpp) for many points at once, on the host: whether a keypoint in the window of a
/// point could be its match. A window holds a few keypoints, most of which do not fit, and where so short a loop ends or turns cannot be
/// predicted. So the keypoints of all windows are listed first, then tested without branches, and descriptors of what is left compared. It
/// keeps the margins of the prefilter: the plan is the same.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "../config.hpp"
#include "../store/keypoint_window.hpp"
#include "projection_prefilter.hpp"
#include "projection_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// For one camera of one target. \tparam Most  points of one call
template <class Descriptor, class Camera, int Most>
class projection_windows {
 public:
  /// \param search,camera  must outlive this
  projection_windows(const projection_view<Descriptor, Camera>& search, const projection_camera& camera)
      : search_(search), view_(search.keyframes[camera.of.target]), of_(camera.of), bf_(camera.bf.value) {
    const projection_options& options = search.options;
    widest_ = options.radius * (options.oblique_factor > 1 ? options.oblique_factor : 1);
    const int known = options.is_gated(false) ? std::min(options.scales.levels, last_gate) : 0;
    for (int o = 0; o < known; ++o) {
      gate_[0][o] = gate_of(options.mono_chi2, search.scale[o]);
      gate_[1][o] = gate_of(options.stereo_chi2, search.scale[o]);
    }
    for (int o = known; o <= last_gate; ++o) gate_[0][o] = gate_[1][o] = std::numeric_limits<double>::infinity();
  }

  /// Whether add() may be called: points are exact, and the target has a cell index.
  bool is_known() const { return search_.points.covariance == nullptr && view_.cells.columns > 0; }

  /// Lists the keypoints around a point; at most `Most` points between two calls of find(). The parameters are those of
  /// projection_prefilter::may_match_at(), but level >= -1.
  void add(int point, const vec2<double>& p, double z, int level) {
    const projection_options& options = search_.options;
    const double s = static_cast<double>(search_.scale[level >= 0 ? level : options.window_octave]);
    const int at = points_++;
    point_[at] = point, hope_[at] = 0;
    u_[at] = p.x, v_[at] = p.y, u_right_[at] = bf_ > 0 ? p.x - bf_ / z : 0;
    const double radius = radius_[at] = widest_ * s * (1 + detail::loose) + detail::loose_pixels;
    least_[at] = level < 0 ? 0 : level - options.finer_octaves;
    most_[at] = level < 0 ? 255 : level + std::min(options.coarser_octaves, 255);
    const cell_index_view& cells = view_.cells;
    const auto columns =
        detail::cells_between(p.x - radius, p.x + radius, cells.bounds.min_x, cells.inverse_width, cells.columns);
    const auto rows =
        detail::cells_between(p.y - radius, p.y + radius, cells.bounds.min_y, cells.inverse_height, cells.rows);
    if (rows.first > rows.last) return;
    for (int column = columns.first; column <= columns.last; ++column) {
      const std::int64_t cell = (static_cast<std::int64_t>(of_.camera) * cells.columns + column) * cells.rows;
      list(cells.offsets[static_cast<std::size_t>(cell + rows.first)],
           cells.offsets[static_cast<std::size_t>(cell + rows.last + 1)], at);
    }
  }
  /// Calls found(point) for points that were added and may have a match, and forgets all.
  template <class Found>
  void find(const Found& found) {
    compare();
    for (int i = 0; i < points_; ++i)
      if (hope_[i] != 0) found(point_[i]);
    points_ = 0;
  }

 private:
  static constexpr int last_gate = 31, group = 8, most_listed = 512;

  static double gate_of(double chi2, float scale) {
    const double sigma = static_cast<double>(scale);
    const double root = std::sqrt(chi2 * sigma * sigma) * (1 + detail::loose) + 2 * detail::loose_pixels;
    return root * root;
  }
  /// A few at once, of which as many count as there are: mostly all of them.
  void list(std::uint32_t begin, std::uint32_t end, int owner) {
    do {
      if (listed_ > most_listed) compare();
      for (std::uint32_t i = 0; i < group; ++i) entry_[listed_ + static_cast<int>(i)] = begin + i;
      for (int i = 0; i < group; ++i) owner_[listed_ + i] = owner;
      const std::uint32_t left = end - begin;
      listed_ += static_cast<int>(left < group ? left : group);
      begin += group;
    } while (begin < end);
  }
  void compare() {
    if (bf_ > 0 && view_.u_right != nullptr)
      keep_fitting<true>();
    else
      keep_fitting<false>();
    for (int i = 0; i < listed_; ++i)
      hope_[owner_[i]] |= static_cast<std::uint8_t>(
          Descriptor::distance(search_.descriptor_of(point_[owner_[i]]),
                               view_.descriptor_of(static_cast<int>(entry_[i]))) <= search_.max_distance);
    listed_ = 0;
  }
  /// Leaves the keypoints that the prefilter would compare, by number.
  template <bool Stereo>
  void keep_fitting() {
    int kept = 0;
    for (int i = 0; i < listed_; ++i) {
      const std::uint32_t k = view_.cells.keypoints[entry_[i]];
      const int at = owner_[i], octave = view_.octave[k], gate = octave < last_gate ? octave : last_gate;
      const double du = static_cast<double>(view_.pixel[k].x) - u_[at],
                   dv = static_cast<double>(view_.pixel[k].y) - v_[at];
      double error = du * du + dv * dv, most = gate_[0][gate];
      if constexpr (Stereo) {
        const double seen = static_cast<double>(view_.u_right[k]), dr = seen - u_right_[at];
        error += seen >= 0 ? dr * dr : 0;
        most = seen >= 0 ? gate_[1][gate] : most;
      }
      const double radius = radius_[at];
      const int off = int{std::abs(du) >= radius} | int{std::abs(dv) >= radius} | int{error > most};
      const int taken = of_.taken != nullptr ? int{of_.taken[k]} : 0;
      const int other = int{octave < least_[at]} | int{octave > most_[at]};
      entry_[kept] = k, owner_[kept] = at;
      kept += (off | taken | other) == 0 ? 1 : 0;
    }
    listed_ = kept;
  }

  const projection_view<Descriptor, Camera>& search_;
  const keyframe_view<Descriptor, Camera>& view_;
  const projection_request& of_;
  double bf_, widest_;             ///< px at octave 0
  double gate_[2][last_gate + 1];  ///< px^2, by octave: largest squared error without and with u_right
  int points_ = 0, listed_ = 0;
  int point_[Most], least_[Most], most_[Most];  ///< octaves
  double u_[Most], v_[Most], u_right_[Most], radius_[Most];
  std::uint8_t hope_[Most];
  std::uint32_t entry_[most_listed + 2 * group];  ///< of the cell index, later a keypoint
  std::int32_t owner_[most_listed + 2 * group];   ///< number of its point here
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that adjusts poses and points around a keyframe, so that every point is seen where it lies [ORB-SLAM3]. It
/// minimises the reprojection errors of a window of the map by bundle adjustment, writes the result back, and takes out of
/// the map the observations that still do not fit.

#include <cstddef>

#include "../adjustment/levenberg_marquardt.hpp"
#include "../adjustment/problem.hpp"
#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../plain_vector.hpp"
#include "adjustment_commit.hpp"
#include "adjustment_window.hpp"
#include "local_adjustment_check.hpp"
#include "local_adjustment_options.hpp"
#include "stage.hpp"
#include "window_measurements.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Counts what is in a window.
template <class Window>
void count_window(const Window& window, local_adjustment_summary& summary) {
  for (const auto fixed : window.fixed()) ++(fixed != 0 ? summary.fixed_keyframes : summary.free_keyframes);
  summary.points = window.points().size();
  summary.observations = window.row_count();
}
/// Whether there is something to adjust in a window that was counted; if not, `solve.end` says why.
inline bool has_work(local_adjustment_summary& summary) {
  if (summary.free_keyframes != 0 && summary.observations != 0) return true;
  summary.solve.end = summary.observations == 0 ? adjustment_end::no_observations : adjustment_end::nothing_free;
  return false;
}

/// adjust() on a user's map. Of one context. Huber kernels, information by octave; cameras are those of the keyframes in the
/// store. Observations beyond their gate, or behind their pinhole camera, are taken out of the map.
/// \tparam Methods  the solvers and precisions that the options may ask for: see adjust()
template <class Map, class Policy, class Methods = adjustment_methods<>>
class local_adjustment {
 public:
  /// @{
  /// Types of the map, as its traits name them; `scope` is what a stage is called with.
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using camera = typename traits::camera;
  using scope = mapping_scope<Map, Policy>;
  /// @}

  /// One for the scope's map and context: `local_adjustment adjust(scope);`.
  explicit local_adjustment(const scope& s) : local_adjustment(s.ctx) {}
  /// \param ctx  must outlive this
  explicit local_adjustment(context<Policy>& ctx) : measurements_(ctx), problem_(ctx), commit_(window_, measurements_) {
    static_assert(adjustable_v<Map>,
                  "turbomap: local_adjustment needs map_traits with set_pose and set_position; see docs/map.md");
  }
  local_adjustment(const local_adjustment&) = delete;  // the commit refers to the window
  local_adjustment& operator=(const local_adjustment&) = delete;

  /// The map is left as it is where a free keyframe moved or died meanwhile (summary.stale; what was written before that stays,
  /// see options.points_per_guard), and where nothing better was found (summary.solve.accepted is 0, and end says why). Points
  /// that moved or died meanwhile keep what they have.
  /// \throws std::invalid_argument  an option out of range, a keyframe that is not in the store; inconsistent_map where an
  ///         outlier's point contradicts the map, unless the scope notes faults: nothing is written then; where it came to
  ///         contradict it between two parts, the parts before stay
  local_adjustment_summary operator()(const scope& s, keyframe current, const local_adjustment_options& options) {
    local_adjustment_summary summary;
    (*this)(s, current, options, summary);
    return summary;
  }
  /// The same. \param summary  overwritten; after an exception it has what was done before
  void operator()(const scope& s, keyframe current, const local_adjustment_options& options,
                  local_adjustment_summary& summary) {
    summary = {};
    snapshot(s, current, options, summary);
    if (!summary.stale && compute(s, options, summary)) commit(s, options, summary);
  }

  /// The window around the keyframe.
  void snapshot(const scope& s, keyframe current, const local_adjustment_options& options,
                local_adjustment_summary& summary) {
    nothing_is_written();
    check(options);
    s.in_parts(
        [&] {
          begin(summary, current == keyframe{} || !traits::alive(s.map, current));
          if (summary.stale) return;
          s.stored.at(traits::id(s.map, current));  // throws when it is not there
          window_.choose(s, current, options.min_shared_points, options.second_min_shared_points,
                         options.most_keyframes);
        },
        [&] { window_.resume(s); }, [&](std::size_t most) { return window_.read(s, most); });
    count_window(window_, summary);
  }

  /// Adjusts it. \return whether there is something to write
  bool compute(const scope& s, const local_adjustment_options& options, local_adjustment_summary& summary) {
    if (!has_work(summary)) return false;
    measurements_.gather(s, window_, options.scales);
    const auto rows = measurements_.rows(window_, options);
    problem_.assign(s.ctx, {window_.frames().T_cw(), window_.fixed()}, {window_.positions(), {}}, rows);
    summary.solve = adjust<Methods>(s.ctx, problem_, options.solve);
    if (summary.solve.accepted == 0) return false;
    problem_.template results<0>(s.ctx, commit_.T_cw, commit_.positions, commit_.chi2, commit_.depth);
    return true;
  }

  /// Writes what was found: see adjustment_commit.
  void commit(const scope& s, const local_adjustment_options& options, local_adjustment_summary& summary) {
    commit_(s, options, summary, pose_alone{});
  }

  /// The points of the last adjustment: their normals and ranges are due.
  const list_of<point>& points() const { return window_.points(); }
  /// Those of them that lost an observation as an outlier and live on: their descriptors are due too.
  const list_of<point>& points_that_lost_views() const { return commit_.points_that_lost_views(); }
  /// Whether the last adjustment wrote anything of it to the map, also where it ended with an exception.
  bool wrote() const { return commit_.wrote(); }
  /// There was none: both lists are empty. For who adjusts in another way meanwhile.
  void forget() { window_.clear(), commit_.clear(); }

 protected:
  /// Comes first: what follows may throw.
  void nothing_is_written() { commit_.clear(); }
  /// \param stale  there is no window
  void begin(local_adjustment_summary& summary, bool stale) {
    summary.stale = stale;
    if (!stale) return;
    summary.solve.end = adjustment_end::no_observations;
    window_.clear();
  }

  adjustment_window<Map> window_;  ///< what is adjusted

 private:
  window_measurements<Map, Policy> measurements_;
  bundle_problem<Policy, pose_frame, reprojections<camera>> problem_;
  adjustment_commit<Map, Policy> commit_;
};

/// Of a scope's map and policy.
template <class Map, class Policy>
local_adjustment(const mapping_scope<Map, Policy>&) -> local_adjustment<Map, Policy>;

TURBOMAP_END_NAMESPACE

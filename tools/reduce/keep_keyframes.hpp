// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A recording without some of its keyframes. Tracking names a map point by observations in earlier keyframes; where those are gone,
/// another one that is left names it, and where none is, the keyframe makes the point itself, at the recorded position.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <turbomap/error.hpp>
#include <turbomap/io/recording.hpp>

namespace turbomap_reduce {

/// Which keypoints of the recording show one map point, as far as associations tell, and which of them are left.
class recorded_points {
 public:
  using reference = turbomap::keypoint_reference;
  static constexpr std::int32_t gone = -1;

  /// \param place  of each keyframe in the reduced recording, or `gone`
  explicit recorded_points(const std::vector<std::int32_t>& place) : place_(place) {}

  /// The point that these observations name; a new one where none of them is known.
  std::size_t point_of(reference latest, reference earliest) {
    for (const reference& r : {latest, earliest}) {
      const auto known = points_.find({r.keyframe, r.keypoint});
      if (known != points_.end()) return known->second;
    }
    const std::size_t p = views_.size();
    views_.emplace_back();
    observe(p, earliest), observe(p, latest);
    return p;
  }
  /// From now on the keypoint shows the point.
  void observe(std::size_t p, reference view) {
    if (view.keyframe < 0) return;
    points_[{view.keyframe, view.keypoint}] = p;
    if (place(view) != gone) views_[p].push_back({place(view), view.keypoint});
  }
  /// `named`, in the reduced recording, if it is left; else the latest or the earliest view of the point that is, {-1, -1}: none.
  reference left(std::size_t p, reference named, bool latest) const {
    if (named.keyframe >= 0 && place(named) != gone) return {place(named), named.keypoint};
    const auto& views = views_[p];
    if (views.empty()) return {};
    const auto before = [](const reference& a, const reference& b) {
      return std::tie(a.keyframe, a.keypoint) < std::tie(b.keyframe, b.keypoint);
    };
    return latest ? *std::max_element(views.begin(), views.end(), before)
                  : *std::min_element(views.begin(), views.end(), before);
  }

 private:
  std::int32_t place(reference r) const { return place_[static_cast<std::size_t>(r.keyframe)]; }

  const std::vector<std::int32_t>& place_;
  std::map<std::pair<std::int32_t, std::int32_t>, std::size_t> points_;  ///< by keyframe and keypoint
  std::vector<std::vector<reference>> views_;                            ///< left ones, in the reduced recording
};

/// Appends the associations and the points on probation of keyframe i, if it is left, and learns from them.
inline void keep_references(const turbomap::recording& whole, std::size_t i, bool left, recorded_points& points,
                            turbomap::recording& reduced) {
  const auto self = static_cast<std::int32_t>(i), place = static_cast<std::int32_t>(reduced.t_ns.size()) - 1;
  for (std::size_t row = whole.recent(i).begin; left && row < whole.recent(i).end; ++row) {
    const auto named = whole.recent_ref[row];
    const auto at = points.left(points.point_of(named, named), named, true);
    if (at.keyframe < 0 && named.keyframe >= 0) continue;  // nobody that is left has seen it
    reduced.recent_ref.push_back(at), reduced.recent_firstkf_mnid.push_back(whole.recent_firstkf_mnid[row]);
    reduced.recent_visible.push_back(whole.recent_visible[row]),
        reduced.recent_found.push_back(whole.recent_found[row]);
  }
  for (std::size_t row = whole.associations(i).begin; row < whole.associations(i).end; ++row) {
    const auto latest = whole.assoc_ref[row], earliest = whole.assoc_ref2[row];
    const turbomap::keypoint_reference own{self, whole.assoc_kp[row]};
    const bool unnamed = latest.keyframe < 0 && earliest.keyframe < 0;
    const std::size_t p = points.point_of(unnamed ? own : latest, unnamed ? own : earliest);
    if (left) {
      auto kept_latest = points.left(p, latest, true), kept_earliest = points.left(p, earliest, false);
      const bool orphan = !unnamed && kept_latest.keyframe < 0;
      if (orphan) kept_latest = kept_earliest = {place, own.keypoint};
      if (unnamed) kept_latest = kept_earliest = {};
      // Two keypoints of a rig that show an orphan: the second names the first.
      const bool with_orphan = !orphan && latest.keyframe != self && kept_latest.keyframe == place;
      reduced.assoc_kp.push_back(own.keypoint), reduced.assoc_pos.push_back(whole.assoc_pos[row]);
      reduced.assoc_ref.push_back(kept_latest), reduced.assoc_ref2.push_back(kept_earliest);
      reduced.assoc_new.push_back(orphan || with_orphan ? 1 : whole.assoc_new[row]);
    }
    points.observe(p, own);
  }
}

/// The rows of `whole` that belong to the kept keyframes: arrays of one row per keyframe or keypoint.
template <class Row>
void keep_rows(const turbomap::recording& whole, const std::vector<std::size_t>& kept, turbomap::recording_rows what,
               const std::vector<Row>& from, std::vector<Row>& to) {
  if (from.empty()) return;
  for (const std::size_t i : kept) {
    const auto range = what == turbomap::recording_rows::keyframes ? turbomap::row_range{i, i + 1} : whole.keypoints(i);
    to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(range.begin),
              from.begin() + static_cast<std::ptrdiff_t>(range.end));
  }
}

/// The recording of the keyframes `kept`: indices, ascending, at least one. IMU, ground truth, frames and scene stay whole;
/// snapshots, and what the recorded system reported in the end, go. Throws std::invalid_argument for other `kept`.
inline turbomap::recording keep_keyframes(const turbomap::recording& whole, const std::vector<std::size_t>& kept) {
  turbomap::require(!kept.empty(), "kept", kept.size(), "must name a keyframe");
  std::vector<std::int32_t> place(whole.keyframe_count(), recorded_points::gone);
  for (std::size_t n = 0; n < kept.size(); ++n) {
    turbomap::require(kept[n] < place.size() && (n == 0 || kept[n] > kept[n - 1]), "kept[]", kept[n],
                      "must be a keyframe after the one before");
    place[kept[n]] = static_cast<std::int32_t>(n);
  }
  turbomap::recording reduced;
  reduced.meta = whole.meta;
  reduced.meta.snapshots.clear(), reduced.meta.events.clear();
  reduced.meta.keyframes_inserted = static_cast<int>(kept.size());
  reduced.meta.keyframes_alive_end = reduced.meta.map_points_end = -1;
  reduced.meta.ate_kf_rmse_m = reduced.meta.ate_live_rmse_m = reduced.meta.sim3_scale = -1;
  for (turbomap::recording_event event : whole.meta.events) {
    const auto after = std::upper_bound(kept.begin(), kept.end(), static_cast<std::size_t>(event.iteration));
    event.iteration = static_cast<std::int32_t>(after - kept.begin()) - 1;
    if (event.iteration >= 0) reduced.meta.events.push_back(std::move(event));  // else all that is left came later
  }

  std::vector<const void*> sources;
  turbomap::visit_arrays(whole, [&](const char*, const auto& rows, turbomap::recording_rows, turbomap::presence) {
    sources.push_back(&rows);
  });
  std::size_t at = 0;
  turbomap::visit_arrays(reduced, [&](const char*, auto& rows, turbomap::recording_rows what, turbomap::presence) {
    const auto& source = *static_cast<const std::remove_reference_t<decltype(rows)>*>(sources[at++]);
    using of = turbomap::recording_rows;
    if (what == of::imu || what == of::ground_truth || what == of::frames || what == of::scene_points)
      rows = source;
    else if (what == of::keypoints || (what == of::keyframes && &rows != static_cast<const void*>(&reduced.t_ns)))
      keep_rows(whole, kept, what, source, rows);
  });
  for (std::int32_t& previous : reduced.prev_kf) {
    while (previous >= 0 && place[static_cast<std::size_t>(previous)] == recorded_points::gone)
      previous = whole.prev_kf[static_cast<std::size_t>(previous)];
    if (previous >= 0) previous = place[static_cast<std::size_t>(previous)];
  }

  recorded_points points(place);
  reduced.kp_off = reduced.assoc_off = reduced.recent_off = {0};
  for (std::size_t i = 0; i < whole.keyframe_count(); ++i) {
    const bool left = place[i] != recorded_points::gone;
    if (left) reduced.t_ns.push_back(whole.t_ns[i]);
    keep_references(whole, i, left, points, reduced);
    if (!left) continue;
    reduced.kp_off.push_back(reduced.kp_off.back() + static_cast<std::int64_t>(whole.keypoints(i).size()));
    reduced.assoc_off.push_back(static_cast<std::int64_t>(reduced.assoc_kp.size()));
    reduced.recent_off.push_back(static_cast<std::int64_t>(reduced.recent_ref.size()));
  }
  return reduced;
}

}  // namespace turbomap_reduce

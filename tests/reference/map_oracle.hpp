// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A map as a mathematician would write it down: a relation between keypoints and points. Everything else (who sees
/// what, how often, who is dead) is read off that relation, by definition, every time. Keyframes and points are their
/// ids.

#include <turbomap/types.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

namespace turbomap_test {

using oracle_id = std::uint64_t;
/// A keyframe and one of its keypoints.
using oracle_view = std::pair<oracle_id, std::size_t>;

/// What becomes of two points that a camera sees at two keypoints.
struct oracle_merge_rule {
  bool drop_always = false, drop_near = false;  ///< neither: refused
  double chi2 = 5.991, scale_factor = static_cast<double>(1.2F);
};

struct oracle_keyframe {
  std::vector<turbomap::keypoint> keypoints;
  double time_s = 0;
};

struct oracle_point {
  std::optional<oracle_id> reference;
  std::set<oracle_view> views;
};

/// The live keyframes and points; `changed_*` name what was touched since they were last cleared.
class map_oracle {
 public:
  std::map<oracle_id, oracle_keyframe> keyframes;
  std::map<oracle_id, oracle_point> points;
  std::map<oracle_view, oracle_id> holder;     ///< the same relation, by keypoint
  std::map<oracle_id, oracle_id> merged_into;  ///< dead points that live on in others
  std::set<oracle_id> changed_points, changed_keyframes;

  const turbomap::keypoint& keypoint(const oracle_view& v) const { return keyframes.at(v.first).keypoints[v.second]; }
  std::optional<oracle_id> point_at(const oracle_view& v) const {
    const auto found = holder.find(v);
    return found == holder.end() ? std::nullopt : std::optional(found->second);
  }

  // What follows from the relation.
  std::set<oracle_id> observers(oracle_id point) const {
    std::set<oracle_id> all;
    for (const oracle_view& v : points.at(point).views) all.insert(v.first);
    return all;
  }
  bool camera_sees(oracle_id point, oracle_id keyframe, int camera) const {
    for (const oracle_view& v : points.at(point).views)
      if (v.first == keyframe && keypoint(v).camera == camera) return true;
    return false;
  }
  /// The finest octave at which each observer sees the point.
  std::map<oracle_id, int> finest(oracle_id point) const {
    std::map<oracle_id, int> octaves;
    for (const oracle_view& v : points.at(point).views) {
      const int octave = keypoint(v).octave;
      const auto [at, is_new] = octaves.insert({v.first, octave});
      if (!is_new && octave < at->second) at->second = octave;
    }
    return octaves;
  }
  /// How many keyframes see the point, by their finest octave.
  std::map<int, unsigned> counts(oracle_id point) const {
    std::map<int, unsigned> sum;
    for (const auto& [keyframe, octave] : finest(point)) ++sum[octave];
    return sum;
  }
  int measurements(oracle_id point) const {
    int sum = 0;
    for (const oracle_view& v : points.at(point).views) sum += keypoint(v).u_right >= 0 ? 2 : 1;
    return sum;
  }
  /// Whether some camera sees the two points at keypoints that the rule takes for two things.
  bool seen_apart(oracle_id a, oracle_id b, const oracle_merge_rule& rule) const {
    for (const oracle_view& v : points.at(a).views)
      for (const oracle_view& w : points.at(b).views) {
        const auto &k = keypoint(v), &l = keypoint(w);
        if (v.first != w.first || k.camera != l.camera || rule.drop_always) continue;
        const double distance = std::hypot(static_cast<double>(k.x) - static_cast<double>(l.x),
                                           static_cast<double>(k.y) - static_cast<double>(l.y));
        const double s1 = std::pow(rule.scale_factor, k.octave), s2 = std::pow(rule.scale_factor, l.octave);
        if (!rule.drop_near || !(distance <= std::sqrt(rule.chi2) * std::hypot(s1, s2))) return true;
      }
    return false;
  }
  std::optional<oracle_id> resolve(oracle_id point) const {
    while (points.count(point) == 0) {
      const auto next = merged_into.find(point);
      if (next == merged_into.end()) return std::nullopt;
      point = next->second;
    }
    return point;
  }
  std::set<oracle_id> points_of(oracle_id keyframe) const {
    std::set<oracle_id> all;
    for (auto at = holder.lower_bound({keyframe, 0}); at != holder.end() && at->first.first == keyframe; ++at)
      all.insert(at->second);
    return all;
  }
  /// How many points each other keyframe shares with this one; those that share none are not in it.
  std::map<oracle_id, int> shared(oracle_id keyframe) const {
    std::map<oracle_id, int> sum;
    for (const oracle_id point : points_of(keyframe))
      for (const oracle_id other : observers(point))
        if (other != keyframe) ++sum[other];
    return sum;
  }

  // The edits.
  bool observe(oracle_id point, const oracle_view& v) {
    if (holder.count(v) != 0 || camera_sees(point, v.first, keypoint(v).camera)) return false;
    link(point, v);
    return true;
  }
  std::optional<oracle_id> forget(const oracle_view& v) {
    const auto point = point_at(v);
    if (!point) return std::nullopt;
    unlink(*point, v);
    const auto left = observers(*point);
    auto& reference = points.at(*point).reference;
    if (reference == v.first && left.count(v.first) == 0 && !left.empty()) reference = *left.begin();
    return point;
  }
  bool fade(const oracle_view& v, int fewest) {
    const auto point = forget(v);
    if (!point || measurements(*point) > fewest) return false;
    erase_point(*point);
    return true;
  }
  bool move(oracle_id keyframe, std::size_t from, std::size_t to) {
    const auto point = point_at({keyframe, from});
    if (!point || point_at({keyframe, to})) return false;
    unlink(*point, {keyframe, from});
    if (observe(*point, {keyframe, to})) return true;
    link(*point, {keyframe, from});
    return false;
  }
  bool merge(oracle_id from, oracle_id into, const oracle_merge_rule& rule) {
    if (from == into || seen_apart(from, into, rule)) return false;
    const auto views = points.at(from).views;
    erase_point(from);
    for (const oracle_view& v : views) observe(into, v);
    merged_into[from] = into;
    return true;
  }
  void erase_point(oracle_id point) {
    const auto views = points.at(point).views;
    for (const oracle_view& v : views) unlink(point, v);
    points.erase(point);
  }
  /// Returns the points that lost a view and live.
  std::set<oracle_id> erase_keyframe(oracle_id keyframe, int fewest) {
    std::set<oracle_id> survivors;
    for (const oracle_id point : points_of(keyframe)) {
      const auto views = points.at(point).views;
      for (const oracle_view& v : views)
        if (v.first == keyframe) forget(v);
      if (measurements(point) <= fewest)
        erase_point(point);
      else
        survivors.insert(point);
    }
    keyframes.erase(keyframe);
    return survivors;
  }

 private:
  void link(oracle_id point, const oracle_view& v) {
    points.at(point).views.insert(v), holder[v] = point;
    changed_points.insert(point), changed_keyframes.insert(v.first);
  }
  void unlink(oracle_id point, const oracle_view& v) {
    points.at(point).views.erase(v), holder.erase(v);
    changed_points.insert(point), changed_keyframes.insert(v.first);
  }
};

}  // namespace turbomap_test

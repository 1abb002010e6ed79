// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From found duplicates to a changed map: in the order of the plan, each entry tested again on the map as it is by then.
///
/// What happens to an entry (point A is found at a keypoint of keyframe K):
/// 1. A was merged since the search: the entry is about what A became. It was erased, or K was: the entry is stale.
/// 2. The same camera of K sees the point already, by this keypoint or another: nothing (already_observed).
/// 3. The keypoint has no live point: the point is observed there from now on (observation_added).
/// 4. The keypoint has a live point B, held since before the search or given to it by an earlier entry: A and B are
///    one. The one with more measurements survives, A when they are equal, and takes over all observations.
/// 5. But some camera sees A and B apart, at two keypoints: they are not one (conflict; merge_rule::refuse), or the
///    keypoint of the one that goes is left empty (merge_rule::drop). merge_rule::refuse_apart decides by how far apart, and
///    also refuses where the covariances of A and B say that they lie apart.
/// So when A merges into B while C claims the same keypoint, C is compared with the survivor, whichever came first in
/// the plan. No observation is lost under merge_rule::refuse.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../error.hpp"
#include "../fusion/duplicate_options.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/numbering.hpp"
#include "../map/observation_counts.hpp"
#include "../map/validate.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "fusion_options.hpp"
#include "look_again.hpp"

namespace turbomap {

/// What became of an entry of the plan. The first four are numbered as in recordings.
enum class fusion_action : std::uint8_t {
  none = 0,                ///< nothing to do
  observation_added = 1,   ///< the keypoint was free
  candidate_replaced = 2,  ///< the point of the keypoint had more measurements, and survives
  keypoint_replaced = 3,   ///< the point that was searched for survives
  stale = 5,               ///< point or keyframe are gone
  already_observed = 6,    ///< the camera sees the point already
  conflict = 7,            ///< seen apart: not the same point
  refused = 8              ///< what the entry concerns contradicts the map
};

/// What is done with a point that was found at a keypoint, by the measurements of both (measurement_count).
/// \param of_keypoints_point  < 0: the keypoint has no live point
inline fusion_action fusion_decision(int of_candidate, int of_keypoints_point) {
  if (of_keypoints_point < 0) return fusion_action::observation_added;
  return of_keypoints_point > of_candidate ? fusion_action::candidate_replaced : fusion_action::keypoint_replaced;
}

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Throws std::invalid_argument naming the option that is out of range.
inline void check_fusion_commit(const fusion_commit_options& o) {
  require(o.tolerance.chi2 >= 0, "options.tolerance.chi2", o.tolerance.chi2, "must not be negative");
  require(o.tolerance.position_chi2 >= 0, "options.tolerance.position_chi2", o.tolerance.position_chi2,
          "must not be negative");
  require(o.tolerance.scale_factor >= 1, "options.tolerance.scale_factor", o.tolerance.scale_factor,
          "must be at least 1");
  require(o.entries_per_guard >= 0, "options.entries_per_guard", o.entries_per_guard, "must not be negative");
}

/// Applies plans of duplicates to a map. Make one and use it again: its memory is reused.
template <class Map>
class fusion_commit {
 public:
  /// @{
  /// Types of the map, as its traits name them.
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  /// @}

  /// The caller holds the guard of the map.
  /// \param plan     in its order; `target` and `point` of an entry index the next two
  /// \param targets  keyframes that were searched
  /// \param points   points that were searched for
  /// \throws std::invalid_argument  an index out of range; inconsistent_map when a slot or point that an entry concerns
  ///         contradicts the map. Everything is checked, and our memory taken, before the first change: the map is then
  ///         as it was. When a write of the traits finds no memory, or a look at the map of a map_mirror, the entries before are
  ///         applied, and none is half done (a merge: where the traits have reserve_observations())
  /// \param faults  where to note contradictions instead; the entries that they concern are left out (refused). Of a map_mirror's
  ///                points only those slots are looked at then that the plan writes to
  /// O(entries x views^2).
  template <class Distance>
  fusion_summary operator()(Map& map, span<const duplicate<Distance>> plan, span<const keyframe> targets,
                            span<const point> points, const fusion_commit_options& options = {},
                            fault_sink faults = {}) {
    static_assert(require_map_traits<Map>());
    done_ = {};
    check_fusion_commit(options);
    actions_.assign(plan.size(), fusion_action::none);
    check(map, plan, targets, points, faults);
    make_room(touched_, touched_.size() + plan.size());  // an entry touches one point at most
    for (std::size_t i = 0; i < plan.size(); ++i) {
      const auto& entry = plan[i];
      if (actions_[i] == fusion_action::refused) continue;
      actions_[i] =
          apply(map, points[static_cast<std::size_t>(entry.point)], targets[static_cast<std::size_t>(entry.target)],
                static_cast<std::size_t>(entry.keypoint), options, faults);
      if (actions_[i] != fusion_action::refused) count(done_, actions_[i]);
    }
    return done_;
  }

  /// What became of each entry of the last plan.
  const plain_vector<fusion_action>& actions() const { return actions_; }
  /// What the last call did, also one that threw after some of its entries.
  const fusion_summary& done() const { return done_; }
  /// Points that gained observations since the last clear(): their descriptor, normal and range are due. Some may be dead or
  /// named twice.
  const list_of<point>& touched() const { return touched_; }
  /// The survivors of merges among them.
  const list_of<point>& survivors() const { return survivors_; }
  /// No point has been touched.
  void clear() { touched_.clear(), survivors_.clear(); }

 private:
  struct view {
    keyframe observer;
    std::size_t keypoint;
  };

  template <class Distance>
  void check(const Map& map, span<const duplicate<Distance>> plan, span<const keyframe> targets,
             span<const point> points, fault_sink faults) {
    std::size_t views = 0;
    checked_.clear(), sound_.clear(), looked_at_.clear(), slots_looked_at_.clear(), alive_.clear();
    looks_at_all_slots_ = faults.throws();  // before the first change
    for (std::size_t i = 0; i < plan.size(); ++i) {
      const auto& entry = plan[i];
      require(entry.target >= 0 && static_cast<std::size_t>(entry.target) < targets.size(), "plan[].target",
              entry.target, "is not the number of a target");
      require(entry.point >= 0 && static_cast<std::size_t>(entry.point) < points.size(), "plan[].point", entry.point,
              "is not the number of a point");
      const keyframe k = targets[static_cast<std::size_t>(entry.target)];
      if (i == 0 || entry.target != plan[i - 1].target) look_again(map, k);
      if (!traits::alive(map, k)) continue;
      require(entry.keypoint >= 0 && static_cast<std::size_t>(entry.keypoint) < keypoint_count_of(map, k),
              "plan[].keypoint", entry.keypoint, "is not a keypoint of the target");
    }
    // First the points that were searched for, then those of the keypoints: what is looked at next is known, and asked for.
    constexpr unsigned all = point_data::entry + point_data::views;
    const auto searched = [&](std::size_t i) -> const point& {
      return points[static_cast<std::size_t>(plan[i].point)];
    };
    constexpr std::size_t soon = detail::ahead_near / 2;  // the list of a point is there by then, and names its slots
    for_each_named_ahead<all>(map, plan.size(), searched, [&](std::size_t i, const point& p) {
      if (i + soon < plan.size()) ask_for_slots(map, searched(i + soon));
      if constexpr (is_copy_v<Map>) look_once(map, p);
    });
    const auto target = [&](std::size_t i) { return targets[static_cast<std::size_t>(plan[i].target)]; };
    const auto keypoint = [&](std::size_t i) { return static_cast<std::size_t>(plan[i].keypoint); };
    const auto holder = [&](std::size_t i) {
      return traits::alive(map, target(i)) ? traits::point_at(map, target(i), keypoint(i)) : point{};
    };
    if constexpr (is_copy_v<Map>)
      for_each_named_ahead<all>(map, plan.size(), holder, [&](std::size_t i, const point&) {
        if (i + soon < plan.size()) ask_for_slots(map, holder(i + soon));
        if (traits::alive(map, target(i))) look_at_pair(map, target(i), keypoint(i), resolve(map, searched(i)));
      });
    for_each_ahead<all>(map, plan.size(), holder, [&](std::size_t i, const point&) {
      if (!traits::alive(map, target(i))) return;
      if (!check_entry(map, target(i), keypoint(i), resolve(map, searched(i)), views, faults))
        actions_[i] = fusion_action::refused;
    });
    scratch_.reserve(views + plan.size());  // each entry may add a view
    make_room(survivors_, survivors_.size() + plan.size());
  }
  /// Whether slot and points of an entry agree with the map. \param views  of the points, added up
  bool check_entry(const Map& map, keyframe k, std::size_t keypoint, point candidate, std::size_t& views,
                   fault_sink faults) {
    if (!require_consistent_slot(map, k, keypoint, faults)) return false;
    const point holder = traits::point_at(map, k, keypoint);
    if (!(holder == point{}) && !check_once(map, holder, views, faults)) return false;
    if (candidate == point{}) return true;
    if (!check_once(map, candidate, views, faults)) return false;
    if constexpr (counts_octaves_v<Map>)
      if (keypoint_of(map, k, keypoint).octave >= traits::octave_counts(map, candidate).size()) {
        faults({map_fault::octave_out_of_range, traits::id(map, k), traits::id(map, candidate), keypoint});
        return false;
      }
    return true;
  }
  /// What decides about an entry. Of two points that are one, the slots of the one that goes: those are written to.
  void look_at_pair(const Map& map, keyframe k, std::size_t keypoint, point candidate) {
    look_again(map, k, keypoint);
    const point holder = traits::alive(map, k) ? traits::point_at(map, k, keypoint) : point{};
    if (!(holder == point{})) look_once(map, holder);
    if (!(candidate == point{})) look_once(map, candidate);
    if (!(holder == candidate) && is_alive(map, holder) && is_alive(map, candidate))
      look_at_slots_once(map, pair_of(map, candidate, holder).from);
  }
  void look_once(const Map& map, point p) {
    const std::size_t known = looked_at_.size();
    if (looked_at_.place(map, p) != known) return;
    look_at_list(map, p);
    slots_looked_at_.push_back(0);
    if (looks_at_all_slots_) look_at_slots_once(map, p);
  }
  /// \param p  has been looked at  \return whether its slots had not been
  bool look_at_slots_once(const Map& map, point p) {
    std::uint8_t& looked_at = slots_looked_at_[looked_at_.find(map, p)];
    if (looked_at != 0) return false;
    looked_at = 1;
    look_at_slots_of(map, p, alive_);
    return true;
  }
  /// Whether a point may go in a merge. In a copy of the user's map, the slots of those that the entries before made the lesser of
  /// two have not been looked at.
  bool may_go([[maybe_unused]] const Map& map, [[maybe_unused]] point p, [[maybe_unused]] fault_sink faults) {
    if constexpr (is_copy_v<Map>) {
      // The points of an entry that is applied have been looked at and checked.
      std::uint8_t& sound = sound_[checked_.find(map, p)];
      if (look_at_slots_once(map, p)) sound = require_consistent(map, p, faults) ? 1 : 0;
      return sound != 0;
    }
    return true;
  }
  static bool is_alive(const Map& map, const point& p) { return !(p == point{}) && traits::alive(map, p); }
  /// Two points that are one: which of them goes, and into which.
  struct pair {
    fusion_action action;
    point from, into;
  };
  static pair pair_of(const Map& map, const point& candidate, const point& holder) {
    const auto action = fusion_decision(measurement_count(map, candidate), measurement_count(map, holder));
    if (action == fusion_action::candidate_replaced) return {action, candidate, holder};
    return {action, holder, candidate};
  }
  bool check_once(const Map& map, point p, std::size_t& views, fault_sink faults) {
    const std::size_t known = sound_.size(), at = checked_.place(map, p);
    if (at != known) return sound_[at] != 0;
    if constexpr (is_copy_v<Map>) look_once(map, p);
    sound_.push_back(require_consistent(map, p, faults) ? 1 : 0);
    traits::for_each_observation(map, p, [&](keyframe, std::size_t) { ++views; });
    return sound_[at] != 0;
  }

  fusion_action apply(Map& map, point candidate, keyframe target, std::size_t keypoint,
                      const fusion_commit_options& options, fault_sink faults) {
    candidate = resolve(map, candidate);
    if (candidate == point{} || !traits::alive(map, target)) return fusion_action::stale;
    const int camera = keypoint_of(map, target, keypoint).camera;
    if (observed_at(map, candidate, target, camera) >= 0) return fusion_action::already_observed;
    const point holder = traits::point_at(map, target, keypoint);
    if (holder == point{}) {
      observe(map, candidate, target, keypoint);
      touched_.push_back(candidate);
      return fusion_action::observation_added;
    }
    const pair two = pair_of(map, candidate, holder);
    if (!may_go(map, two.from, faults)) return fusion_action::refused;
    if (!merge_points(map, two.from, two.into, options.merges, scratch_, options.tolerance))
      return fusion_action::conflict;
    touched_.push_back(two.into);
    survivors_.push_back(two.into);
    return two.action;
  }

  static void count(fusion_summary& s, fusion_action action) {
    ++s.entries;
    s.observations_added += action == fusion_action::observation_added ? 1 : 0;
    s.merged += action == fusion_action::candidate_replaced || action == fusion_action::keypoint_replaced ? 1 : 0;
    s.stale += action == fusion_action::stale ? 1 : 0;
    s.already_observed += action == fusion_action::already_observed ? 1 : 0;
    s.conflicts += action == fusion_action::conflict ? 1 : 0;
  }

  point_numbering<Map> looked_at_;              ///< in a copy of the user's map: points that were looked at
  plain_vector<std::uint8_t> slots_looked_at_;  ///< of each of them: so were its slots
  bool looks_at_all_slots_ = false;
  list_of<keyframe> alive_;           ///< see look_at_slots_of()
  point_numbering<Map> checked_;      ///< points that were checked
  plain_vector<std::uint8_t> sound_;  ///< of each of them
  plain_vector<fusion_action> actions_;
  fusion_summary done_;
  list_of<point> touched_, survivors_;
  list_of<view> scratch_;  ///< of a point that is merged
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that takes redundant keyframes out of the map: redundant_keyframes.hpp says which they are. Here each candidate is decided
/// on and taken out under the map's guard, one keyframe per hold, and a large one in several.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../culling/redundancy.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/neighbourhood.hpp"
#include "../plain_vector.hpp"
#include "erasure_in_parts.hpp"
#include "look_again.hpp"
#include "redundancy_counter.hpp"
#include "redundant_keyframes.hpp"
#include "stage.hpp"
#include "temporal_guards.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The stage: keyframes that share points with the current one are looked at, those that share most first. It counts and
/// decides under the guard, one keyframe per hold, because each removal changes the counts of the next: its snapshot is the
/// list of candidates, and compute() a short sum inside commit(). A keyframe of many points is decided on in one hold, and taken out
/// in others.
template <class Map, class Policy>
class keyframe_culling {
 public:
  /// @{
  /// Types of the map, as its traits name them; `scope` is what a stage is called with.
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using scope = mapping_scope<Map, Policy>;
  /// @}

  /// Chooses the candidates: covisible keyframes that are in the store, behind one that an exception left half taken out.
  /// \param most  no more than so many, those that share most; 0: all
  const list_of<keyframe>& snapshot(const scope& s, keyframe current, const neighbourhood_options& options,
                                    int most = 0) {
    const auto guard = s.guard();
    touched_.clear(), counter_.clear();
    const auto in_store = [&](keyframe k) {
      return traits::alive(s.map, k) && s.stored.contains(traits::id(s.map, k));
    };
    candidates_.clear();
    look_again(s.map, current);
    if (traits::alive(s.map, current))  // else erased meanwhile
      candidates_ = neighbourhood_.covisible_keyframes(s.map, current, options, in_store,
                                                       most > 0 ? static_cast<std::size_t>(most) : no_limit);
    if (!parts_.active()) return candidates_;
    look_again(s.map, parts_.of());
    if (!s.stored.contains(parts_.id()) || !traits::alive(s.map, parts_.of()))
      parts_.end();
    else if (!(parts_.of() == current))
      put_first(parts_.of());
    return candidates_;
  }
  /// Erases one candidate if it is redundant. A small keyframe goes at once, under the guard under which it was found redundant. One
  /// that sees more than a quarter of points_read_per_guard points goes in parts: each later hold of the guard takes so many
  /// observations away, and the last one erases the keyframe.
  ///
  /// Between two parts the keyframe is alive and others may change it. Each part asks again whether it may go. If somebody keeps it
  /// (may_erase, or its neighbours in time), or its slots and points contradict each other, it stays with the points that it still
  /// sees. If somebody has erased it, nothing more is done. Whether it is redundant is not asked again: the count would be of the
  /// points that are left. After any other exception it is the first candidate of the next snapshot(), which goes on with it.
  ///
  /// All of these are called under the guard:
  /// \param erasing  erasing(keyframe): it is redundant and still sees all its points, or fewer after an exception
  /// \param leaving  leaving(keyframe): it sees no point any more and is erased next
  /// \param erased   erased(id): its id is free
  template <class Erasing, class Leaving, class Erased>
  void commit(const scope& s, keyframe current, keyframe candidate, const keyframe_culling_options& options,
              const Erasing& erasing, const Leaving& leaving, const Erased& erased) {
    detail::check_culling<Map>(options);
    const bool again = parts_.is_of(candidate);
    std::uint64_t id = parts_.id();
    bool goes = false;
    s.in_parts(
        [&] {
          goes = again ? !is_kept(s, current, candidate, options) : is_to_go(s, current, candidate, options, id);
          if (!goes) return;
          make_room(touched_, touched_.size() + keypoint_count_of(s.map, candidate));
          erasing(candidate);
        },
        [&] { goes = !is_kept(s, current, candidate, options); },
        [&](std::size_t most) {
          const bool begun = parts_.is_of(candidate);
          if (!goes) {
            if (begun) parts_.end();
            return false;
          }
          const std::size_t points = (most - 1) / 4 + 1;  // to take one away is as long as to read four
          if (!begun) parts_.begin(candidate, id);
          if (begun) {
            const erasure_part part = parts_(s.map, points, options.fewest_measurements, touched_, s.faults);
            if (part != erasure_part::last) return part == erasure_part::some;
          } else if (sees_more_points(s.map, candidate, points)) {
            return true;
          } else {
            fade_keypoints(s.map, candidate, 0, keypoint_count_of(s.map, candidate), options.fewest_measurements,
                           &touched_);
          }
          leaving(candidate);
          traits::erase_keyframe(s.map, candidate);
          parts_.end();
          counter_.drop_keypoints(id);
          erased(id);
          return false;
        });
  }
  /// Nothing is known of the map any more: it starts anew.
  void clear() {
    parts_.end();
    candidates_.clear(), touched_.clear();
  }
  /// Points that lost a view since snapshot(): the appearance of those that live on is due, also where commit() threw. Some are
  /// named twice.
  const list_of<point>& touched() const { return touched_; }

 private:
  /// Whether a candidate is redundant, and nobody keeps it. \param id  is set to its id
  bool is_to_go(const scope& s, const keyframe& current, const keyframe& candidate,
                const keyframe_culling_options& options, std::uint64_t& id) {
    if (!traits::alive(s.map, candidate) || !has_time(s, current, options)) return false;
    counter_.remember_by(&s.stored);
    const auto record = judge_keyframe(s.map, current, candidate, options, detail::time_of(s.map, current, options),
                                       s.faults, counter_);
    id = record.id;
    return record.verdict == culling_verdict::erased;
  }
  /// Whether one that was to go stays after all.
  static bool is_kept(const scope& s, const keyframe& current, const keyframe& candidate,
                      const keyframe_culling_options& options) {
    look_again(s.map, candidate);
    return detail::is_protected(s.map, candidate, current) || !has_time(s, current, options) ||
           detail::is_kept_by_time(s.map, candidate, detail::time_of(s.map, current, options), options);
  }
  /// Where guards in time look back from a keyframe, it is there.
  static bool has_time(const scope& s, const keyframe& current, const keyframe_culling_options& options) {
    if (!options.temporal_guards) return true;
    look_again(s.map, current);
    return traits::alive(s.map, current);
  }
  void put_first(const keyframe& k) {
    std::size_t at = 0;
    while (at < candidates_.size() && !(candidates_[at] == k)) ++at;
    if (at == candidates_.size()) candidates_.push_back(k);
    for (; at > 0; --at) candidates_[at] = candidates_[at - 1];
    candidates_[0] = k;
  }
  static bool sees_more_points(const Map& map, const keyframe& k, std::size_t points) {
    std::size_t seen = 0;
    for (std::size_t i = 0; i < keypoint_count_of(map, k); ++i)
      seen += traits::point_at(map, k, i) == point{} ? std::size_t{0} : std::size_t{1};
    return seen > points;
  }

  neighbourhood<Map> neighbourhood_;
  list_of<keyframe> candidates_;
  erasure_in_parts<Map> parts_;
  list_of<point> touched_;
  redundancy_counter<Map> counter_;
};

TURBOMAP_END_NAMESPACE

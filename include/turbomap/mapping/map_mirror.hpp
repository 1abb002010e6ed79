// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A flat copy of a user's map, which the stages of a local_mapper read in its place. A map of objects with locks and getters that
/// copy makes every read expensive, and stages read each point many times. The mirror reads a keyframe or a point through the
/// user's map_traits when it is first asked for, and keeps it in arrays (map_copy.hpp). It is a map itself
/// (map_mirror_traits.hpp): a stage does not know the difference, and what a commit writes goes to the user's map and to the
/// mirror.
///
/// What others change is read anew when they report it (changed(), refresh()), when a commit looks again (look_again.hpp), or
/// when a sample check finds it (mirror_sample.hpp). Until then it costs quality at most: commits decide by what they have
/// looked at again.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../map/simple_map/map_ids.hpp"
#include "map_copy.hpp"
#include "map_mirror_traits.hpp"
#include "mirror_reports.hpp"
#include "mirror_sample.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Numbers of keyframes and points are those of a simple_map: an index, dense, and a generation. All members but changed() and
/// refresh() are for the thread of the mapper; all of those but keep_room() under the map's guard. Memory per point: some 160
/// bytes, its name and descriptor, four bytes per pyramid level, 8 to 16 per observation, 24 for a covariance: about 350 for an
/// ORB point with eight observations. Per keypoint of a keyframe 36 bytes.
template <class Map>
class map_mirror {
 public:
  /// @{
  /// Names in the user's map, and in the mirror.
  using user_keyframe = typename map_traits<Map>::keyframe;
  using user_point = typename map_traits<Map>::point;
  using keyframe = map_keyframe_id;
  using point = map_point_id;
  /// @}

  /// Empty. \param map  must outlive this
  explicit map_mirror(Map& map) : copy_(map) {}
  map_mirror(const map_mirror&) = delete;
  map_mirror& operator=(const map_mirror&) = delete;

  /// The user's map.
  Map& map() const { return copy_.map(); }
  /// What was read of it; a read of what is not here yet fills it in, also of a mirror that is const.
  map_copy<Map>& copy() const { return copy_; }

  // ---- what others report, from any thread ----

  /// The point is another than it was: position, observations, whatever it has. With or without the guard; heard when the next
  /// keyframe is processed.
  void changed(const user_point& p) { reports_.add(p); }
  /// The keyframe is another than it was: its pose, its slots. As for a point.
  void changed(const user_keyframe& k) { reports_.add(k); }
  /// Everything may have changed. To be said before the guard is released under which that was done; heard when a stage next takes
  /// the guard.
  void refresh() { reports_.add_all(); }

  // ---- for the mapper ----

  /// Nothing is known any more, and no name is kept: the user's map starts anew, perhaps with ids that were there before. The
  /// user's map is not asked.
  void reset() {
    copy_.points.clear();
    copy_.keyframes.clear();
    sample_.reset();
    reports_.take();
  }
  /// Makes room for what a keyframe brings. The user's map is not read, so no guard is needed. Throws std::bad_alloc.
  void keep_room() { copy_.points.keep_room(); }
  /// Before a keyframe is processed: what was reported is heard, numbers of merged points are free again, and names of what is gone
  /// are let go. In this order: what commits have found dead is mostly reported as well, and is known until its number is free.
  void begin() {
    copy_.keyframes.drop_names();  // those of what is lost now stay until the next call
    hear();
    copy_.points.free_merged();
  }
  /// What was reported is to be read anew.
  void hear() {
    const auto reported = reports_.take();
    try {
      if (reported.all) copy_.forget_all();
      list_of<user_point> lost;  // dead points that the mirror does not know by their id
      for (const user_point& p : reported.points) {
        const point known = number(p);
        if (known.index != map_copy<Map>::gone)
          forget(known);
        else if (!copy_.knows_dead(p))
          lost.push_back(p);
      }
      if (!lost.empty()) forget_named(lost);
      for (const user_keyframe& k : reported.keyframes) read_again(number(k));
    } catch (...) {
      refresh();
      throw;
    }
  }
  /// Everything is to be read anew if somebody has reported so since begin(): what is asked for from now on is of one time with
  /// what a stage reads from the user's map itself.
  void hear_refresh() const {
    if (reports_.take_all()) copy_.forget_all();
  }
  /// Compares one keyframe and a share of all points with the user's map, the next ones at each call, and reads anew those that
  /// differ. \return how many did
  std::size_t check_sample(double share) { return sample_.check(copy_, share); }
  /// All poses may have changed.
  void forget_poses() {
    for (std::size_t k = 1; k < copy_.keyframes.size(); ++k) copy_.keyframes[k].pose_read = 0;
  }
  /// The keyframe is out of the map.
  void removed(std::uint64_t id) {
    const std::int32_t k = copy_.keyframes.find(id);
    if (k != id_numbers::none) copy_.lose_keyframe(static_cast<std::size_t>(k));
  }
  /// Is to be read anew when it is next asked for.
  void forget(point p) const { copy_.forget(p); }
  /// See map_copy.
  bool take_associations(keyframe k, std::size_t& slot, std::size_t most) const {
    return copy_.take_associations(k, slot, most);
  }
  /// Reads pose and slots of a keyframe now: points that came into its slots, or left them, are to be read anew.
  void read_again(keyframe k) const {
    if (copy_.keyframes.known(k)) copy_.read_keyframe(copy_.at(k));
  }

  /// The number of what is named, which need not be read for it.
  keyframe number(const user_keyframe& name) const { return copy_.number(name); }
  /// The same of a point; no name: none.
  point number(const user_point& name) const { return copy_.number(name); }
  /// What the user calls a keyframe.
  const user_keyframe& name(keyframe k) const { return copy_.name(k); }
  /// What the user calls a point.
  const user_point& name(point p) const { return copy_.name(p); }

 private:
  /// Points that are dead are found by their id. A handle may not tell it any more: another point has its place in the user's
  /// map. Then its name is looked for among all; where many are reported so, to read everything anew costs less.
  void forget_named(span<const user_point> lost) {
    if (lost.size() > 16) return copy_.forget_all();
    auto& points = copy_.points;
    for (std::size_t p = 1; p < points.size(); ++p)
      for (const user_point& name : lost)
        if (points.names[p] == name) points.entries[p].read = 0;
  }

  mutable map_copy<Map> copy_;
  mirror_sample<Map> sample_;
  mutable mirror_reports<Map> reports_;
};

TURBOMAP_END_NAMESPACE

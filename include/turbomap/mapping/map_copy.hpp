// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How a map_mirror reads the user's map: a keyframe or a point through map_traits when it is first asked for, and again when it was
/// forgotten. Lists of points and slots of keyframes say the same thing twice; wherever one of them is read, the other is made to
/// agree, or is read anew.

#include <array>
#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../math/functions.hpp"
#include "../plain_vector.hpp"
#include "../types.hpp"
#include "mirror_objects.hpp"
#include "prefetch_named.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Whether a number is the one that was read before. What is not a number is as it was: a map may keep it for ever.
inline bool is_as_before(double now, double before) { return now == before || (is_nan(now) && is_nan(before)); }
/// The same of a position.
inline bool is_as_before(const vec3<double>& now, const vec3<double>& before) {
  return is_as_before(now.x, before.x) && is_as_before(now.y, before.y) && is_as_before(now.z, before.z);
}
/// The same of a pose.
inline bool is_as_before(const rigid_transform<double>& now, const rigid_transform<double>& before) {
  return is_as_before(now.qx, before.qx) && is_as_before(now.qy, before.qy) && is_as_before(now.qz, before.qz) &&
         is_as_before(now.qw, before.qw) && is_as_before(now.tx, before.tx) && is_as_before(now.ty, before.ty) &&
         is_as_before(now.tz, before.tz);
}

}  // namespace detail

/// A map, and what was read of it. A place that a member is given is one that was taken (not checked).
template <class Map>
class map_copy : public mirror_objects<Map> {
  using objects = mirror_objects<Map>;

 public:
  /// @{
  /// See mirror_objects.
  using objects::at, objects::gone, objects::keypoints, objects::map, objects::name, objects::number;
  using objects::keyframes, objects::points;
  using typename objects::keyframe, typename objects::point, typename objects::descriptor;
  using typename objects::points_type;
  using typename objects::user_keyframe, typename objects::user_point, typename objects::user_traits;
  /// @}

  /// Nothing is read. \param map  must outlive this
  explicit map_copy(Map& map) : objects(map) {}

  // ---- read what is not here ----

  /// Whether a keyframe is alive: it is read for it.
  bool alive(keyframe k) {
    if (!keyframes.known(k) || !keyframes.alive(k.index)) return false;
    ensure(k);
    return keyframes.alive(k.index);
  }
  /// Whether a point is alive: it is read for it.
  bool alive(point p) {
    if (!points.known(p) || !points.alive(p.index)) return false;
    ensure(p);
    return points.alive(p.index);
  }
  /// Slots and pose are here afterwards.
  void ensure(keyframe k) {
    if (keyframes[at(k)].read == 0) read_keyframe(at(k));
  }
  /// All of a point is here afterwards.
  void ensure(point p) {
    if (points.entries[at(p)].read == 0) read_point(at(p));
  }
  /// The pose.
  const rigid_transform<double>& pose(keyframe k) {
    ensure(k);
    if (keyframes[at(k)].pose_read == 0) read_pose(at(k), name(k));
    return keyframes[at(k)].T_cw;
  }
  /// Is to be read anew when it is next asked for.
  void forget(point p) {
    if (points.known(p)) points.entries[at(p)].read = 0;
  }
  /// Everything is to be read anew when it is next asked for.
  void forget_all() {
    forgotten_ = true;
    for (std::size_t p = 1; p < points.size(); ++p) points.entries[p].read = 0;
    for (std::size_t k = 1; k < keyframes.size(); ++k) keyframes[k].read = 0;
  }

  // ---- read a keyframe now ----

  /// Whether slots of points that are to be read anew, as was reported, count as not as they were last seen.
  enum class due_slots { count, do_not_count };
  /// Pose and slots. \return whether anything was not as it was last seen
  bool read_keyframe(std::size_t k, due_slots reported = due_slots::count) {
    if (static_cast<std::int32_t>(k) == gone || !keyframes.alive(static_cast<std::int32_t>(k))) return false;
    const user_keyframe name = keyframes[k].name;
    if (!user_traits::alive(map(), name)) {
      lose_keyframe(k);
      return true;
    }
    bool differs = read_pose(k, name);
    keypoints(k);
    keyframes[k].read = 0;  // until all of it is
    for (std::size_t i = 0; i < keyframes[k].slots.size(); ++i) differs = read_slot(k, i, name, reported) || differs;
    keyframes[k].read = 1;
    return differs;
  }
  /// The pose alone. \return whether it was not as it was last seen
  bool read_pose(std::size_t k, const user_keyframe& name) {
    const auto T = pose_of(map(), name);
    auto& old = keyframes[k].T_cw;
    const bool same = detail::is_as_before(T, old);
    old = T;
    keyframes[k].pose_read = 1;
    return !same;
  }
  /// One slot: points that came into it, or left it, are to be read anew. \return whether it was not as it was last seen
  bool read_slot(std::size_t k, std::size_t i, const user_keyframe& name, due_slots reported = due_slots::count) {
    const std::size_t known = points.size();
    const point now = number_in_slot(k, i, user_traits::point_at(map(), name, i));
    point& slot = keyframes[k].slots[i];
    const point before = slot;
    slot = now;
    if (now == before) return false;
    const bool due = is_due(before) || (at(now) < known && is_due(now));
    if (lists(before, k, i)) forget(before);
    if (!lists(now, k, i)) forget(now);
    return reported == due_slots::count || !due;
  }
  /// Reads pose and slots of a keyframe that tracking hands over: its points are observed by it. That is all that tracking is
  /// taken to have changed of points that have been read before. In parts, between which others may change the user's map.
  /// \param slot  the next one that is read, 0 at first  \param most  so much is read now: a slot is one, one with another point
  ///              than before four, and two keypoints are one
  /// \return whether some are left
  bool take_associations(keyframe k, std::size_t& slot, std::size_t most) {
    if (!keyframes.known(k) || !keyframes.alive(k.index)) return false;
    const user_keyframe name = keyframes[at(k)].name;
    if (!user_traits::alive(map(), name)) return lose_keyframe(at(k)), false;
    keyframes[at(k)].read = 0;  // until all of it is
    if (slot == 0) forgotten_ = false;
    read_pose(at(k), name);
    const bool first = !keyframes[at(k)].has_keypoints;
    const std::size_t slots = keypoints(at(k)).size();
    for (std::size_t done = first ? slots / 2 : 0; slot < slots && done < most;) {
      const std::size_t begin = slot, end = slots - slot < in_sight ? slots : slot + in_sight;
      std::array<user_point, in_sight> names{};
      look_ahead(at(k), begin, end, name, names.data());
      for (; slot < end && done < most; ++slot, ++done) {
        const point before = keyframes[at(k)].slots[slot], now = number_in_slot(at(k), slot, names[slot - begin]);
        if (now == before) continue;
        done += 3;
        const observation o{k.index, static_cast<std::int32_t>(slot)};
        if (points.known(now) && points.entries[at(now)].read != 0 && !lists(now, at(k), slot)) add_view(at(now), o);
        keyframes[at(k)].slots[slot] = now;
        if (points.known(before) && points.lists.erase(at(before), o)) count_octaves(at(before));
      }
    }
    if (slot < slots) return true;
    keyframes[at(k)].read = forgotten_ ? 0 : 1;  // 0: the parts before are of another time
    return false;
  }
  /// It is not alive in the user's map: its points are to be read anew.
  void lose_keyframe(std::size_t k) {
    for (const point p : keyframes[k].slots) forget(p);
    if (keyframes[k].read == 0) {  // its slots do not tell who lists it
      for (std::size_t p = 1; p < points.size(); ++p) {
        if (points.entries[p].read == 0) continue;  // after forget_all(), nearly all: their lists are read anew anyway
        for (const observation& o : points.lists.of(p))
          if (o.keyframe == static_cast<std::int32_t>(k)) points.entries[p].read = 0;
      }
    }
    keyframes.retire(k);
  }

  // ---- read a point now ----

  /// All of it.
  void read_point(std::size_t p) {
    if (static_cast<std::int32_t>(p) == gone || !points.alive(static_cast<std::int32_t>(p))) return;
    const user_point name = points.names[p];
    auto& entry = points.entries;
    entry[p].read = 0;  // until all of it is
    if (!user_traits::alive(map(), name)) return lose_point(p, number(resolve(map(), name)));
    read_position(p, name);
    points.normals[p] = user_traits::normal(map(), name);
    points.ranges[p] = {user_traits::min_distance(map(), name), user_traits::max_distance(map(), name)};
    if constexpr (points_type::has_covariances) points.covariances[p] = user_traits::covariance(map(), name);
    const auto& given = user_traits::descriptor_data(map(), name);
    const typename descriptor::element* const d = detail::elements_of<descriptor>(given);
    entry[p].described = d != nullptr;
    constexpr std::size_t elements = points_type::elements;
    for (std::size_t e = 0; d != nullptr && e < elements; ++e) points.descriptors[p * elements + e] = d[e];
    entry[p].reference = number(user_traits::reference(map(), name));
    read_list(p, name);
    entry[p].read = 1;
  }
  /// The position alone.
  void read_position(std::size_t p, const user_point& name) { points.positions[p] = position_of(map(), name); }
  /// The observations alone.
  void read_list(std::size_t p, const user_point& name) {
    const std::uint8_t read = points.entries[p].read;
    points.entries[p].read = 0;  // until all of it is
    scratch_.clear();
    keep_old_list(p);
    bool same = true;  // as it was last read, and in that order: mostly so
    user_traits::for_each_observation(map(), name, [&](const user_keyframe& observer, std::size_t keypoint) {
      const std::size_t n = scratch_.size();
      const keyframe k = number(observer, n < old_.size() ? keyframes.at(old_[n].keyframe) : keyframe{});
      const observation o{k.index < 0 ? gone : k.index, static_cast<std::int32_t>(keypoint)};
      same = same && n < old_.size() && o.keyframe == old_[n].keyframe && o.keypoint == old_[n].keypoint;
      scratch_.push_back(o);
    });
    if (same && read != 0 && scratch_.size() == old_.size()) {  // counted, and every slot agrees or is read anew
      points.entries[p].read = read;
      return;
    }
    for (const observation& o : scratch_)
      for (observation& before : old_)
        if (before.keyframe == o.keyframe && before.keypoint == o.keypoint) before.keyframe = gone;
    try {
      points.lists.close(p);
      points.lists.reserve(p, scratch_.size());
      for (const observation& o : scratch_) points.lists.add(p, o);
      count_octaves(p);
      for (const observation& o : old_) agree(o);
      for (const observation& o : scratch_) agree(o, points.at(static_cast<std::int32_t>(p)));
    } catch (...) {
      forget_slots_of_old_list();
      throw;
    }
    points.entries[p].read = read;
  }
  /// It is not alive in the user's map: `replacement`, or nothing, is there for it.
  void lose_point(std::size_t p, point replacement) {
    keep_old_list(p);
    points.retire(p, replacement);
    try {
      for (const observation& o : old_) agree(o);
    } catch (...) {
      forget_slots_of_old_list();
      throw;
    }
  }

 private:
  using objects::add_view, objects::count_octaves, objects::lists;
  static constexpr std::size_t in_sight = 16;  ///< slots that are read before the first of them is worked on

  void keep_old_list(std::size_t p) {
    old_.clear();
    for (const observation& o : points.lists.of(p)) old_.push_back(o);
  }
  void forget_slots_of_old_list() {
    for (const observation& o : old_) keyframes[static_cast<std::size_t>(o.keyframe)].read = 0;
  }
  /// Whether a point is to be read anew.
  bool is_due(point p) const { return points.known(p) && points.entries[at(p)].read == 0; }
  /// What a slot holds now. Most often what it held before: its name tells, and nothing has to be looked up. Names are never used
  /// again (working_map.hpp): an equal name is the same point.
  point number_in_slot(std::size_t k, std::size_t i, const user_point& now) {
    return is_in_slot(k, i, now) ? keyframes[k].slots[i] : number(now);
  }
  /// Whether the name is that of the point which the slot held before.
  bool is_in_slot(std::size_t k, std::size_t i, const user_point& now) const {
    const point before = keyframes[k].slots[i];
    return points.known(before) && points.alive(before.index) && points.names[at(before)] == now;
  }
  /// What the slots [begin, end) hold. Asks memory for the points that are new there, and for where they are looked up.
  void look_ahead(std::size_t k, std::size_t begin, std::size_t end, const user_keyframe& name, user_point* now) {
    for (std::size_t i = begin; i < end; ++i) {
      now[i - begin] = user_traits::point_at(map(), name, i);
      if (!is_in_slot(k, i, now[i - begin])) prefetch_named(now[i - begin]);
    }
    for (std::size_t i = begin; i < end; ++i)
      if (!(now[i - begin] == user_point{}) && !is_in_slot(k, i, now[i - begin]))
        points.prefetch_id(user_traits::id(map(), now[i - begin]));
  }
  /// Slots that have been read agree with the list of a point, or are read anew. \param expected  what the slot holds by the list
  void agree(const observation& o, point expected = {}) {
    const auto k = static_cast<std::size_t>(o.keyframe), i = static_cast<std::size_t>(o.keypoint);
    if (o.keyframe == gone || keyframes[k].read == 0 || i >= keyframes[k].slots.size()) return;
    if (keyframes[k].slots[i] == expected) return;
    const user_keyframe name = keyframes[k].name;
    if (user_traits::alive(map(), name))
      read_slot(k, i, name);
    else
      lose_keyframe(k);  // erased meanwhile: its slots may be no more
  }

  bool forgotten_ = false;                   ///< forget_all() came, since take_associations() began
  plain_vector<observation> scratch_, old_;  ///< observations of the list that is read, as they are and as they were
};

TURBOMAP_END_NAMESPACE

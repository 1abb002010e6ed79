// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a map_mirror has copied of the user's map: keyframes and points under numbers of its own, what never changes of a keyframe,
/// and what is counted of a point. When the rest is read is in map_copy.hpp.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../plain_vector.hpp"
#include "../types.hpp"
#include "finest_octaves.hpp"
#include "mirror_keyframes.hpp"
#include "mirror_points.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A map, and keyframes and points of it by number. A place that a member is given is one that was taken (not checked).
template <class Map>
class mirror_objects {
 public:
  /// @{
  /// Types of the user's map, as its traits name them; `keyframe` and `point` are the names of the copy.
  using user_traits = map_traits<Map>;
  using user_keyframe = typename user_traits::keyframe;
  using user_point = typename user_traits::point;
  using descriptor = typename user_traits::descriptor;
  using keyframe = map_keyframe_id;
  using point = map_point_id;
  /// @}
  static constexpr std::int32_t gone = 0;  ///< the place of what is not alive

  /// Nothing is copied. \param map  must outlive this
  explicit mirror_objects(Map& map) : map_(map) {}

  /// The user's map.
  Map& map() const { return map_; }
  /// The place of a name (not checked).
  template <class Name>
  static std::size_t at(const Name& name) {
    return static_cast<std::size_t>(name.index);
  }
  /// The number of what is named, which need not be read for it.
  keyframe number(const user_keyframe& name) {
    if (name == user_keyframe{}) return {};
    const std::int32_t known = keyframes.find(user_traits::id(map_, name));
    if (known != id_numbers::none && keyframes.alive(known) && keyframes[static_cast<std::size_t>(known)].name == name)
      return keyframes.at(known);
    if (!user_traits::alive(map_, name)) return keyframes.at(gone);
    return keyframes.at(keyframes.take(name, user_traits::id(map_, name)));
  }
  /// The same of a point; no name: none.
  point number(const user_point& name) {
    if (name == user_point{}) return {};
    const std::uint64_t id = user_traits::id(map_, name);
    const std::int32_t known = points.find(id);
    if (known != id_numbers::none && points.alive(known) && points.names[static_cast<std::size_t>(known)] == name)
      return points.at(known);
    if (!user_traits::alive(map_, name)) return points.at(gone);
    return points.at(points.take(name, id));
  }
  /// The same of a keyframe which is mostly `before`: then it is not looked up.
  keyframe number(const user_keyframe& name, keyframe before) {
    const bool same = keyframes.known(before) && keyframes.alive(before.index) && keyframes[at(before)].name == name &&
                      keyframes[at(before)].id == user_traits::id(map_, name);
    return same ? before : number(name);
  }
  /// Whether a keyframe is alive in the user's map and its slots are not here: nobody has asked for it yet, or it is to be read anew.
  bool is_unread(const user_keyframe& name) {
    if (name == user_keyframe{} || !user_traits::alive(map_, name)) return false;
    return keyframes[at(number(name))].read == 0;
  }
  /// Whether a point that is not alive was found so before, and its number is not free yet.
  bool knows_dead(const user_point& name) const {
    const std::int32_t known = points.find(user_traits::id(map_, name));
    return known != id_numbers::none && !points.alive(known) && points.names[static_cast<std::size_t>(known)] == name;
  }
  /// What the user calls a keyframe.
  const user_keyframe& name(keyframe k) const { return keyframes[k.index < 0 ? gone : at(k)].name; }
  /// What the user calls a point.
  const user_point& name(point p) const { return points.names[p.index < 0 ? gone : at(p)]; }

  /// The keypoints of a keyframe, which never change.
  const plain_vector<keypoint>& keypoints(std::size_t k) {
    auto& entry = keyframes[k];
    if (!entry.has_keypoints) {
      const std::size_t n = keypoint_count_of(map_, entry.name);
      entry.keypoints.resize(n);
      entry.slots.resize(n);
      for (std::size_t i = 0; i < n; ++i) {
        entry.keypoints[i] = keypoint_of(map_, entry.name, i), entry.slots[i] = point{};
        const std::size_t levels = entry.keypoints[i].octave + std::size_t{1};
        if (levels > points.levels()) points.more_levels(levels);
      }
      entry.has_keypoints = true;
    }
    return entry.keypoints;
  }
  /// measurement_count() of a point that has been read. It is kept, as most points are asked for several times.
  int measurements(std::size_t p) {
    if (points.entries[p].measurements < 0) {
      int count = 0;
      for (std::size_t v = 0; v < points.lists.of(p).size(); ++v) count += measurements_of(points.lists.of(p)[v]);
      points.entries[p].measurements = count;
    }
    return points.entries[p].measurements;
  }
  /// Of one observation.
  int measurements_of(const observation& o) {
    const auto& all = keypoints(static_cast<std::size_t>(o.keyframe));
    const auto i = static_cast<std::size_t>(o.keypoint);
    return i < all.size() && all[i].u_right >= 0 ? 2 : 1;
  }

  /// @{
  /// What was copied.
  using points_type = mirror_points<Map>;
  mirror_keyframes<Map> keyframes;
  points_type points;
  /// @}

 protected:
  /// Whether a point that has been read lists the keypoint.
  bool lists(point p, std::size_t k, std::size_t i) const {
    if (!points.known(p)) return false;
    for (const observation& o : points.lists.of(at(p)))
      if (o.keyframe == static_cast<std::int32_t>(k) && o.keypoint == static_cast<std::int32_t>(i)) return true;
    return false;
  }
  /// One more observation of a point that has been read. The keypoints of its keyframe are here.
  void add_view(std::size_t p, const observation& o) {
    int before = -1;  // the finest octave at which the keyframe saw it yet, by other cameras
    for (const observation& other : points.lists.of(p))
      if (other.keyframe == o.keyframe) before = detail::finer(before, octave_of(other));
    points.lists.add(p, o);
    if (points.entries[p].measurements >= 0) points.entries[p].measurements += measurements_of(o);
    const int after = detail::finer(before, octave_of(o));
    if (after == before) return;
    ++points.counts(p)[after];
    if (before >= 0) --points.counts(p)[before];
  }
  /// As recount().
  void count_octaves(std::size_t p) {
    const std::uint8_t read = points.entries[p].read;
    points.entries[p].read = 0;  // until all of it is
    points.entries[p].measurements = -1;
    measurements(p);  // keypoints are read, and levels known, from here on
    std::uint32_t* const counts = points.counts(p);
    for (std::size_t o = 0; o < points.levels(); ++o) counts[o] = 0;
    count_finest_octaves(
        points.lists.of(p), [this](const observation& o) { return octave_of(o); }, counts);
    points.entries[p].read = read;
  }
  /// -1 where there is no such keypoint.
  int octave_of(const observation& o) {
    if (o.keyframe == gone) return -1;
    const auto& all = keypoints(static_cast<std::size_t>(o.keyframe));
    return static_cast<std::size_t>(o.keypoint) < all.size() ? all[static_cast<std::size_t>(o.keypoint)].octave : -1;
  }

 private:
  Map& map_;
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// map_traits of a map_mirror: reads come from its arrays; writes go to the user's map through its traits, and to the arrays.
/// Longer than other headers: one short member for each that map_traits ask for.

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "../map/map_traits.hpp"
#include "../prefetch.hpp"
#include "map_mirror.hpp"

namespace turbomap {

/// A mirror as stages see it.
template <class Map>
struct map_traits<map_mirror<Map>> {
  /// @{
  /// As the member of this name of map_traits (map/map_traits.hpp): of the mirror, or of the user's map where it says so.
  using mirror = map_mirror<Map>;
  using user = map_traits<Map>;
  using keyframe = map_keyframe_id;
  using point = map_point_id;
  using descriptor = typename user::descriptor;
  using camera = typename user::camera;
  using element = typename descriptor::element;

  static auto guard(mirror& m) { return map_guard(m.map()); }

  // ---- keyframes ----

  static std::uint64_t id(const mirror& m, keyframe k) { return of(m, k).id; }
  static bool alive(const mirror& m, keyframe k) {
    if (!m.known(k) || !m.keyframe_places_.alive(k.index)) return false;
    m.ensure(k);
    return m.keyframe_places_.alive(k.index);
  }
  static rigid_transform<double> pose(const mirror& m, keyframe k) { return m.ensure_pose(k), of(m, k).T_cw; }
  static void set_pose(mirror& m, keyframe k, const rigid_transform<double>& T_cw) {
    user::set_pose(m.map(), m.name(k), T_cw);
    m.look_at_pose(m.at(k), m.name(k));  // as the user's map keeps it
  }
  static std::size_t keypoint_count(const mirror& m, keyframe k) { return m.keypoints(m.at(k)).size(); }
  // Of a keyframe that is gone nothing is kept, whoever lists it yet.
  static turbomap::keypoint keypoint(const mirror& m, keyframe k, std::size_t i) {
    const auto& all = m.keypoints(m.at(k));
    return i < all.size() ? all[i] : turbomap::keypoint{};
  }
  static point point_at(const mirror& m, keyframe k, std::size_t i) {
    m.ensure(k);
    return i < of(m, k).slots.size() ? of(m, k).slots[i] : point{};
  }
  static void set_point(mirror& m, keyframe k, std::size_t i, point p) {
    m.ensure(k);
    user::set_point(m.map(), m.name(k), i, m.name(p));
    if (i < of(m, k).slots.size()) of(m, k).slots[i] = p;
  }
  static void erase_keyframe(mirror& m, keyframe k) {
    user::erase_keyframe(m.map(), m.name(k));
    m.lose_keyframe(m.at(k));
    m.keyframe_places_.give_back(k.index);
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_may_erase_member>>>
  static bool may_erase(const map_mirror<M>& m, keyframe k) {
    return user::may_erase(m.map(), m.name(k));
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_origin_member>>>
  static bool is_origin(const map_mirror<M>& m, keyframe k) {
    return user::is_origin(m.map(), m.name(k));
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_temporal_member>>>
  static double time(const map_mirror<M>& m, keyframe k) {
    return static_cast<double>(user::time(m.map(), m.name(k)));
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_temporal_member>>>
  static keyframe previous(const map_mirror<M>& m, keyframe k) {
    return named(m, m.number(user::previous(m.map(), m.name(k))));
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_temporal_member>>>
  static keyframe next(const map_mirror<M>& m, keyframe k) {
    return named(m, m.number(user::next(m.map(), m.name(k))));
  }

  // ---- points ----

  static std::size_t index(const mirror& m, keyframe k) { return m.at(k); }
  static std::size_t index(const mirror& m, point p) { return m.at(p); }
  static std::uint64_t id(const mirror& m, point p) { return of(m, p).id; }
  static bool alive(const mirror& m, point p) {
    if (!m.known(p) || !m.point_places_.alive(p.index)) return false;
    m.ensure(p);
    return m.point_places_.alive(p.index);
  }
  static point replacement(const mirror& m, point p) { return m.known(p) ? of(m, p).replacement : point{}; }
  static vec3<double> position(const mirror& m, point p) { return m.ensure(p), m.positions_[m.at(p)]; }
  static void set_position(mirror& m, point p, const vec3<double>& x) {
    user::set_position(m.map(), m.name(p), x);
    m.read_position(m.at(p), m.name(p));  // as the user's map keeps it
  }
  static vec3<float> normal(const mirror& m, point p) { return m.ensure(p), m.normals_[m.at(p)]; }
  static float min_distance(const mirror& m, point p) { return m.ensure(p), m.ranges_[m.at(p)].min; }
  static float max_distance(const mirror& m, point p) { return m.ensure(p), m.ranges_[m.at(p)].max; }
  static const element* descriptor_data(const mirror& m, point p) {
    m.ensure(p);
    return of(m, p).described ? m.descriptors_.data() + m.at(p) * mirror::elements : nullptr;
  }
  static void set_appearance(mirror& m, point p, const vec3<float>& normal, float min, float max, const element* d) {
    const std::size_t i = m.at(p);
    user::set_appearance(m.map(), m.name(p), normal, min, max, d);
    m.normals_[i] = normal, m.ranges_[i] = {min, max};
    of(m, p).described = true;
    element* const own = m.descriptors_.data() + i * mirror::elements;
    for (std::size_t e = 0; e < mirror::elements; ++e) own[e] = d[e];
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_covariance_member>>>
  static point_covariance covariance(const map_mirror<M>& m, point p) {
    return m.ensure(p), m.covariances_[m.at(p)];
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_covariance_member>>>
  static void set_covariance(map_mirror<M>& m, point p, const point_covariance& c) {
    user::set_covariance(m.map(), m.name(p), c);
    m.covariances_[m.at(p)] = c;
  }
  static keyframe reference(const mirror& m, point p) { return m.ensure(p), of(m, p).reference; }
  static void set_reference(mirror& m, point p, keyframe k) {
    user::set_reference(m.map(), m.name(p), m.name(k));
    of(m, p).reference = k;
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_found_member>>>
  static float found_ratio(const map_mirror<M>& m, point p) {
    return static_cast<float>(user::found_ratio(m.map(), m.name(p)));
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_created_member>>>
  static void created(map_mirror<M>& m, point p) {
    user::created(m.map(), m.name(p));
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_merged_member>>>
  static void merged(map_mirror<M>& m, point from, point into) {
    user::merged(m.map(), m.name(from), m.name(into));
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_erased_member>>>
  static void erased(map_mirror<M>& m, point p) {
    user::erased(m.map(), m.name(p));
  }
  static span<const std::uint32_t> octave_counts(const mirror& m, point p) {
    m.ensure(p);
    std::size_t levels = m.levels_;
    if constexpr (mirror::counted_by_user) {  // no more than the user's map can count
      const std::size_t kept = user::octave_counts(m.map(), m.name(p)).size();
      levels = kept < levels ? kept : levels;
    }
    return {m.counts_.data() + m.at(p) * m.levels_, levels};
  }
  static void change_octave_count(mirror& m, point p, int octave, int change) {
    if constexpr (mirror::counted_by_user) user::change_octave_count(m.map(), m.name(p), octave, change);
    m.counts_[m.at(p) * m.levels_ + static_cast<std::size_t>(octave)] += static_cast<std::uint32_t>(change);
  }
  static void prefetch(const mirror& m, point p, unsigned what) {
    const std::size_t i = m.at(p);
    if (i >= m.points_.size()) return;  // none, or of another map
    const auto wants = [what](point_data d) { return (what & static_cast<unsigned>(d)) != 0; };
    if (wants(point_data::entry)) {
      m.point_places_.prefetch(p.index), m.lists_.prefetch_place(i);
      prefetch_line(&m.positions_[i]), prefetch_line(&m.points_[i]);
    }
    if (wants(point_data::views)) m.lists_.prefetch(i);
    if (wants(point_data::appearance)) {
      prefetch_line(&m.normals_[i]), prefetch_line(&m.ranges_[i]);
      prefetch_line(m.descriptors_.data() + i * mirror::elements);
    }
  }
  template <class F>
  static void for_each_observation(const mirror& m, point p, F f) {
    m.ensure(p);
    for (std::size_t n = 0; n < m.lists_.of(m.at(p)).size(); ++n) {  // f may read, and so move, lists
      const observation o = m.lists_.of(m.at(p))[n];
      f(m.keyframe_at(o.keyframe), static_cast<std::size_t>(o.keypoint));
    }
  }
  static point add_point(mirror& m, const vec3<double>& x, keyframe reference) {
    m.grow_points();
    const auto name = user::add_point(m.map(), x, m.name(reference));
    std::int32_t place = 0;
    try {
      place = m.take_point(name, user::id(m.map(), name));
    } catch (...) {
      user::retire(m.map(), name, {});
      throw;
    }
    const point p = m.point_at(place);
    auto& entry = of(m, p);
    entry.read = 1, entry.reference = reference;  // described by set_appearance() only
    m.read_position(m.at(p), name);
    m.normals_[m.at(p)] = {}, m.ranges_[m.at(p)] = {};
    if constexpr (mirror::has_covariances) m.covariances_[m.at(p)] = user::covariance(m.map(), name);
    return p;
  }
  static void reserve_observations(mirror& m, point p, std::size_t more) {
    m.lists_.reserve(m.at(p), more);
    if constexpr (detail::map_has_v<Map, detail::map_reserve_member>)
      user::reserve_observations(m.map(), m.name(p), more);
  }
  static void add_observation(mirror& m, point p, keyframe k, std::size_t i) {
    m.lists_.reserve(m.at(p), 1);
    user::add_observation(m.map(), m.name(p), m.name(k), i);
    m.lists_.add(m.at(p), {k.index, static_cast<std::int32_t>(i)});
  }
  static void erase_observation(mirror& m, point p, keyframe k, std::size_t i) {
    user::erase_observation(m.map(), m.name(p), m.name(k), i);
    m.lists_.erase(m.at(p), {k.index, static_cast<std::int32_t>(i)});
  }
  static void retire(mirror& m, point p, point replacement) {
    user::retire(m.map(), m.name(p), m.name(replacement));
    m.lists_.close(m.at(p));
    m.lose_point(m.at(p), replacement);
  }
  /// @}

  // ---- look_again.hpp ----

  /// Reads again what decides about a point in a commit: whether it is alive, its reference, its observations.
  static void look_again(const mirror& m, point p) {
    if (!m.known(p) || !m.point_places_.alive(p.index)) return;
    if (of(m, p).read == 0 || !user::alive(m.map(), m.name(p)))
      m.read_point(m.at(p));
    else {
      const auto name = m.name(p);
      of(m, p).reference = m.number(user::reference(m.map(), name));
      m.read_list(m.at(p), name);  // nothing else decides in a commit
    }
    for (std::size_t n = 0; n < m.lists_.of(m.at(p)).size(); ++n) {
      const observation o = m.lists_.of(m.at(p))[n];
      look_again(m, m.keyframe_at(o.keyframe), static_cast<std::size_t>(o.keypoint));
    }
    m.ensure(p);
  }
  /// Reads again whether a keyframe is alive, and its pose.
  static void look_again(const mirror& m, keyframe k) {
    if (!m.known(k) || !m.keyframe_places_.alive(k.index)) return;
    const auto name = m.name(k);
    if (!user::alive(m.map(), name)) return m.lose_keyframe(m.at(k));
    m.look_at_pose(m.at(k), name);
  }
  /// Reads again whether a keyframe is alive, and one of its slots.
  static void look_again(const mirror& m, keyframe k, std::size_t i) {
    if (!m.known(k) || !m.keyframe_places_.alive(k.index)) return;
    m.ensure(k);
    if (i >= of(m, k).slots.size()) return;
    const auto name = m.name(k);
    if (!user::alive(m.map(), name)) return m.lose_keyframe(m.at(k));
    m.read_slot(m.at(k), i, name);
  }
  /// Everything is read again when it is next asked for.
  static void forget_copy(const mirror& m) { m.forget_all(); }
  /// Reads again whether a point is alive.
  static void look_whether_alive(const mirror& m, point p) {
    if (!m.known(p) || !m.point_places_.alive(p.index)) return;
    if (!user::alive(m.map(), m.name(p))) m.read_point(m.at(p));
  }
  /// Reads again whether a point is alive, and its position.
  static void look_at_position(const mirror& m, point p) {
    if (!m.known(p) || !m.point_places_.alive(p.index)) return;
    const auto name = m.name(p);
    if (!user::alive(m.map(), name))
      m.read_point(m.at(p));
    else
      m.read_position(m.at(p), name);
  }
  /// Points that keep more than `fewest` measurements without the keyframe, and their reference, only lose a view: that their slot
  /// holds them is enough. The others are read anew.
  static bool look_at_all(const mirror& m, keyframe k, int fewest) {
    if (!m.known(k)) return false;
    bool differs = m.read_keyframe(m.at(k));
    for (std::size_t i = 0; i < of(m, k).slots.size(); ++i) {
      const point p = of(m, k).slots[i];
      if (!m.known(p) || !m.point_places_.alive(p.index)) continue;
      const auto name = m.name(p);
      if (of(m, p).read != 0 && user::alive(m.map(), name) && !(user::reference(m.map(), name) == m.name(k)) &&
          m.measurements_without(m.at(p), k.index) > fewest)
        continue;
      if (of(m, p).read != 0 && m.is_current(m.at(p))) continue;
      differs = true;
      m.read_point(m.at(p));
    }
    return differs;
  }

 private:
  /// A keyframe that is not in the map has no name, by which its neighbours in time could be asked for: time ends there.
  static keyframe named(const mirror& m, keyframe k) { return m.known(k) ? k : keyframe{}; }
  static auto& of(const mirror& m, keyframe k) { return m.keyframes_[m.at(k)]; }
  static auto& of(const mirror& m, point p) { return m.points_[m.at(p)]; }
};

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// map_traits of a map_mirror (map_mirror.hpp, which includes this): reads come from its arrays; writes go to the user's map through
/// its traits, and to the arrays. One short member for each that map_traits ask for.

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../map/observation_counts.hpp"
#include "../prefetch.hpp"
#include "map_copy.hpp"
#include "mirror_look_again.hpp"

TURBOMAP_BEGIN_NAMESPACE

template <class Map>
class map_mirror;

TURBOMAP_END_NAMESPACE

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
  /// For observation_counts.hpp.
  static constexpr bool users_counts = counts_octaves_v<Map>;

  static auto guard(mirror& m) { return map_guard(m.map()); }

  // ---- keyframes ----

  static std::uint64_t id(const mirror& m, keyframe k) { return of(m, k).id; }
  static bool alive(const mirror& m, keyframe k) { return m.copy().alive(k); }
  static rigid_transform<double> pose(const mirror& m, keyframe k) { return m.copy().pose(k); }
  static void set_pose(mirror& m, keyframe k, const rigid_transform<double>& T_cw) {
    user::set_pose(m.map(), m.name(k), T_cw);
    m.copy().read_pose(at(k), m.name(k));  // as the user's map keeps it
  }
  static std::size_t keypoint_count(const mirror& m, keyframe k) { return m.copy().keypoints(at(k)).size(); }
  // Of a keyframe that is gone nothing is kept, whoever lists it yet.
  static turbomap::keypoint keypoint(const mirror& m, keyframe k, std::size_t i) {
    const auto& all = m.copy().keypoints(at(k));
    return i < all.size() ? all[i] : turbomap::keypoint{};
  }
  static point point_at(const mirror& m, keyframe k, std::size_t i) {
    m.copy().ensure(k);
    return i < of(m, k).slots.size() ? of(m, k).slots[i] : point{};
  }
  static void set_point(mirror& m, keyframe k, std::size_t i, point p) {
    const point before = point_at(m, k, i);
    try {
      user::set_point(m.map(), m.name(k), i, m.name(p));
    } catch (...) {
      // Edits change a list, its slot, then its counts: the counts of both points may be left behind.
      m.copy().forget(before), m.copy().forget(p);
      of(m, k).read = 0;
      throw;
    }
    if (i < of(m, k).slots.size()) of(m, k).slots[i] = p;
  }
  static void erase_keyframe(mirror& m, keyframe k) {
    user::erase_keyframe(m.map(), m.name(k));
    m.copy().lose_keyframe(at(k));
    m.copy().keyframes.give_back(k.index);
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

  static std::size_t index(const mirror&, keyframe k) { return at(k); }
  static std::size_t index(const mirror&, point p) { return at(p); }
  static std::uint64_t id(const mirror& m, point p) { return of(m, p).id; }
  static bool alive(const mirror& m, point p) { return m.copy().alive(p); }
  static point replacement(const mirror& m, point p) { return points(m).known(p) ? of(m, p).replacement : point{}; }
  static vec3<double> position(const mirror& m, point p) { return m.copy().ensure(p), points(m).positions[at(p)]; }
  static void set_position(mirror& m, point p, const vec3<double>& x) {
    user::set_position(m.map(), m.name(p), x);
    m.copy().read_position(at(p), m.name(p));  // as the user's map keeps it
  }
  static vec3<float> normal(const mirror& m, point p) { return m.copy().ensure(p), points(m).normals[at(p)]; }
  static float min_distance(const mirror& m, point p) { return m.copy().ensure(p), points(m).ranges[at(p)].min; }
  static float max_distance(const mirror& m, point p) { return m.copy().ensure(p), points(m).ranges[at(p)].max; }
  static const element* descriptor_data(const mirror& m, point p) {
    m.copy().ensure(p);
    return of(m, p).described ? points(m).descriptors.data() + at(p) * elements : nullptr;
  }
  static void set_appearance(mirror& m, point p, const vec3<float>& normal, float min, float max, const element* d) {
    const std::size_t i = at(p);
    user::set_appearance(m.map(), m.name(p), normal, min, max, d);
    points(m).normals[i] = normal, points(m).ranges[i] = {min, max};
    of(m, p).described = true;
    element* const own = points(m).descriptors.data() + i * elements;
    for (std::size_t e = 0; e < elements; ++e) own[e] = d[e];
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_covariance_member>>>
  static point_covariance covariance(const map_mirror<M>& m, point p) {
    return m.copy().ensure(p), points(m).covariances[at(p)];
  }
  template <class M = Map, class = std::enable_if_t<detail::map_has_v<M, detail::map_covariance_member>>>
  static void set_covariance(map_mirror<M>& m, point p, const point_covariance& c) {
    user::set_covariance(m.map(), m.name(p), c);
    points(m).covariances[at(p)] = c;
  }
  static keyframe reference(const mirror& m, point p) { return m.copy().ensure(p), of(m, p).reference; }
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
    m.copy().ensure(p);
    std::size_t levels = points(m).levels();
    if constexpr (counts_octaves_v<Map>) {  // no more than the user's map can count
      const std::size_t kept = user::octave_counts(m.map(), m.name(p)).size();
      levels = kept < levels ? kept : levels;
    }
    return {points(m).counts(at(p)), levels};
  }
  static void change_octave_count(mirror& m, point p, int octave, int change) {
    if constexpr (counts_octaves_v<Map>) {
      try {
        user::change_octave_count(m.map(), m.name(p), octave, change);
      } catch (...) {
        m.copy().forget(p);
        throw;
      }
    }
    points(m).counts(at(p))[octave] += static_cast<std::uint32_t>(change);
  }
  static void prefetch(const mirror& m, point p, unsigned what) {
    const std::size_t i = at(p);
    if (i >= points(m).size()) return;  // none, or of another map
    const auto wants = [what](point_data d) { return (what & static_cast<unsigned>(d)) != 0; };
    if (wants(point_data::entry)) {
      points(m).prefetch(p.index), points(m).lists.prefetch_place(i);
      prefetch_line(&points(m).positions[i]), prefetch_line(&points(m).entries[i]);
    }
    if (wants(point_data::views)) points(m).lists.prefetch(i);
    if (wants(point_data::octaves)) prefetch_line(points(m).counts(i));
    if (wants(point_data::appearance)) {
      prefetch_line(&points(m).normals[i]), prefetch_line(&points(m).ranges[i]);
      prefetch_line(points(m).descriptors.data() + i * elements);
    }
  }
  template <class F>
  static void for_each_observation(const mirror& m, point p, F f) {
    m.copy().ensure(p);
    for (std::size_t n = 0; n < points(m).lists.of(at(p)).size(); ++n) {  // f may read, and so move, lists
      const observation o = points(m).lists.of(at(p))[n];
      f(m.copy().keyframes.at(o.keyframe), static_cast<std::size_t>(o.keypoint));
    }
  }
  /// For observation_counts.hpp.
  static int kept_measurements(const mirror& m, point p) { return m.copy().ensure(p), m.copy().measurements(at(p)); }
  static point add_point(mirror& m, const vec3<double>& x, keyframe reference) {
    points(m).grow();
    const auto name = user::add_point(m.map(), x, m.name(reference));
    std::int32_t place = 0;
    try {
      place = points(m).take(name, user::id(m.map(), name));
    } catch (...) {
      user::retire(m.map(), name, {});
      throw;
    }
    const point p = points(m).at(place);
    auto& entry = of(m, p);
    entry.read = 1, entry.reference = reference, entry.measurements = 0;  // described by set_appearance() only
    m.copy().read_position(at(p), name);
    points(m).normals[at(p)] = {}, points(m).ranges[at(p)] = {};
    if constexpr (mirror_points<Map>::has_covariances) points(m).covariances[at(p)] = user::covariance(m.map(), name);
    return p;
  }
  static void reserve_observations(mirror& m, point p, std::size_t more) {
    points(m).lists.reserve(at(p), more);
    if constexpr (detail::map_has_v<Map, detail::map_reserve_member>)
      user::reserve_observations(m.map(), m.name(p), more);
  }
  static void add_observation(mirror& m, point p, keyframe k, std::size_t i) {
    points(m).lists.reserve(at(p), 1);
    const observation o{k.index, static_cast<std::int32_t>(i)};
    const int more = of(m, p).measurements >= 0 ? m.copy().measurements_of(o) : 0;  // may read, so throw
    user::add_observation(m.map(), m.name(p), m.name(k), i);
    points(m).lists.add(at(p), o);
    if (of(m, p).measurements >= 0) of(m, p).measurements += more;
  }
  static void erase_observation(mirror& m, point p, keyframe k, std::size_t i) {
    user::erase_observation(m.map(), m.name(p), m.name(k), i);
    of(m, p).measurements = -1;  // mostly more follow, or nobody asks again
    points(m).lists.erase(at(p), {k.index, static_cast<std::int32_t>(i)});
  }
  static void retire(mirror& m, point p, point replacement) {
    user::retire(m.map(), m.name(p), m.name(replacement));
    points(m).lists.close(at(p));
    m.copy().lose_point(at(p), replacement);
  }

  /// @}

  /// @{
  /// See look_again.hpp.
  static void look_at_list(const mirror& m, point p) { detail::look_at_list(m.copy(), p); }
  static void look_at_slots_of(const mirror& m, point p, plain_vector<keyframe>& alive) {
    detail::look_at_slots_of(m.copy(), p, alive);
  }
  static void look_again(const mirror& m, keyframe k) { detail::look_at_keyframe(m.copy(), k); }
  static void look_again(const mirror& m, keyframe k, std::size_t i) { detail::look_at_slot(m.copy(), k, i); }
  static void look_at_live_slot(const mirror& m, keyframe k, std::size_t i) {
    detail::look_at_live_slot(m.copy(), k, i);
  }
  static void forget_copy(const mirror& m) { m.copy().forget_all(); }
  static void hear_refresh(const mirror& m) { m.hear_refresh(); }
  static void look_whether_alive(const mirror& m, point p) { detail::look_whether_alive(m.copy(), p); }
  static void look_before_erasing(const mirror& m, point p, plain_vector<keyframe>& alive) {
    detail::look_before_erasing(m.copy(), p, alive);
  }
  static void ask_for_state(const mirror& m, point p) { detail::ask_for_state(m.copy(), p); }
  static void ask_for(const mirror& m, point p) { detail::ask_for(m.copy(), p); }
  static void ask_for(const mirror& m, keyframe k, std::size_t i) { detail::ask_for(m.copy(), k, i); }
  static void ask_for_slots(const mirror& m, point p) { detail::ask_for_slots(m.copy(), p); }
  static void expect_points(const mirror& m, std::size_t count) { points(m).expect(count); }
  static void look_at_position(const mirror& m, point p) { detail::look_at_position(m.copy(), p); }
  static bool look_at_all(const mirror& m, keyframe k, int fewest) { return detail::look_at_all(m.copy(), k, fewest); }
  static void look_at_slots(const mirror& m, keyframe k) { m.read_again(k); }
  static void look_at_points(const mirror& m, keyframe k, int fewest, std::size_t begin, std::size_t end) {
    detail::look_at_points(m.copy(), k, fewest, begin, end);
  }
  /// @}

 private:
  /// A keyframe that is not in the map has no name, by which its neighbours in time could be asked for: time ends there.
  static keyframe named(const mirror& m, keyframe k) { return m.copy().keyframes.known(k) ? k : keyframe{}; }
  static std::size_t at(keyframe k) { return map_copy<Map>::at(k); }
  static std::size_t at(point p) { return map_copy<Map>::at(p); }
  static mirror_points<Map>& points(const mirror& m) { return m.copy().points; }
  static auto& of(const mirror& m, keyframe k) { return m.copy().keyframes[at(k)]; }
  static auto& of(const mirror& m, point p) { return points(m).entries[at(p)]; }

  static constexpr std::size_t elements = mirror_points<Map>::elements;  ///< of a descriptor
};

}  // namespace turbomap

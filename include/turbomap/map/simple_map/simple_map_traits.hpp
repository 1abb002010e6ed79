// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// map_traits of a simple_map: how the library reads and changes it. Also an example of traits of a map in flat arrays.

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "../../prefetch.hpp"
#include "../../span.hpp"
#include "../../types.hpp"
#include "../map_traits.hpp"
#include "simple_map.hpp"

namespace turbomap {

/// A simple_map as algorithms see it. Ids are not checked here: algorithms pass on what the map gave them.
template <class Descriptor, class Camera>
struct map_traits<simple_map<Descriptor, Camera>> {
  /// @{
  /// As the member of this name of map_traits (map/map_traits.hpp).
  using map = simple_map<Descriptor, Camera>;
  using keyframe = map_keyframe_id;
  using point = map_point_id;
  using descriptor = Descriptor;
  using camera = Camera;
  using element = typename Descriptor::element;

  /// Of an erased keyframe its own, or one that no keyframe has once its place is used again: never that of another keyframe,
  /// which local_mapper::remove() would take out of the store.
  static std::uint64_t id(const map& m, keyframe k) {
    const auto& entry = of(m, k);
    return entry.generation == k.generation ? entry.id : map::no_id;
  }
  static bool alive(const map& m, keyframe k) { return m.alive(k); }
  static const rigid_transform<double>& pose(const map& m, keyframe k) { return of(m, k).T_cw; }
  static void set_pose(map& m, keyframe k, const rigid_transform<double>& T_cw) { of(m, k).T_cw = T_cw; }
  static std::size_t keypoint_count(const map& m, keyframe k) { return of(m, k).keypoints.size(); }
  static const turbomap::keypoint& keypoint(const map& m, keyframe k, std::size_t i) { return of(m, k).keypoints[i]; }
  static point point_at(const map& m, keyframe k, std::size_t i) { return of(m, k).slots[i]; }
  static void set_point(map& m, keyframe k, std::size_t i, point p) { of(m, k).slots[i] = p; }
  static double time(const map& m, keyframe k) { return of(m, k).time_s; }
  static keyframe previous(const map& m, keyframe k) { return m.keyframe_or_none(of(m, k).previous); }
  static keyframe next(const map& m, keyframe k) { return m.keyframe_or_none(of(m, k).next); }
  /// The first keyframe of a map holds its frame of reference.
  static bool may_erase(const map& m, keyframe k) { return of(m, k).id != 0; }
  static bool is_origin(const map& m, keyframe k) { return of(m, k).id == 0; }
  static void erase_keyframe(map& m, keyframe k) {
    auto& entry = of(m, k);
    m.link(entry.previous, entry.next);
    const std::uint64_t id = entry.id;
    entry = {};
    entry.id = id, entry.generation = k.generation;
    m.keyframe_places_.give_back(k.index);
  }

  static std::size_t index(const map&, keyframe k) { return static_cast<std::size_t>(k.index); }
  static std::size_t index(const map&, point p) { return at(p); }
  static std::uint64_t id(const map& m, point p) { return m.points_[at(p)].id; }
  static bool alive(const map& m, point p) { return m.alive(p); }
  static point replacement(const map& m, point p) {
    return m.point_places_.known(p.index, p.generation) ? m.points_[at(p)].replacement : point{};
  }
  static const vec3<double>& position(const map& m, point p) { return m.positions_[at(p)]; }
  static void set_position(map& m, point p, const vec3<double>& position) { m.positions_[at(p)] = position; }
  static const vec3<float>& normal(const map& m, point p) { return m.normals_[at(p)]; }
  static float min_distance(const map& m, point p) { return m.ranges_[at(p)].min; }
  static float max_distance(const map& m, point p) { return m.ranges_[at(p)].max; }
  static const element* descriptor_data(const map& m, point p) { return m.descriptors_.data() + at(p) * map::elements; }
  static const point_covariance& covariance(const map& m, point p) { return m.covariances_[at(p)]; }
  static void set_covariance(map& m, point p, const point_covariance& c) { m.covariances_[at(p)] = c; }
  static keyframe reference(const map& m, point p) { return m.points_[at(p)].reference; }
  static void set_reference(map& m, point p, keyframe k) { m.points_[at(p)].reference = k; }
  static void set_appearance(map& m, point p, const vec3<float>& normal, float min, float max, const element* d) {
    m.normals_[at(p)] = normal;
    m.ranges_[at(p)] = {min, max};
    element* own = m.descriptors_.data() + at(p) * map::elements;
    if (d != own) std::copy_n(d, map::elements, own);
  }
  static point add_point(map& m, const vec3<double>& position, keyframe reference) {
    return m.add_point(position, reference);
  }
  static void prefetch(const map& m, point p, unsigned what) {
    const std::size_t i = at(p);
    if (i >= m.points_.size()) return;  // none, or of another map
    const auto wants = [what](point_data d) { return (what & static_cast<unsigned>(d)) != 0; };
    if (wants(point_data::entry)) {
      m.point_places_.prefetch(p.index), m.observations_.prefetch_place(i);
      prefetch_line(&m.positions_[i]), prefetch_line(&m.points_[i]);
    }
    if (wants(point_data::views)) m.observations_.prefetch(i);
    if (wants(point_data::octaves)) prefetch_line(m.counts_.data() + i * m.levels_);
    if (wants(point_data::appearance)) {
      prefetch_line(&m.normals_[i]), prefetch_line(&m.ranges_[i]);
      prefetch_line(m.descriptors_.data() + i * map::elements);
    }
  }
  template <class F>
  static void for_each_observation(const map& m, point p, F f) {
    for (const observation& o : m.observations_.of(at(p)))
      f(m.keyframe_at(o.keyframe), static_cast<std::size_t>(o.keypoint));
  }
  static void reserve_observations(map& m, point p, std::size_t more) { m.observations_.reserve(at(p), more); }
  static void add_observation(map& m, point p, keyframe k, std::size_t i) {
    m.observations_.add(at(p), {k.index, static_cast<std::int32_t>(i)});
  }
  static void erase_observation(map& m, point p, keyframe k, std::size_t i) {
    m.observations_.erase(at(p), {k.index, static_cast<std::int32_t>(i)});
  }
  static void retire(map& m, point p, point replacement) {
    m.observations_.close(at(p));
    auto& entry = m.points_[at(p)];
    entry.replacement = replacement;
    if (replacement == point{}) {
      m.point_places_.give_back(p.index);
    } else {
      m.point_places_.retire(p.index);
      m.points_[at(replacement)].visible += entry.visible;
      m.points_[at(replacement)].found += entry.found;
    }
  }
  static span<const std::uint32_t> octave_counts(const map& m, point p) {
    return {m.counts_.data() + at(p) * m.levels_, m.levels_};
  }
  static void change_octave_count(map& m, point p, int octave, int change) {
    m.counts_[at(p) * m.levels_ + static_cast<std::size_t>(octave)] += static_cast<std::uint32_t>(change);
  }
  static float found_ratio(const map& m, point p) {
    const auto& entry = m.points_[at(p)];
    return static_cast<float>(entry.found) / static_cast<float>(entry.visible);
  }
  template <class F>
  static void for_each_keyframe(const map& m, F f) {
    for (std::size_t k = 0; k < m.keyframes_.size(); ++k)
      if (m.keyframe_places_.alive(static_cast<std::int32_t>(k))) f(m.keyframe_at(static_cast<std::int32_t>(k)));
  }
  template <class F>
  static void for_each_point(const map& m, F f) {
    for (std::size_t p = 0; p < m.points_.size(); ++p)
      if (m.point_places_.alive(static_cast<std::int32_t>(p))) f(m.point_at_place(static_cast<std::int32_t>(p)));
  }
  /// @}

 private:
  static std::size_t at(point p) { return static_cast<std::size_t>(p.index); }
  static auto& of(map& m, keyframe k) { return m.keyframes_[static_cast<std::size_t>(k.index)]; }
  static const auto& of(const map& m, keyframe k) { return m.keyframes_[static_cast<std::size_t>(k.index)]; }
};

}  // namespace turbomap

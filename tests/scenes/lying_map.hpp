// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A map whose traits can be told to lie, for tests of validate() and of what commits refuse. Writes go to the true
/// map.

#include <turbomap/map/map_traits.hpp>

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "map_scene.hpp"

namespace turbomap_test {

/// A simple_map, and what its traits say instead.
struct lying_map : flat_map {
  using flat_map::flat_map;
  using view = std::pair<std::int32_t, std::size_t>;  ///< index of the keyframe, keypoint

  std::map<view, turbomap::map_point_id> slots;  ///< what a slot holds
  std::multimap<std::int32_t, std::pair<turbomap::map_keyframe_id, std::size_t>>
      invented;                                          ///< further views of a point
  std::map<std::pair<std::int32_t, view>, bool> hidden;  ///< views that are not told
  std::map<std::int32_t, std::vector<std::uint32_t>> counts;
  std::set<std::int32_t> bare;  ///< points of which no descriptor is told
  mutable int writes = 0;

  void tell_the_truth() { slots.clear(), invented.clear(), hidden.clear(), counts.clear(), bare.clear(); }
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::lying_map> : turbomap::map_traits<turbomap_test::flat_map> {
  using map = turbomap_test::lying_map;
  using base = turbomap::map_traits<turbomap_test::flat_map>;

  static point point_at(const map& m, keyframe k, std::size_t i) {
    const auto lie = m.slots.find({k.index, i});
    return lie == m.slots.end() ? base::point_at(m, k, i) : lie->second;
  }
  template <class F>
  static void for_each_observation(const map& m, point p, F f) {
    base::for_each_observation(m, p, [&](keyframe k, std::size_t i) {
      if (m.hidden.count({p.index, {k.index, i}}) == 0) f(k, i);
    });
    const auto [begin, end] = m.invented.equal_range(p.index);
    for (auto at = begin; at != end; ++at) f(at->second.first, at->second.second);
  }
  static const element* descriptor_data(const map& m, point p) {
    return m.bare.count(p.index) != 0 ? nullptr : base::descriptor_data(m, p);
  }
  static turbomap::span<const std::uint32_t> octave_counts(const map& m, point p) {
    const auto lie = m.counts.find(p.index);
    return lie == m.counts.end() ? base::octave_counts(m, p) : turbomap::span<const std::uint32_t>(lie->second);
  }

  static point add_point(map& m, const turbomap::vec3<double>& x, keyframe k) {
    return ++m.writes, base::add_point(m, x, k);
  }
  static void set_reference(map& m, point p, keyframe k) { ++m.writes, base::set_reference(m, p, k); }
  static void set_point(map& m, keyframe k, std::size_t i, point p) { ++m.writes, base::set_point(m, k, i, p); }
  static void add_observation(map& m, point p, keyframe k, std::size_t i) {
    ++m.writes, base::add_observation(m, p, k, i);
  }
  static void erase_observation(map& m, point p, keyframe k, std::size_t i) {
    ++m.writes, base::erase_observation(m, p, k, i);
  }
  static void retire(map& m, point p, point replacement) { ++m.writes, base::retire(m, p, replacement); }
  static void erase_keyframe(map& m, keyframe k) { ++m.writes, base::erase_keyframe(m, k); }
  static void change_octave_count(map& m, point p, int octave, int change) {
    ++m.writes, base::change_octave_count(m, p, octave, change);
  }
};

namespace turbomap_test {

/// All that the traits of a map tell, as text: two maps are the same when it is.
template <class Map>
std::string everything(const Map& map) {
  using traits = turbomap::map_traits<Map>;
  std::ostringstream text;
  const auto id = [&](auto name) {
    return name == decltype(name){} ? std::string("-") : std::to_string(traits::id(map, name));
  };
  traits::for_each_keyframe(map, [&](typename traits::keyframe k) {
    const auto& T = traits::pose(map, k);
    text << "K" << id(k) << ' ' << T.tx << ' ' << id(traits::previous(map, k)) << ' ' << id(traits::next(map, k))
         << ':';
    for (std::size_t i = 0; i < traits::keypoint_count(map, k); ++i) text << ' ' << traits::point_at(map, k, i).index;
    text << '\n';
  });
  traits::for_each_point(map, [&](typename traits::point p) {
    text << "P" << id(p) << ' ' << traits::position(map, p).x << ' ' << traits::reference(map, p).index << ' '
         << traits::found_ratio(map, p) << " [";
    for (const auto n : traits::octave_counts(map, p)) text << n << ' ';
    text << "]";
    traits::for_each_observation(map, p, [&](typename traits::keyframe k, std::size_t i) {
      text << ' ' << k.index << '/' << k.generation << '.' << i;
    });
    text << '\n';
  });
  return text.str();
}

}  // namespace turbomap_test

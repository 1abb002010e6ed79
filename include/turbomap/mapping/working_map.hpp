// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the stages of a local_mapper work on: the user's map itself where it is flat, else a mirror of it. Either is used in the
/// same way.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "map_mirror.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class T, class = void>
struct is_flat : std::false_type {};
template <class T>
struct is_flat<T, std::enable_if_t<T::flat>> : std::true_type {};

}  // namespace detail

/// Whether a map is flat itself (`static constexpr bool flat = true` in its traits): stages read it, and need no mirror.
template <class Map>
inline constexpr bool is_flat_v = detail::is_flat<map_traits<Map>>::value;

/// A mirror: see map_mirror for the members.
template <class Map, bool Flat = is_flat_v<Map>>
class working_map : public map_mirror<Map> {
 public:
  using type = map_mirror<Map>;
  using map_mirror<Map>::map_mirror;
  type& get() { return *this; }
};

/// The map itself: there is nothing to number, to report or to check.
template <class Map>
class working_map<Map, true> {
 public:
  using type = Map;
  using keyframe = typename map_traits<Map>::keyframe;
  using point = typename map_traits<Map>::point;

  explicit working_map(Map& map) : map_(map) {}
  Map& get() { return map_; }
  template <class Name>
  const Name& number(const Name& name) const {
    return name;
  }
  template <class Name>
  const Name& name(const Name& name) const {
    return name;
  }
  void forget(const point&) const {}
  void take_associations(const keyframe&) const {}
  template <class Name>
  void changed(const Name&) {}
  void refresh() {}
  void forget_poses() {}
  void begin() {}
  std::size_t check_sample(double) { return 0; }
  void removed(std::uint64_t) {}

 private:
  Map& map_;
};

TURBOMAP_END_NAMESPACE

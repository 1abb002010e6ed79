// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the stages of a local_mapper work on: the user's map itself, or a mirror of it where its traits ask for one. Either is
/// used in the same way.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "map_mirror.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class T, class = void>
struct is_mirrored : std::false_type {};
template <class T>
struct is_mirrored<T, std::enable_if_t<T::mirrored>> : std::true_type {};

}  // namespace detail

/// Whether a map is mirrored (`static constexpr bool mirrored = true` in its traits), which promises that names stay valid for as
/// long as the mapper lives, that none is used again for something else meanwhile, and that others report what they change: docs/local_mapping.md.
template <class Map>
inline constexpr bool is_mirrored_v = detail::is_mirrored<map_traits<Map>>::value;

/// A mirror: see map_mirror for the members.
template <class Map, bool Mirrored = is_mirrored_v<Map>>
class working_map : public map_mirror<Map> {
 public:
  using type = map_mirror<Map>;  ///< what the stages work on
  using map_mirror<Map>::map_mirror;
  /// What the stages work on.
  type& get() { return *this; }
};

/// The map itself: there is nothing to number, to report or to check.
template <class Map>
class working_map<Map, false> {
 public:
  using type = Map;                                     ///< what the stages work on
  using keyframe = typename map_traits<Map>::keyframe;  ///< names a keyframe
  using point = typename map_traits<Map>::point;        ///< names a point

  /// \param map  must outlive this
  explicit working_map(Map& map) : map_(map) {}
  /// What the stages work on.
  Map& get() { return map_; }
  /// The user's name.
  template <class Name>
  const Name& number(const Name& name) const {
    return name;
  }
  /// The user's name.
  template <class Name>
  const Name& name(const Name& name) const {
    return name;
  }
  /// @{
  /// As the member of this name of map_mirror: there is nothing to do.
  void forget(const point&) const {}
  bool take_associations(const keyframe&, std::size_t&, std::size_t) const { return false; }
  template <class Name>
  void changed(const Name&) {}
  void refresh() {}
  void forget_poses() {}
  void begin() {}
  std::size_t check_sample(double) { return 0; }
  void removed(std::uint64_t) {}
  void reset() {}
  /// @}

 private:
  Map& map_;
};

TURBOMAP_END_NAMESPACE

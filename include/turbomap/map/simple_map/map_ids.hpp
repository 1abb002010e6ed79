// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The names of keyframes and points of a simple_map: indices with a generation.

#include <cstddef>
#include <cstdint>
#include <limits>

#include "../../error.hpp"
#include "../../slot_table.hpp"

namespace turbomap {

namespace plain_detail {

/// An index that is checked: a place that is used again has another generation.
template <class Tag>
struct map_id {
  std::int32_t index = -1;       ///< place in the map's arrays; -1: none
  std::uint32_t generation = 0;  ///< of the place: another one once it is used again
  /// Same place and same generation.
  friend bool operator==(map_id a, map_id b) { return a.index == b.index && a.generation == b.generation; }
  /// Not the same.
  friend bool operator!=(map_id a, map_id b) { return !(a == b); }
};

/// A slot_table by the signed indices of a map.
class place_list {
 public:
  /// Makes room for so many more. Throws std::bad_alloc.
  void make_room(std::size_t more) { slots_.make_room(more); }
  /// A place of its own for something new, alive at once. Throws std::invalid_argument at 2^31 places, std::bad_alloc.
  std::int32_t take() {
    require(size() < static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()), "size of the map", size(),
            "must be below 2^31");
    const std::uint32_t slot = slots_.acquire();
    slots_.publish(slot);
    return static_cast<std::int32_t>(slot);
  }
  /// No longer alive, but named by its handles still: what was merged points to what it became.
  void retire(std::int32_t place) { slots_.retire(slot_of(place)); }
  /// Its handles are stale from now on.
  void give_back(std::int32_t place) {
    slots_.retire(slot_of(place));
    slots_.recycle(slot_of(place));
  }
  /// Whether this generation is the place's present one; any index.
  bool known(std::int32_t place, std::uint32_t generation) const {
    return place >= 0 && slots_.known(slot_of(place), generation);
  }
  /// Whether what is in the place is alive; the place is one of the list's (not checked).
  bool alive(std::int32_t place) const { return slots_.alive(slot_of(place)); }
  /// The present generation of a place (not checked).
  std::uint32_t generation(std::int32_t place) const { return slots_.generation(slot_of(place)); }
  /// The place that the n-th take() from now gives, if none is given back before; 0 is the next.
  std::size_t upcoming(std::size_t n) const { return slots_.upcoming(n); }
  /// Prefetches the entry of a place.
  void prefetch(std::int32_t place) const { slots_.prefetch(slot_of(place)); }
  /// Number of places ever taken.
  std::size_t size() const { return slots_.slot_count(); }
  /// Number of places that are alive.
  std::size_t alive_count() const { return slots_.alive_count(); }

 private:
  static std::uint32_t slot_of(std::int32_t place) { return static_cast<std::uint32_t>(place); }
  slot_table slots_;
};

}  // namespace plain_detail

/// Names a keyframe of a simple_map.
using map_keyframe_id = plain_detail::map_id<struct map_keyframe_tag>;
/// Names a point of a simple_map.
using map_point_id = plain_detail::map_id<struct map_point_tag>;

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Numbers the keyframes or points of a user's map in the order in which they are first named, so that everything about
/// them can lie in flat arrays: by the map's own indices where its traits have them, else through a table of their ids.

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "../config.hpp"
#include "../plain_vector.hpp"
#include "../prefetch.hpp"
#include "id_table.hpp"
#include "map_traits.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {
template <class Map, class Name>
using map_index_result = decltype(map_traits<Map>::index(std::declval<const Map&>(), std::declval<Name>()));
template <class Map, class Name, class = void>
struct has_map_index : std::false_type {};
template <class Map, class Name>
struct has_map_index<Map, Name, std::void_t<map_index_result<Map, Name>>> : std::true_type {};
}  // namespace detail

/// Numbers of one kind of name: 0, 1, 2 ... in the order in which they are first asked for.
/// \tparam Name  map_traits<Map>::keyframe or map_traits<Map>::point
template <class Map, class Name>
class numbering {
 public:
  static constexpr std::size_t none = id_table::none;  ///< find() of what has no number

  /// O(1).
  void clear() {
    if constexpr (indexed) {
      size_ = 0;
      if (++epoch_ == 0) {  // once in 2^32 times
        cells_.assign(cells_.size(), cell{});
        epoch_ = 1;
      }
    } else {
      table_.clear();
    }
  }
  /// How many have a number.
  std::size_t size() const {
    if constexpr (indexed)
      return size_;
    else
      return table_.size();
  }
  /// The number of what is named; a new one gets size(). Amortised O(1). Throws std::bad_alloc, unchanged.
  std::size_t place(const Map& map, Name name) {
    if constexpr (indexed) {
      const auto at = static_cast<std::size_t>(map_traits<Map>::index(map, name));
      if (at >= cells_.size()) cells_.resize(at + at / 2 + 16);
      cell& c = cells_[at];
      if (c.epoch != epoch_) c = {static_cast<std::uint32_t>(size_++), epoch_};
      return c.place;
    } else {
      return table_.place(map_traits<Map>::id(map, name));
    }
  }
  /// Its number, or none.
  std::size_t find(const Map& map, Name name) const {
    if constexpr (indexed) {
      const auto at = static_cast<std::size_t>(map_traits<Map>::index(map, name));
      return at < cells_.size() && cells_[at].epoch == epoch_ ? cells_[at].place : none;
    } else {
      return table_.find(map_traits<Map>::id(map, name));
    }
  }

  /// Asks memory for what place() and find() are going to read. The name may be none.
  void prefetch([[maybe_unused]] const Map& map, [[maybe_unused]] const Name& name) const {
    if constexpr (indexed) {
      if (name == Name{}) return;
      const auto at = static_cast<std::size_t>(map_traits<Map>::index(map, name));
      if (at < cells_.size()) prefetch_line(cells_.data() + at);
    }
  }

  /// Whether numbers are found in an array, not in a table of ids.
  static constexpr bool indexed = detail::has_map_index<Map, Name>::value;

 private:
  struct cell {
    std::uint32_t place = 0;
    std::uint32_t epoch = 0;
  };

  id_table table_;
  plain_vector<cell> cells_;
  std::size_t size_ = 0;
  std::uint32_t epoch_ = 1;
};

/// Numbers of keyframes.
template <class Map>
using keyframe_numbering = numbering<Map, typename map_traits<Map>::keyframe>;
/// Numbers of points.
template <class Map>
using point_numbering = numbering<Map, typename map_traits<Map>::point>;

TURBOMAP_END_NAMESPACE

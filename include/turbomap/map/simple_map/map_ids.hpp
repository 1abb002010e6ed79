// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The names of keyframes and points of a simple_map: indices with a generation, and the places that they index.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "../../error.hpp"

namespace turbomap {

namespace plain_detail {

/// An index that is checked: a place that is used again has another generation.
template <class Tag>
struct map_id {
  std::int32_t index = -1;
  std::uint32_t generation = 0;
  friend bool operator==(map_id a, map_id b) { return a.index == b.index && a.generation == b.generation; }
  friend bool operator!=(map_id a, map_id b) { return !(a == b); }
};

/// Places of an array: taken, given back, taken again under another generation.
class place_list {
 public:
  std::int32_t take() {
    if (!free_.empty()) {
      const std::int32_t number = free_.back();
      free_.pop_back();
      at(number).alive = true;
      ++alive_count_;
      return number;
    }
    require(places_.size() < static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()), "size of the map",
            places_.size(), "must be below 2^31");
    if (free_.capacity() <= places_.size()) free_.reserve(2 * places_.size() + 1);  // giving back must not throw
    places_.push_back({0, true});
    ++alive_count_;
    return static_cast<std::int32_t>(places_.size()) - 1;
  }
  /// No longer alive, but named by its handles still: what was merged points to what it became.
  void retire(std::int32_t number) {
    alive_count_ -= alive(number) ? 1 : 0;
    at(number).alive = false;
  }
  /// Its handles are stale from now on.
  void give_back(std::int32_t number) {
    retire(number);
    ++at(number).generation;
    free_.push_back(number);
  }
  bool known(std::int32_t number, std::uint32_t generation) const {
    return number >= 0 && static_cast<std::size_t>(number) < places_.size() && this->generation(number) == generation;
  }
  bool alive(std::int32_t number) const { return places_[static_cast<std::size_t>(number)].alive; }
  std::uint32_t generation(std::int32_t number) const { return places_[static_cast<std::size_t>(number)].generation; }
  std::size_t size() const { return places_.size(); }
  std::size_t alive_count() const { return alive_count_; }

 private:
  struct place {
    std::uint32_t generation;
    bool alive;
  };
  place& at(std::int32_t number) { return places_[static_cast<std::size_t>(number)]; }

  std::vector<place> places_;
  std::vector<std::int32_t> free_;
  std::size_t alive_count_ = 0;
};

}  // namespace plain_detail

using map_keyframe_id = plain_detail::map_id<struct map_keyframe_tag>;
using map_point_id = plain_detail::map_id<struct map_point_tag>;

}  // namespace turbomap

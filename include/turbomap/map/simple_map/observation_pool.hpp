// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The observation lists of all points of a simple_map in one array: a list is a block of it, of a power of two elements,
/// and moves to a block twice as large when it is full. No allocation per point, nothing but indices.

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "../../plain_vector.hpp"
#include "../../prefetch.hpp"
#include "../../span.hpp"

namespace turbomap {

/// A keypoint of a keyframe of a simple_map.
struct observation {
  std::int32_t keyframe;  ///< place of the keyframe in the map
  std::int32_t keypoint;  ///< keypoint index, within its keyframe
};

/// Lists by number. A list keeps the order in which observations were added.
class observation_pool {
 public:
  /// Makes list `list`, empty, if it is not there yet.
  void open(std::size_t list) {
    if (lists_.size() <= list) lists_.resize(list + 1);
  }
  /// Room for so many more observations, of all lists together. Throws std::bad_alloc.
  void make_room(std::size_t more) { turbomap::make_room(elements_, elements_.size() + more); }
  /// The observations of a list that was opened; valid until a list is changed.
  span<const observation> of(std::size_t list) const {
    const block& b = lists_[list];
    return {elements_.data() + b.begin, b.count};
  }
  /// Asks memory for where a list is.
  void prefetch_place(std::size_t list) const { prefetch_line(&lists_[list]); }
  /// Asks memory for the first two dozen observations of a list.
  void prefetch(std::size_t list) const {
    if (elements_.empty()) return;
    const auto* const first = reinterpret_cast<const char*>(elements_.data() + lists_[list].begin);
    prefetch_line(first), prefetch_line(first + 64), prefetch_line(first + 128);
  }
  /// Throws std::bad_alloc, and changes nothing, when there is no room.
  void add(std::size_t list, const observation& o) {
    reserve(list, 1);
    block& b = lists_[list];
    elements_[b.begin + b.count++] = o;
  }
  /// Makes room for `more` observations: the next add() of so many does not throw.
  void reserve(std::size_t list, std::size_t more) {
    block& b = lists_[list];
    int size_class = b.size_class < 0 ? smallest : b.size_class;
    while ((std::size_t{1} << size_class) < b.count + more) ++size_class;
    if (b.size_class == size_class) return;
    const std::size_t begin = take(size_class);
    std::copy_n(elements_.begin() + static_cast<std::ptrdiff_t>(b.begin), b.count,
                elements_.begin() + static_cast<std::ptrdiff_t>(begin));
    give_back(b);
    b.begin = begin;
    b.size_class = size_class;
  }
  /// Removes the observation, keeping the order of the others. False if it is not there.
  bool erase(std::size_t list, const observation& o) {
    block& b = lists_[list];
    observation* const first = elements_.data() + b.begin;
    observation* const last = first + b.count;
    observation* const at = std::find_if(
        first, last, [&](const observation& x) { return x.keyframe == o.keyframe && x.keypoint == o.keypoint; });
    if (at == last) return false;
    std::copy(at + 1, last, at);
    --b.count;
    return true;
  }
  /// Empties a list and gives its block back. Does not throw.
  void close(std::size_t list) {
    give_back(lists_[list]);
    lists_[list] = block{};
  }

 private:
  static constexpr int smallest = 2;  ///< blocks of 4: most points have few observations
  static constexpr int classes = 8 * sizeof(std::size_t);
  static constexpr std::size_t no_block = static_cast<std::size_t>(-1);

  struct block {
    std::size_t begin = 0;
    std::uint32_t count = 0;
    std::int32_t size_class = -1;
  };

  /// Free blocks are a chain of their own: the first element holds the next one's begin.
  std::size_t take(int size_class) {
    std::size_t& head = free_[size_class];
    if (head != no_block) {
      const std::size_t begin = head;
      const observation& link = elements_[begin];
      head = link.keyframe < 0 ? no_block
                               : (static_cast<std::size_t>(static_cast<std::uint32_t>(link.keyframe)) << 31) |
                                     static_cast<std::size_t>(static_cast<std::uint32_t>(link.keypoint) & 0x7FFFFFFFu);
      if (head != no_block) prefetch_line(&elements_[head]);  // new points come many at a time
      return begin;
    }
    const std::size_t begin = elements_.size();
    elements_.resize(begin + (std::size_t{1} << size_class));
    return begin;
  }
  void give_back(const block& b) {
    if (b.size_class < 0) return;
    std::size_t& head = free_[b.size_class];
    elements_[b.begin] = head == no_block ? observation{-1, -1}
                                          : observation{static_cast<std::int32_t>(head >> 31),
                                                        static_cast<std::int32_t>(head & 0x7FFFFFFFu)};
    head = b.begin;
  }

  struct heads {
    std::size_t at[classes];
    heads() { std::fill(at, at + classes, no_block); }
    std::size_t& operator[](int i) { return at[i]; }
  };

  plain_vector<observation> elements_;
  plain_vector<block> lists_;
  heads free_;
};

}  // namespace turbomap

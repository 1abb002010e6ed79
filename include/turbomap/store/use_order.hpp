// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Slots in the order of their last use.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../plain_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A list of slots, least recently used first, linked through an array by slot: O(1), and only grow() allocates.
class use_order {
 public:
  static constexpr std::uint32_t none = 0xFFFFFFFFu;  ///< no slot

  /// Room for slots below `slots`.
  void grow(std::size_t slots) {
    if (links_.size() < slots) links_.resize(slots);
  }
  /// The least recently used slot, or none.
  std::uint32_t first() const { return first_; }
  /// The slot used after this one, or none.
  std::uint32_t next(std::uint32_t slot) const { return links_[slot].next; }

  /// The most recently used; not in the list before.
  void append(std::uint32_t slot) noexcept {
    links_[slot] = {last_, none};
    (last_ == none ? first_ : links_[last_].next) = slot;
    last_ = slot;
  }
  /// Takes out a slot that is in the list.
  void remove(std::uint32_t slot) noexcept {
    const link l = links_[slot];
    (l.previous == none ? first_ : links_[l.previous].next) = l.next;
    (l.next == none ? last_ : links_[l.next].previous) = l.previous;
  }

 private:
  struct link {
    std::uint32_t previous = none, next = none;
  };
  plain_vector<link> links_;
  std::uint32_t first_ = none, last_ = none;
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Slots of an array that are used again, and their generations: a handle (slot, generation) of something that is gone never
/// names what came into its slot later.

#include <cstddef>
#include <cstdint>
#include <limits>

#include "plain_vector.hpp"
#include "prefetch.hpp"

namespace turbomap {

/// A slot goes round: acquire() -> publish() -> retire() -> recycle(). Its handle is known from acquire() to recycle(), and
/// alive between publish() and retire(). A slot whose generations are used up is never used again, so no handle ever comes
/// back to life. All O(1). Not thread safe.
class slot_table {
 public:
  /// \param last_generation  after which a slot is given up (a test uses a small one)
  explicit slot_table(std::uint32_t last_generation = std::numeric_limits<std::uint32_t>::max())
      : last_generation_(last_generation) {}

  /// Makes room: so many calls of acquire() do not throw. Throws std::bad_alloc.
  void make_room(std::size_t more) {
    turbomap::make_room(slots_, slots_.size() + more);
    turbomap::make_room(free_, slots_.size() + more);
  }
  /// A slot that nobody uses. Throws std::bad_alloc with nothing changed.
  std::uint32_t acquire() {
    if (!free_.empty()) {
      const std::uint32_t slot = free_.back();
      free_.pop_back();
      return slot;
    }
    if (free_.capacity() < slots_.size() + 1) free_.reserve(2 * slots_.size() + 16);  // recycle() must not throw
    slots_.push_back({1, false});
    return static_cast<std::uint32_t>(slots_.size() - 1);
  }
  /// What is in an acquired slot is complete: it is alive from now on.
  void publish(std::uint32_t slot) noexcept {
    slots_[slot].alive = true;
    ++alive_;
  }
  /// No longer alive; the slot may still be in use, and its handle is known yet.
  void retire(std::uint32_t slot) noexcept {
    alive_ -= slots_[slot].alive ? 1 : 0;
    slots_[slot].alive = false;
  }
  /// Nobody uses the slot any more: its handle is stale from now on.
  void recycle(std::uint32_t slot) noexcept {
    if (slots_[slot].generation == last_generation_) return;
    ++slots_[slot].generation;
    free_.push_back(slot);
  }

  /// Whether the handle names what is in the slot, alive or retired.
  bool known(std::uint32_t slot, std::uint32_t generation) const {
    return slot < slots_.size() && slots_[slot].generation == generation;
  }
  /// Whether the handle names something alive.
  bool alive(std::uint32_t slot, std::uint32_t generation) const { return known(slot, generation) && alive(slot); }
  /// Whether what is in the slot is alive; the slot is one of the table's (not checked).
  bool alive(std::uint32_t slot) const { return slots_[slot].alive; }
  /// The generation that the slot's handles have now (the slot is not checked).
  std::uint32_t generation(std::uint32_t slot) const { return slots_[slot].generation; }
  /// The slot that the n-th acquire() from now gives, if none is recycled before; 0 is the next.
  std::uint32_t upcoming(std::size_t n) const {
    return n < free_.size() ? free_[free_.size() - 1 - n]
                            : static_cast<std::uint32_t>(slots_.size() + (n - free_.size()));
  }
  /// Prefetches the entry of a slot; any number does no harm.
  void prefetch(std::uint32_t slot) const { prefetch_line(slots_.data() + slot); }
  /// Number of slots that are alive.
  std::size_t alive_count() const { return alive_; }
  /// Number of slots ever acquired, whatever their state: slots are below it.
  std::size_t slot_count() const { return slots_.size(); }

 private:
  struct entry {
    std::uint32_t generation;
    bool alive;
  };
  std::uint32_t last_generation_;
  std::size_t alive_ = 0;
  plain_vector<entry> slots_;
  plain_vector<std::uint32_t> free_;
};

}  // namespace turbomap

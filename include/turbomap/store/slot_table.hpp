// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Slots and their generations: which handles are alive.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "keyframe_handle.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Life of a slot: acquire() -> publish() -> retire() -> recycle(), and again. Its handle is valid between publish() and
/// retire(). The generation rises at retire(). A slot whose generations are used up is never used again, so a stale handle
/// never becomes valid. All O(1). Not thread safe.
class slot_table {
 public:
  /// \param last_generation  after which a slot is given up (a test uses a small one)
  explicit slot_table(std::uint32_t last_generation = std::numeric_limits<std::uint32_t>::max())
      : last_generation_(last_generation) {}

  /// A slot that nobody uses. Throws std::bad_alloc with nothing changed.
  std::uint32_t acquire() {
    if (!free_.empty()) {
      const std::uint32_t slot = free_.back();
      free_.pop_back();
      return slot;
    }
    if (free_.capacity() < slots_.size() + 1) free_.reserve(2 * slots_.size() + 16);  // recycle() must not throw
    slots_.push_back({1, false, false});
    return static_cast<std::uint32_t>(slots_.size() - 1);
  }
  keyframe_handle publish(std::uint32_t slot) noexcept {
    slots_[slot].alive = true;
    ++alive_;
    return {slot, slots_[slot].generation};
  }
  /// From now on the handle is stale; the slot may still be in use.
  void retire(std::uint32_t slot) noexcept {
    slots_[slot].alive = false;
    --alive_;
    slots_[slot].used_up = slots_[slot].generation == last_generation_;
    if (!slots_[slot].used_up) ++slots_[slot].generation;
  }
  /// Nobody uses the slot any more.
  void recycle(std::uint32_t slot) noexcept {
    if (!slots_[slot].used_up) free_.push_back(slot);
  }

  bool alive(keyframe_handle handle) const {
    return handle.slot < slots_.size() && slots_[handle.slot].alive &&
           slots_[handle.slot].generation == handle.generation;
  }
  bool alive(std::uint32_t slot) const { return slots_[slot].alive; }
  /// Throws stale_handle naming the argument, slot and generation.
  void require_alive(keyframe_handle handle, const char* argument) const {
    if (alive(handle)) return;
    throw stale_handle(std::string("turbomap: ") + argument + " = {slot " + std::to_string(handle.slot) +
                       ", generation " + std::to_string(handle.generation) +
                       "}: no such keyframe: it was erased, or is of another store");
  }
  std::size_t alive_count() const { return alive_; }
  std::size_t slot_count() const { return slots_.size(); }

 private:
  struct entry {
    std::uint32_t generation;
    bool alive;
    bool used_up;
  };
  std::uint32_t last_generation_;
  std::size_t alive_ = 0;
  std::vector<entry> slots_;
  std::vector<std::uint32_t> free_;
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a store remembers of its pins: who holds which keyframes, and whose work may still run.

#include <cstddef>
#include <cstdint>
#include <list>
#include <vector>

#include "../config.hpp"
#include "keyframe_view.hpp"
#include "memory_space.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One pin.
template <class Descriptor, class Camera, class Memory>
struct pin_record {
  std::vector<std::uint32_t> slots;
  std::vector<keyframe_view<Descriptor, Camera>> views;
  fence<Memory> done;
};

/// Life of a record: idle() -> hold() -> give_up() -> finished, and again, so that pinning allocates nothing in the steady
/// state. Not thread safe.
template <class Descriptor, class Camera, class Memory>
class pin_records {
 public:
  using record_type = pin_record<Descriptor, Camera, Memory>;
  using iterator = typename std::list<record_type>::iterator;

  /// An idle record with `n` slots and views. Throws std::bad_alloc.
  iterator idle(std::size_t n) {
    if (idle_.empty()) idle_.emplace_back();
    idle_.front().slots.resize(n);
    idle_.front().views.resize(n);
    return idle_.begin();
  }
  void hold(iterator record) noexcept { active_.splice(active_.end(), idle_, record); }
  /// Its fence has been recorded: finishes it if its work is done.
  template <class Unpin>
  void give_up(iterator record, Unpin unpin) noexcept {
    pending_.splice(pending_.end(), active_, record);
    if (record->done.passed()) finish(record, unpin);
  }
  /// Calls unpin(slot) for the slots of every record whose work is done.
  template <class Unpin>
  void finish_passed(Unpin unpin) noexcept {
    for (auto record = pending_.begin(); record != pending_.end();) {
      const auto current = record++;
      if (current->done.passed()) finish(current, unpin);
    }
  }
  /// Waits for the work of the oldest record that was given up, and finishes it.
  template <class Unpin>
  void finish_oldest(Unpin unpin) {
    pending_.front().done.wait();
    finish(pending_.begin(), unpin);
  }
  void wait() {
    for (auto& record : pending_) record.done.wait();
  }

  bool any_given_up() const { return !pending_.empty(); }
  std::size_t count() const { return active_.size() + pending_.size(); }

 private:
  template <class Unpin>
  void finish(iterator record, Unpin& unpin) noexcept {
    for (const std::uint32_t slot : record->slots) unpin(slot);
    idle_.splice(idle_.begin(), pending_, record);
  }

  std::list<record_type> active_, pending_, idle_;
};

TURBOMAP_END_NAMESPACE

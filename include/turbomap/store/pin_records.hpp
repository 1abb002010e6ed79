// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a store remembers of its pins: who holds which keyframes, and whose work may still run.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../plain_vector.hpp"
#include "keyframe_view.hpp"
#include "memory_space.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One pin.
template <class Descriptor, class Camera, class Memory>
struct pin_record {
  plain_vector<std::uint32_t> slots;  ///< of the pinned keyframes, in the order in which they were asked for
  plain_vector<keyframe_view<Descriptor, Camera>> views;  ///< one per slot
  fence<Memory> done;                                     ///< behind the work that reads them
  pin_record* previous = nullptr;                         ///< of the chain that it is in
  pin_record* next = nullptr;                             ///< of the chain that it is in
};

namespace detail {

/// Records one after the other, linked through themselves. Owns them.
template <class Record>
class record_chain {
 public:
  record_chain() = default;
  record_chain(const record_chain&) = delete;
  record_chain& operator=(const record_chain&) = delete;
  ~record_chain() {
    while (first_ != nullptr) delete take(*first_);
  }
  Record* first() const { return first_; }
  Record* last() const { return last_; }
  void append(Record* r) noexcept {
    r->previous = last_, r->next = nullptr;
    (last_ != nullptr ? last_->next : first_) = r;
    last_ = r;
  }
  /// Its owner is the caller from now on.
  Record* take(Record& r) noexcept {
    (r.previous != nullptr ? r.previous->next : first_) = r.next;
    (r.next != nullptr ? r.next->previous : last_) = r.previous;
    return &r;
  }

 private:
  Record *first_ = nullptr, *last_ = nullptr;
};

}  // namespace detail

/// Life of a record: idle() -> hold() -> give_up() -> finished, and again, so that pinning allocates nothing in the steady
/// state. Not thread safe.
template <class Descriptor, class Camera, class Memory>
class pin_records {
 public:
  /// One pin of this store.
  using record_type = pin_record<Descriptor, Camera, Memory>;

  /// An idle record with `n` slots and views. Throws std::bad_alloc.
  record_type* idle(std::size_t n) {
    if (idle_.last() == nullptr) idle_.append(new record_type);
    record_type* const record = idle_.last();  // the one that was used last
    record->slots.resize(n);
    record->views.resize(n);
    return record;
  }
  /// The idle record is in use from now on.
  void hold(record_type* record) noexcept {
    active_.append(idle_.take(*record));
    ++count_;
  }
  /// Its fence has been recorded: finishes it if its work is done.
  template <class Unpin>
  void give_up(record_type* record, Unpin unpin) noexcept {
    pending_.append(active_.take(*record));
    if (record->done.passed()) finish(record, unpin);
  }
  /// Calls unpin(slot) for the slots of every record whose work is done.
  template <class Unpin>
  void finish_passed(Unpin unpin) noexcept {
    for (record_type* record = pending_.first(); record != nullptr;) {
      record_type* const current = record;
      record = record->next;
      if (current->done.passed()) finish(current, unpin);
    }
  }
  /// Waits for the work of the oldest record that was given up, and finishes it.
  template <class Unpin>
  void finish_oldest(Unpin unpin) {
    pending_.first()->done.wait();
    finish(pending_.first(), unpin);
  }
  /// Waits for the work of all records that were given up; finishes none.
  void wait() {
    for (record_type* record = pending_.first(); record != nullptr; record = record->next) record->done.wait();
  }

  /// Whether a record was given up and is not finished.
  bool any_given_up() const { return pending_.first() != nullptr; }
  /// Records that are held or given up.
  std::size_t count() const { return count_; }

 private:
  template <class Unpin>
  [[gnu::noinline]] void finish(record_type* record, const Unpin& unpin) noexcept {
    for (const std::uint32_t slot : record->slots) unpin(slot);
    idle_.append(pending_.take(*record));
    --count_;
  }

  detail::record_chain<record_type> active_, pending_, idle_;
  std::size_t count_ = 0;  ///< active and pending
};

TURBOMAP_END_NAMESPACE

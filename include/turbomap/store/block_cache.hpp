// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Blocks of bytes by slot, resident in the memory of a policy or paged out to the host: the least recently used go
/// first, those pinned never. Every operation does all of its work or leaves everything as it was.

#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../span.hpp"
#include "chunk_allocator.hpp"
#include "memory_space.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Not thread safe: the store holds its lock around every call.
template <class Memory>
class block_cache {
 public:
  /// \param budget  bytes of resident chunks together; 0: what the resource gives
  block_cache(std::pmr::memory_resource* resident, std::pmr::memory_resource* paging, std::size_t chunk_bytes,
              std::size_t budget)
      : lane_(paging), resident_(resident, chunk_bytes, budget), paged_(paging, chunk_bytes) {}

  /// Makes room for `bytes` in a slot without a block, and pins it. Throws out_of_memory when the pinned blocks leave
  /// no room.
  std::byte* place(std::uint32_t slot, std::size_t bytes) {
    grow_tables(slot);
    requests_.assign(1, {slot, bytes, {}});
    ++mark_;
    make_room();
    entry& e = entries_[slot];
    e = entry{};
    e.block = requests_.front().block;
    e.used = bytes;
    e.resident = true;
    e.pins = 1;
    return e.block.data;
  }

  /// Pins the blocks of some slots (once for each time it is named), bringing back those paged out. Throws
  /// out_of_memory when they do not fit together with those pinned already.
  void pin(span<const std::uint32_t> slots) {
    requests_.clear();
    ++mark_;
    for (const std::uint32_t slot : slots) {
      entry& e = entries_[slot];
      if (!e.resident && e.mark != mark_) requests_.push_back({slot, e.used, {}});
      e.mark = mark_;
    }
    if (!requests_.empty()) {
      make_room();
      page_in();
    }
    for (const std::uint32_t slot : slots)
      if (entries_[slot].pins++ == 0) unlink(slot);
  }

  /// Takes one pin away; the last one makes the block the most recently used.
  void unpin(std::uint32_t slot) noexcept {
    if (--entries_[slot].pins == 0) link_last(slot);
  }

  /// Frees the block of a slot that is not pinned.
  void remove(std::uint32_t slot) noexcept {
    entry& e = entries_[slot];
    if (e.resident) unlink(slot);
    allocator_of(e).deallocate(e.block);
    allocator_of(e).release_empty(1);
    e = entry{};
  }

  bool pinned(std::uint32_t slot) const { return entries_[slot].pins > 0; }
  bool resident(std::uint32_t slot) const { return entries_[slot].resident; }
  std::byte* data(std::uint32_t slot) const { return entries_[slot].block.data; }

  const chunk_allocator& resident_memory() const { return resident_; }
  const chunk_allocator& paged_memory() const { return paged_; }
  std::uint64_t page_ins() const { return page_ins_; }
  std::uint64_t page_outs() const { return page_outs_; }

 private:
  static constexpr std::uint32_t none = 0xFFFFFFFFu;

  struct entry {
    chunk_block block;
    std::size_t used = 0;  // bytes of the block that the keyframe fills: the rest is never written, and never copied
    bool resident = false;
    std::uint32_t pins = 0;
    std::uint32_t previous = none, next = none;  // among the resident blocks without pins, least recently used first
    std::uint64_t mark = 0;                      // the call that named it last
  };
  struct request {
    std::uint32_t slot;
    std::size_t bytes;
    chunk_block block;
  };
  struct victim {
    std::uint32_t slot;
    chunk_block paged;
  };

  chunk_allocator& allocator_of(const entry& e) { return e.resident ? resident_ : paged_; }

  void grow_tables(std::uint32_t slot) {
    if (entries_.size() <= slot) entries_.resize(std::size_t{slot} + 1);
    if (victims_.capacity() < entries_.size()) victims_.reserve(entries_.capacity());
    if (requests_.capacity() < entries_.size()) requests_.reserve(entries_.capacity());
  }

  /// A block for each request, paging out where needed; the blocks that this call names itself are spared.
  void make_room() {
    const std::size_t empty_resident = resident_.empty_chunks(), empty_paged = paged_.empty_chunks();
    victims_.clear();
    try {
      std::uint32_t candidate = first_;
      bool refused = false;  // the resource said no: asking again costs time and gives nothing
      for (request& r : requests_) {
        while (!(r.block = resident_.try_allocate(r.bytes))) {
          const auto growth = refused ? chunk_allocator::growth::refused : resident_.try_grow(r.bytes);
          if (growth == chunk_allocator::growth::done) continue;
          refused = growth == chunk_allocator::growth::refused;
          while (candidate != none && entries_[candidate].mark == mark_) candidate = entries_[candidate].next;
          if (candidate == none) throw out_of_memory("keyframe store", r.bytes);
          const chunk_block& block = entries_[candidate].block;
          victims_.push_back({candidate, paged_.allocate(block.bytes)});
          resident_.deallocate(block);
          candidate = entries_[candidate].next;
        }
      }
      for (const victim& v : victims_) {
        const chunk_block& block = entries_[v.slot].block;  // given back, but nothing has been written to it yet
        lane_.download(v.paged.data, block.data, entries_[v.slot].used);
      }
      lane_.wait();
    } catch (...) {
      give_back_requests();
      for (auto v = victims_.rbegin(); v != victims_.rend(); ++v) {
        resident_.claim(entries_[v->slot].block);
        paged_.deallocate(v->paged);
      }
      resident_.release_empty(empty_resident);
      paged_.release_empty(empty_paged);
      throw;
    }
    for (const victim& v : victims_) {
      unlink(v.slot);
      entries_[v.slot].block = v.paged;
      entries_[v.slot].resident = false;
      ++page_outs_;
    }
  }

  void page_in() {
    try {
      for (const request& r : requests_) lane_.upload(r.block.data, entries_[r.slot].block.data, r.bytes);
      lane_.wait();
    } catch (...) {
      give_back_requests();
      throw;
    }
    for (const request& r : requests_) {
      paged_.deallocate(entries_[r.slot].block);
      entries_[r.slot].block = r.block;
      entries_[r.slot].resident = true;
      link_last(r.slot);
      ++page_ins_;
    }
    paged_.release_empty(1);
  }

  void give_back_requests() noexcept {
    for (auto r = requests_.rbegin(); r != requests_.rend(); ++r)
      if (r->block) resident_.deallocate(r->block);
  }

  void link_last(std::uint32_t slot) noexcept {
    entries_[slot].previous = last_;
    entries_[slot].next = none;
    (last_ == none ? first_ : entries_[last_].next) = slot;
    last_ = slot;
  }
  void unlink(std::uint32_t slot) noexcept {
    entry& e = entries_[slot];
    (e.previous == none ? first_ : entries_[e.previous].next) = e.next;
    (e.next == none ? last_ : entries_[e.next].previous) = e.previous;
    e.previous = e.next = none;
  }

  transfer_lane<Memory> lane_;
  chunk_allocator resident_, paged_;
  std::vector<entry> entries_;
  std::vector<request> requests_;
  std::vector<victim> victims_;
  std::uint32_t first_ = none, last_ = none;
  std::uint64_t mark_ = 0, page_ins_ = 0, page_outs_ = 0;
};

TURBOMAP_END_NAMESPACE

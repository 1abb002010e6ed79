// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Blocks of bytes by slot, resident in the memory of a policy or paged out to the host: the least recently used go
/// first, those pinned never. Every operation does all of its work or leaves everything as it was.

#include <cstddef>
#include <cstdint>
#include <memory_resource>

#include "../config.hpp"
#include "../error.hpp"
#include "../plain_sort.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "chunk_allocator.hpp"
#include "keyframe_store_options.hpp"
#include "memory_space.hpp"
#include "use_order.hpp"

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
      if (entries_[slot].pins++ == 0) unpinned_.remove(slot);
  }

  /// Takes one pin away; the last one makes the block the most recently used.
  void unpin(std::uint32_t slot) noexcept {
    if (--entries_[slot].pins == 0) unpinned_.append(slot);
  }

  /// Frees the block of a slot that is not pinned.
  void remove(std::uint32_t slot) noexcept {
    entry& e = entries_[slot];
    if (e.resident) unpinned_.remove(slot);
    allocator_of(e).deallocate(e.block);
    allocator_of(e).release_empty(1);
    e = entry{};
  }

  /// Whether a pin holds the block where it is.
  bool pinned(std::uint32_t slot) const { return entries_[slot].pins > 0; }
  /// Whether the block is in the memory of the store, not paged out.
  bool resident(std::uint32_t slot) const { return entries_[slot].resident; }
  /// The first byte, in whichever memory the block is now.
  std::byte* data(std::uint32_t slot) const { return entries_[slot].block.data; }

  /// Writes the counts of blocks, bytes and pages.
  void count(keyframe_store_statistics& s) const {
    s.resident_blocks = resident_.block_count();
    s.paged_blocks = paged_.block_count();
    s.resident_bytes = resident_.used_bytes();
    s.paged_bytes = paged_.used_bytes();
    s.chunk_bytes = resident_.reserved_bytes();
    s.peak_chunk_bytes = resident_.peak_bytes();
    s.paging_chunk_bytes = paged_.reserved_bytes();
    s.page_ins = page_ins_;
    s.page_outs = page_outs_;
  }

 private:
  struct entry {
    chunk_block block;
    std::size_t used = 0;  // bytes of the block that the keyframe fills: the rest is never written, and never copied
    bool resident = false;
    std::uint32_t pins = 0;
    std::uint64_t mark = 0;  // the call that named it last
  };
  struct request {
    std::uint32_t slot;
    std::size_t bytes;
    chunk_block block;
  };
  struct victim {
    std::uint32_t slot;
    chunk_block paged;
    bool saved = false;     // copied to `paged`
    bool homeless = false;  // and its chunk returned
  };

  chunk_allocator& allocator_of(const entry& e) { return e.resident ? resident_ : paged_; }

  void grow_tables(std::uint32_t slot) {
    if (entries_.size() <= slot) entries_.resize(std::size_t{slot} + 1);
    unpinned_.grow(entries_.size());
    if (victims_.capacity() < entries_.size()) victims_.reserve(entries_.capacity());
    if (requests_.capacity() < entries_.size()) requests_.reserve(entries_.capacity());
  }

  /// A block for each request, paging out where needed; the blocks that this call names itself are spared.
  void make_room() {
    const std::size_t empty_resident = resident_.empty_chunks(), empty_paged = paged_.empty_chunks();
    victims_.clear();
    // The largest first: a small one in a chunk of its own would keep that chunk from making room for a large one.
    sort_plain(requests_.data(), requests_.size(), [](const request& a, const request& b) {
      return a.bytes != b.bytes ? a.bytes > b.bytes : a.slot < b.slot;
    });
    try {
      std::uint32_t candidate = unpinned_.first();
      bool refused = false;  // the resource said no: asking again costs time and gives nothing
      for (request& r : requests_) {
        while (!(r.block = resident_.try_allocate(r.bytes))) {
          auto growth = refused ? chunk_allocator::growth::refused : resident_.try_grow(r.bytes);
          if (growth != chunk_allocator::growth::done && resident_.empty_chunks_suffice(r.bytes, refused)) {
            give_up_empty_chunks();
            growth = resident_.try_grow(r.bytes);
          }
          if (growth == chunk_allocator::growth::done) continue;
          refused = growth == chunk_allocator::growth::refused;
          while (candidate != use_order::none && entries_[candidate].mark == mark_)
            candidate = unpinned_.next(candidate);
          if (candidate == use_order::none) throw out_of_memory("keyframe store", r.bytes);
          const chunk_block& block = entries_[candidate].block;
          victims_.push_back({candidate, paged_.allocate(block.bytes)});
          resident_.deallocate(block);
          candidate = unpinned_.next(candidate);
        }
      }
      save_victims();
    } catch (...) {
      lane_.settle();
      undo(empty_resident, empty_paged);
      throw;
    }
    for (const victim& v : victims_) settle_paged(v);
  }

  /// Copies the victims out. Their blocks were given back, but nothing has been written there yet.
  void save_victims() {
    for (const victim& v : victims_)
      if (!v.saved) lane_.download(v.paged.data, entries_[v.slot].block.data, entries_[v.slot].used);
    lane_.wait();
    for (victim& v : victims_) v.saved = true;
  }
  /// Returns the empty chunks, in which victims lie, so that a larger one may take their place.
  void give_up_empty_chunks() {
    save_victims();
    for (victim& v : victims_) v.homeless = v.homeless || resident_.in_empty_chunk(entries_[v.slot].block);
    resident_.release_empty(0);
  }
  void settle_paged(const victim& v) noexcept {
    unpinned_.remove(v.slot);
    entries_[v.slot].block = v.paged;
    entries_[v.slot].resident = false;
    ++page_outs_;
  }

  /// Back to where make_room() began. A victim whose chunk was returned finds another one; it stays paged out only if
  /// the resource does not give again what it has just taken back.
  void undo(std::size_t empty_resident, std::size_t empty_paged) noexcept {
    give_back_requests();
    bool moved = false;
    for (std::size_t i = victims_.size(); i-- > 0;) {
      const victim& v = victims_[i];
      moved = moved || v.homeless;
      if (v.homeless) continue;
      resident_.claim(entries_[v.slot].block);
      paged_.deallocate(v.paged);
    }
    resident_.release_empty(moved ? 0 : empty_resident);
    for (const victim& v : victims_)
      if (v.homeless && !bring_back(v)) settle_paged(v);
    paged_.release_empty(empty_paged);
  }
  bool bring_back(const victim& v) noexcept {
    entry& e = entries_[v.slot];
    try {
      e.block = v.paged;  // what stays if nothing better is found
      const chunk_block found = resident_.allocate(v.paged.bytes);
      e.block = found;
      lane_.upload(found.data, v.paged.data, e.used);
      lane_.wait();
    } catch (...) {
      lane_.settle();
      if (e.block.data != v.paged.data) resident_.deallocate(e.block);
      return false;
    }
    paged_.deallocate(v.paged);
    return true;
  }

  void page_in() {
    try {
      for (const request& r : requests_) lane_.upload(r.block.data, entries_[r.slot].block.data, r.bytes);
      lane_.wait();
    } catch (...) {
      lane_.settle();
      give_back_requests();
      throw;
    }
    for (const request& r : requests_) {
      paged_.deallocate(entries_[r.slot].block);
      entries_[r.slot].block = r.block;
      entries_[r.slot].resident = true;
      unpinned_.append(r.slot);
      ++page_ins_;
    }
    paged_.release_empty(1);
  }

  void give_back_requests() noexcept {
    for (std::size_t i = requests_.size(); i-- > 0;)
      if (requests_[i].block) resident_.deallocate(requests_[i].block);
  }

  transfer_lane<Memory> lane_;
  chunk_allocator resident_, paged_;
  plain_vector<entry> entries_;
  plain_vector<request> requests_;
  plain_vector<victim> victims_;
  use_order unpinned_;  // the resident blocks without pins
  std::uint64_t mark_ = 0, page_ins_ = 0, page_outs_ = 0;
};

TURBOMAP_END_NAMESPACE

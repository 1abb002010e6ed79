// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Cuts large chunks of memory into blocks. The memory may be a device's: the host never touches it, so all bookkeeping
/// is outside of it.

#include <cstddef>
#include <memory_resource>
#include <new>

#include "../config.hpp"
#include "../error.hpp"
#include "../memory.hpp"
#include "../plain_vector.hpp"
#include "chunk_range.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Best fit with coalescing. Grows by whole chunks, within a limit. Not thread
/// safe.
class chunk_allocator {
 public:
  static constexpr std::size_t alignment = 256;  ///< of every block, bytes
  /// What came of an attempt to get one more chunk.
  enum class growth {
    done,        ///< there is one chunk more
    over_limit,  ///< the limit does not allow it
    refused      ///< the resource has no memory
  };

  /// \param resource     where chunks come from
  /// \param chunk_bytes  least size of a chunk; a larger block gets a chunk of its own size
  /// \param limit        bytes in all chunks together; the last chunk is smaller if need be; 0: none
  chunk_allocator(std::pmr::memory_resource* resource, std::size_t chunk_bytes, std::size_t limit = 0)
      : resource_(resource),
        chunk_bytes_(align_up(chunk_bytes, alignment)),
        limit_(limit == 0 ? unlimited : limit / alignment * alignment) {}
  chunk_allocator(const chunk_allocator&) = delete;
  chunk_allocator& operator=(const chunk_allocator&) = delete;
  ~chunk_allocator() {
    for (detail::chunk* const c : chunks_) {
      give_up_ranges(*c);
      resource_->deallocate(c->data, c->bytes, alignment);
      delete c;
    }
    delete spare_chunk_;
    while (spares_ != nullptr) delete take_spare();
  }

  /// A block of at least `bytes`, growing when nothing fits. Throws out_of_memory when it cannot, and device_error when the
  /// device has failed; nothing is changed.
  chunk_block allocate(std::size_t bytes) {
    chunk_block block = try_allocate(bytes);
    if (!block && try_grow(bytes) == growth::done) block = try_allocate(bytes);
    if (!block) throw out_of_memory("keyframe store", bytes);
    return block;
  }

  /// The same without growing: an empty block when nothing fits.
  chunk_block try_allocate(std::size_t bytes) {
    bytes = align_up(bytes == 0 ? 1 : bytes, alignment);
    detail::chunk_range* const found = free_.best_fit(bytes);
    if (found == nullptr) return {};
    detail::chunk_range& range = *found;
    if (range.bytes > bytes) reserve_spare();  // the only thing that can throw
    take_out(range);
    if (range.bytes > bytes) cut(range, bytes);
    return hand_out(range);
  }

  /// One more chunk, large enough for `bytes`. Throws std::bad_alloc when there is no host memory for the bookkeeping, and
  /// device_error when the device has failed; nothing is changed.
  growth try_grow(std::size_t bytes) {
    bytes = align_up(bytes == 0 ? 1 : bytes, alignment);
    std::size_t size = bytes > chunk_bytes_ ? bytes : chunk_bytes_;
    if (size > limit_ - reserved_bytes_) size = limit_ - reserved_bytes_;
    if (size < bytes) return growth::over_limit;
    reserve_spare();
    chunks_.reserve(chunks_.size() + 1);
    if (spare_chunk_ == nullptr) spare_chunk_ = new detail::chunk;
    std::byte* data = nullptr;
    try {
      data = static_cast<std::byte*>(resource_->allocate(size, alignment));
    } catch (const std::bad_alloc&) {
      return growth::refused;
    }
    detail::chunk& c = *spare_chunk_;
    spare_chunk_ = nullptr;
    c = {data, size, next_number_++, 0, nullptr};
    ++empty_chunks_;
    reserved_bytes_ += size;
    if (reserved_bytes_ > peak_bytes_) peak_bytes_ = reserved_bytes_;
    chunks_.push_back(&c);
    put_in(add_range(c, nullptr, 0, size));
    return growth::done;
  }

  /// Gives a block back. Chunks stay until release_empty().
  void deallocate(const chunk_block& block) noexcept {
    detail::chunk& c = *block.owner;
    detail::chunk_range& range = *block.range;
    used_bytes_ -= range.bytes;
    --block_count_;
    if (--c.blocks == 0) ++empty_chunks_;
    if (range.previous != nullptr && range.previous->free) absorb(range, *range.previous);
    if (range.next != nullptr && range.next->free) absorb(range, *range.next);
    put_in(range);
  }

  /// Undoes deallocate(): takes the very same bytes again and updates the block. They must all be free, and the blocks
  /// handed out since must have been given back. Linear in the pieces of the chunk.
  void claim(chunk_block& block) noexcept {
    detail::chunk& c = *block.owner;
    const std::size_t offset = static_cast<std::size_t>(block.data - c.data);
    detail::chunk_range* range = c.first;
    while (range->offset + range->bytes <= offset) range = range->next;
    take_out(*range);
    if (range->offset < offset) {
      cut(*range, offset - range->offset);
      put_in(*range);
      range = range->next;
      take_out(*range);
    }
    if (range->bytes > block.bytes) cut(*range, block.bytes);
    block = hand_out(*range);
  }

  /// Returns empty chunks to the resource, all but the `keep` oldest of them.
  [[gnu::noinline]] void release_empty(std::size_t keep) noexcept {
    for (std::size_t i = 0; empty_chunks_ > keep && i < chunks_.size();) {
      const std::size_t at = chunks_.size() - 1 - i;  // the youngest first
      detail::chunk* const c = chunks_[at];
      if (c->blocks != 0) {
        ++i;
        continue;
      }
      --empty_chunks_;
      take_out(*c->first);
      give_up_ranges(*c);
      reserved_bytes_ -= c->bytes;
      resource_->deallocate(c->data, c->bytes, alignment);
      delete c;
      for (std::size_t j = at; j + 1 < chunks_.size(); ++j) chunks_[j] = chunks_[j + 1];
      chunks_.pop_back();
    }
  }

  /// Whether a chunk for `bytes` can take the place of the empty ones: within the limit; when the resource has
  /// `refused` more, for no more than it gets back.
  bool empty_chunks_suffice(std::size_t bytes, bool refused) const {
    std::size_t empty = 0;
    for (const detail::chunk* c : chunks_) empty += c->blocks == 0 ? c->bytes : 0;
    return empty > 0 && (refused ? 0 : limit_ - reserved_bytes_) + empty >= align_up(bytes, alignment);
  }
  /// Whether nothing else is in the chunk of a block that was given back.
  bool in_empty_chunk(const chunk_block& block) const { return block.owner->blocks == 0; }

  std::size_t reserved_bytes() const { return reserved_bytes_; }  ///< in all chunks
  std::size_t peak_bytes() const { return peak_bytes_; }          ///< the most ever reserved
  std::size_t used_bytes() const { return used_bytes_; }          ///< in all blocks
  /// Blocks in use.
  std::size_t block_count() const { return block_count_; }
  /// Chunks, the empty ones included.
  std::size_t chunk_count() const { return chunks_.size(); }
  /// Free ranges in all chunks: a measure of fragmentation.
  std::size_t free_range_count() const { return free_.size(); }
  /// Chunks without a block.
  std::size_t empty_chunks() const { return empty_chunks_; }

 private:
  static constexpr std::size_t unlimited = static_cast<std::size_t>(-1);

  /// Makes bookkeeping for one more range, and room for it among the free ones: giving memory back then never allocates.
  void reserve_spare() {
    if (spares_ != nullptr) return;
    free_.reserve(range_count_ + 1);
    spares_ = new detail::chunk_range;
    ++range_count_;
  }
  detail::chunk_range* take_spare() noexcept {
    detail::chunk_range* const range = spares_;
    spares_ = range->next;
    return range;
  }
  void give_up(detail::chunk_range& range) noexcept {
    range.next = spares_;
    spares_ = &range;
  }
  [[gnu::noinline]] void give_up_ranges(detail::chunk& c) noexcept {
    for (detail::chunk_range* range = c.first; range != nullptr;) {
      detail::chunk_range& gone = *range;
      range = range->next;
      give_up(gone);
    }
    c.first = nullptr;
  }
  /// \param previous  null: the first of the chunk
  detail::chunk_range& add_range(detail::chunk& c, detail::chunk_range* previous, std::size_t offset,
                                 std::size_t bytes) noexcept {
    detail::chunk_range& range = *take_spare();
    detail::chunk_range*& link = previous != nullptr ? previous->next : c.first;
    range = {&c, offset, bytes, false, previous, link};
    if (link != nullptr) link->previous = &range;
    link = &range;
    return range;
  }
  /// Shortens a range that is not among the free ones; what is left over becomes a free range behind it.
  [[gnu::noinline]] void cut(detail::chunk_range& range, std::size_t bytes) noexcept {
    put_in(add_range(*range.owner, &range, range.offset + bytes, range.bytes - bytes));
    range.bytes = bytes;
  }
  /// The free neighbour becomes a part of the range.
  [[gnu::noinline]] void absorb(detail::chunk_range& range, detail::chunk_range& neighbour) noexcept {
    take_out(neighbour);
    if (neighbour.offset < range.offset) range.offset = neighbour.offset;
    range.bytes += neighbour.bytes;
    (neighbour.previous != nullptr ? neighbour.previous->next : range.owner->first) = neighbour.next;
    if (neighbour.next != nullptr) neighbour.next->previous = neighbour.previous;
    give_up(neighbour);
  }
  void put_in(detail::chunk_range& range) noexcept {
    range.free = true;
    free_.insert(range);
  }
  void take_out(detail::chunk_range& range) noexcept {
    range.free = false;
    free_.erase(range);
  }
  chunk_block hand_out(detail::chunk_range& range) noexcept {
    used_bytes_ += range.bytes;
    ++block_count_;
    if (range.owner->blocks++ == 0) --empty_chunks_;
    return {range.owner->data + range.offset, range.bytes, &range, range.owner};
  }

  std::pmr::memory_resource* resource_;
  std::size_t chunk_bytes_, limit_;
  std::size_t reserved_bytes_ = 0, peak_bytes_ = 0, used_bytes_ = 0;
  std::size_t block_count_ = 0, next_number_ = 0, empty_chunks_ = 0;
  std::size_t range_count_ = 0;  ///< in chunks and spare
  detail::free_ranges free_;
  detail::chunk_range* spares_ = nullptr;
  detail::chunk* spare_chunk_ = nullptr;
  plain_vector<detail::chunk*> chunks_;
};

TURBOMAP_END_NAMESPACE

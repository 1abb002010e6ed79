// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Cuts large chunks of memory into blocks. The memory may be a device's: the host never touches it, so all bookkeeping
/// is outside of it.

#include <cstddef>
#include <iterator>
#include <list>
#include <memory>
#include <memory_resource>
#include <new>
#include <utility>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../memory.hpp"
#include "chunk_range.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Best fit with coalescing, O(log n) in the number of free ranges. Grows by whole chunks, within a limit. Not thread
/// safe.
class chunk_allocator {
 public:
  static constexpr std::size_t alignment = 256;
  enum class growth { done, over_limit, refused };

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
    for (const auto& c : chunks_) resource_->deallocate(c->data, c->bytes, alignment);
  }

  /// A block of at least `bytes`, growing when nothing fits. Throws out_of_memory when it cannot, with nothing changed.
  chunk_block allocate(std::size_t bytes) {
    chunk_block block = try_allocate(bytes);
    if (!block && try_grow(bytes) == growth::done) block = try_allocate(bytes);
    if (!block) throw out_of_memory("keyframe store", bytes);
    return block;
  }

  /// The same without growing: an empty block when nothing fits.
  chunk_block try_allocate(std::size_t bytes) {
    bytes = align_up(bytes == 0 ? 1 : bytes, alignment);
    const auto found = free_.lower_bound(bytes);
    if (found == free_.end()) return {};
    detail::chunk_range& range = **found;
    if (range.bytes > bytes) reserve_spares(1);  // the only thing that can throw
    take_out(range);
    if (range.bytes > bytes) cut(range, bytes);
    return hand_out(range);
  }

  /// One more chunk, large enough for `bytes`. Only host memory for the bookkeeping can make it throw.
  growth try_grow(std::size_t bytes) {
    bytes = align_up(bytes == 0 ? 1 : bytes, alignment);
    std::size_t size = bytes > chunk_bytes_ ? bytes : chunk_bytes_;
    if (size > limit_ - reserved_bytes_) size = limit_ - reserved_bytes_;
    if (size < bytes) return growth::over_limit;
    reserve_spares(1);
    auto grown = std::make_unique<detail::chunk>(detail::chunk{nullptr, size, next_number_, 0, {}});
    chunks_.reserve(chunks_.size() + 1);
    try {
      grown->data = static_cast<std::byte*>(resource_->allocate(size, alignment));
    } catch (const std::bad_alloc&) {
      return growth::refused;
    }
    ++next_number_;
    ++empty_chunks_;
    reserved_bytes_ += size;
    if (reserved_bytes_ > peak_bytes_) peak_bytes_ = reserved_bytes_;
    detail::chunk& c = *grown;
    chunks_.push_back(std::move(grown));
    put_in(add_range(c, c.ranges.end(), 0, size));
    return growth::done;
  }

  /// Gives a block back, O(log n). Chunks stay until release_empty().
  void deallocate(const chunk_block& block) noexcept {
    detail::chunk& c = *block.owner;
    const auto range = block.range->self;
    used_bytes_ -= range->bytes;
    --block_count_;
    if (--c.blocks == 0) ++empty_chunks_;
    if (range != c.ranges.begin() && std::prev(range)->free) absorb(c, range, std::prev(range));
    if (std::next(range) != c.ranges.end() && std::next(range)->free) absorb(c, range, std::next(range));
    put_in(*range);
  }

  /// Undoes deallocate(): takes the very same bytes again and updates the block. They must all be free, and the blocks
  /// handed out since must have been given back. Linear in the pieces of the chunk.
  void claim(chunk_block& block) noexcept {
    detail::chunk& c = *block.owner;
    const std::size_t offset = static_cast<std::size_t>(block.data - c.data);
    auto range = c.ranges.begin();
    while (range->offset + range->bytes <= offset) ++range;
    take_out(*range);
    if (range->offset < offset) {
      cut(*range, offset - range->offset);
      put_in(*range);
      ++range;
      take_out(*range);
    }
    if (range->bytes > block.bytes) cut(*range, block.bytes);
    block = hand_out(*range);
  }

  /// Returns empty chunks to the resource, all but the `keep` oldest of them.
  void release_empty(std::size_t keep) noexcept {
    for (std::size_t i = 0; empty_chunks_ > keep && i < chunks_.size();) {
      detail::chunk& c = *chunks_[chunks_.size() - 1 - i];  // the youngest first
      if (c.blocks != 0) {
        ++i;
        continue;
      }
      --empty_chunks_;
      take_out(c.ranges.front());
      spares_.splice(spares_.begin(), c.ranges);
      reserved_bytes_ -= c.bytes;
      resource_->deallocate(c.data, c.bytes, alignment);
      chunks_.erase(chunks_.end() - 1 - static_cast<std::ptrdiff_t>(i));
    }
  }

  /// Whether a chunk for `bytes` can take the place of the empty ones: within the limit; when the resource has
  /// `refused` more, for no more than it gets back.
  bool empty_chunks_suffice(std::size_t bytes, bool refused) const {
    std::size_t empty = 0;
    for (const auto& c : chunks_) empty += c->blocks == 0 ? c->bytes : 0;
    return empty > 0 && (refused ? 0 : limit_ - reserved_bytes_) + empty >= align_up(bytes, alignment);
  }
  /// Whether nothing else is in the chunk of a block that was given back.
  bool in_empty_chunk(const chunk_block& block) const { return block.owner->blocks == 0; }

  std::size_t reserved_bytes() const { return reserved_bytes_; }  ///< in all chunks
  std::size_t peak_bytes() const { return peak_bytes_; }          ///< the most ever reserved
  std::size_t used_bytes() const { return used_bytes_; }          ///< in all blocks
  std::size_t block_count() const { return block_count_; }
  std::size_t chunk_count() const { return chunks_.size(); }
  std::size_t free_range_count() const { return free_.size(); }
  std::size_t empty_chunks() const { return empty_chunks_; }

 private:
  static constexpr std::size_t unlimited = static_cast<std::size_t>(-1);
  using range_iterator = std::list<detail::chunk_range>::iterator;

  /// Makes bookkeeping for `n` more ranges.
  void reserve_spares(std::size_t n) {
    while (spares_.size() < n) {
      std::list<detail::chunk_range> made(1);
      detail::chunk_range* range = &made.front();
      detail::chunk_range_set maker;
      maker.insert(range);
      range->node = maker.extract(maker.begin());
      spares_.splice(spares_.begin(), made);
    }
  }
  detail::chunk_range& add_range(detail::chunk& c, range_iterator before, std::size_t offset,
                                 std::size_t bytes) noexcept {
    const auto range = spares_.begin();
    c.ranges.splice(before, spares_, range);
    range->owner = &c;
    range->offset = offset;
    range->bytes = bytes;
    range->free = false;
    range->self = range;
    return *range;
  }
  /// Shortens a range that is not in the set; what is left over becomes a free range behind it.
  void cut(detail::chunk_range& range, std::size_t bytes) noexcept {
    put_in(add_range(*range.owner, std::next(range.self), range.offset + bytes, range.bytes - bytes));
    range.bytes = bytes;
  }
  void absorb(detail::chunk& c, range_iterator range, range_iterator neighbour) noexcept {
    take_out(*neighbour);
    if (neighbour->offset < range->offset) range->offset = neighbour->offset;
    range->bytes += neighbour->bytes;
    spares_.splice(spares_.begin(), c.ranges, neighbour);
  }
  void put_in(detail::chunk_range& range) noexcept {
    range.free = true;
    range.node.value() = &range;
    free_.insert(std::move(range.node));
  }
  void take_out(detail::chunk_range& range) noexcept {
    range.free = false;
    range.node = free_.extract(free_.find(&range));
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
  detail::chunk_range_set free_;
  std::list<detail::chunk_range> spares_;
  std::vector<std::unique_ptr<detail::chunk>> chunks_;
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What chunk_allocator knows of its memory: chunks, the pieces that they are cut into, the free ones by size.

#include <cstddef>
#include <tuple>

#include "../config.hpp"
#include "../first_where.hpp"
#include "../plain_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {
struct chunk;

/// A piece of a chunk, free or not.
struct chunk_range {
  chunk* owner = nullptr;
  std::size_t offset = 0, bytes = 0;
  bool free = false;
  chunk_range *previous = nullptr, *next = nullptr;  ///< in the chunk, by address; `next` also links spare ones
};

struct chunk {
  std::byte* data = nullptr;
  std::size_t bytes = 0;
  std::size_t number = 0;        ///< ascending by age
  std::size_t blocks = 0;        ///< handed out
  chunk_range* first = nullptr;  ///< its ranges have no gaps
};

/// Free ranges by size, then by age of the chunk, then by address: the first that is not smaller is the best fit. Few
/// enough to be kept in a sorted array: O(log n) comparisons, and pointers that move up by one.
class free_ranges {
 public:
  /// Room for `n` of them: the only thing that throws.
  void reserve(std::size_t n) {
    if (n > sorted_.capacity()) sorted_.reserve(2 * n);
  }
  std::size_t size() const { return sorted_.size(); }
  /// The smallest of at least `bytes`, or null.
  chunk_range* best_fit(std::size_t bytes) const {
    const std::size_t at = first_not_before(bytes, 0, 0);
    return at < sorted_.size() ? sorted_[at] : nullptr;
  }
  [[gnu::noinline]] void insert(chunk_range& r) noexcept {
    const std::size_t at = first_not_before(r.bytes, r.owner->number, r.offset);
    sorted_.push_back(&r);
    for (std::size_t i = sorted_.size() - 1; i > at; --i) sorted_[i] = sorted_[i - 1];
    sorted_[at] = &r;
  }
  [[gnu::noinline]] void erase(const chunk_range& r) noexcept {
    std::size_t at = first_not_before(r.bytes, r.owner->number, r.offset);
    for (; at + 1 < sorted_.size(); ++at) sorted_[at] = sorted_[at + 1];
    sorted_.pop_back();
  }

 private:
  [[gnu::noinline]] std::size_t first_not_before(std::size_t bytes, std::size_t number, std::size_t offset) const {
    return first_where(std::size_t{0}, sorted_.size(), [&](std::size_t i) {
      const chunk_range& r = *sorted_[i];
      return std::tie(r.bytes, r.owner->number, r.offset) >= std::tie(bytes, number, offset);
    });
  }

  plain_vector<chunk_range*> sorted_;
};

}  // namespace detail

/// A block that chunk_allocator handed out.
struct chunk_block {
  std::byte* data = nullptr;             ///< null: no block
  std::size_t bytes = 0;                 ///< a multiple of chunk_allocator::alignment
  detail::chunk_range* range = nullptr;  ///< the allocator's own
  detail::chunk* owner = nullptr;        ///< the allocator's own
  /// Whether there is a block.
  explicit operator bool() const { return data != nullptr; }
};

TURBOMAP_END_NAMESPACE

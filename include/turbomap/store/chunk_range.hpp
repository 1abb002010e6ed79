// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What chunk_allocator knows of its memory: chunks, the pieces that they are cut into, the free ones by size.

#include <cstddef>
#include <list>
#include <set>
#include <tuple>

#include "../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {
struct chunk;
struct chunk_range;

/// Orders ranges by size, then by age of the chunk, then by address: the first that is not smaller is the best fit.
struct chunk_range_less {
  using is_transparent = void;
  inline bool operator()(const chunk_range* a, const chunk_range* b) const;
  inline bool operator()(const chunk_range* a, std::size_t bytes) const;
};
using chunk_range_set = std::set<chunk_range*, chunk_range_less>;

/// A piece of a chunk, free or not. Its node of the set of free ranges is kept here while it is not in the set, so that
/// giving memory back never allocates and never throws.
struct chunk_range {
  chunk* owner = nullptr;
  std::size_t offset = 0, bytes = 0;
  bool free = false;
  std::list<chunk_range>::iterator self;
  chunk_range_set::node_type node;
};

struct chunk {
  std::byte* data;
  std::size_t bytes;
  std::size_t number;             ///< ascending by age
  std::size_t blocks = 0;         ///< handed out
  std::list<chunk_range> ranges;  ///< by address, without gaps
};

bool chunk_range_less::operator()(const chunk_range* a, const chunk_range* b) const {
  return std::tie(a->bytes, a->owner->number, a->offset) < std::tie(b->bytes, b->owner->number, b->offset);
}
bool chunk_range_less::operator()(const chunk_range* a, std::size_t bytes) const { return a->bytes < bytes; }
}  // namespace detail

/// A block that chunk_allocator handed out.
struct chunk_block {
  std::byte* data = nullptr;             ///< null: no block
  std::size_t bytes = 0;                 ///< a multiple of chunk_allocator::alignment
  detail::chunk_range* range = nullptr;  ///< the allocator's own
  detail::chunk* owner = nullptr;        ///< the allocator's own
  explicit operator bool() const { return data != nullptr; }
};

TURBOMAP_END_NAMESPACE

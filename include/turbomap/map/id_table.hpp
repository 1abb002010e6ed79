// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Numbers ids in the order in which they are first named: what lets searches on a user's map work in flat arrays,
/// whatever their keyframes and points are. An open-addressing table that is emptied in O(1).

#include <cstddef>
#include <cstdint>

#include "../plain_vector.hpp"
#include "../prefetch.hpp"

namespace turbomap {

/// From 64-bit ids to places 0, 1, 2...
class id_table {
 public:
  static constexpr std::size_t none = static_cast<std::size_t>(-1);  ///< find() of an id that has no place

  /// Forgets all ids; the memory stays. O(1).
  void clear() {
    size_ = 0;
    if (++epoch_ == 0) {  // once in 2^32 times
      cells_.assign(cells_.size(), cell{});
      epoch_ = 1;
    }
  }
  /// Number of ids named since clear().
  std::size_t size() const { return size_; }

  /// The place of an id; a new id gets place size(). Amortised O(1). Throws std::bad_alloc, unchanged.
  std::size_t place(std::uint64_t id) {
    make_room();
    cell& c = cells_[find_cell(id)];
    if (c.epoch != epoch_) c = {id, static_cast<std::uint32_t>(size_++), epoch_};
    return c.place;
  }
  /// So that the next `more` calls of place() do not throw. Throws std::bad_alloc, unchanged.
  void make_room(std::size_t more = 1) {
    while (2 * (size_ + more) > cells_.size()) grow();
  }
  /// The place of an id, or none.
  std::size_t find(std::uint64_t id) const {
    if (cells_.empty()) return none;
    const cell& c = cells_[find_cell(id)];
    return c.epoch == epoch_ ? c.place : none;
  }
  /// Asks memory for where an id is looked up.
  void prefetch(std::uint64_t id) const {
    if (!cells_.empty()) prefetch_line(&cells_[first_cell(id)]);
  }

 private:
  struct cell {
    std::uint64_t id = 0;
    std::uint32_t place = 0;
    std::uint32_t epoch = 0;
  };

  std::size_t first_cell(std::uint64_t id) const {
    return static_cast<std::size_t>((id * 0x9E3779B97F4A7C15u) >> 32) & (cells_.size() - 1);
  }
  std::size_t find_cell(std::uint64_t id) const {
    const std::size_t mask = cells_.size() - 1;
    std::size_t at = first_cell(id);
    while (cells_[at].epoch == epoch_ && cells_[at].id != id) at = (at + 1) & mask;
    return at;
  }
  void grow() {
    plain_vector<cell> old(cells_.empty() ? 64 : 2 * cells_.size());
    old.swap(cells_);
    for (const cell& c : old)
      if (c.epoch == epoch_) cells_[find_cell(c.id)] = c;
  }

  plain_vector<cell> cells_;
  std::size_t size_ = 0;
  std::uint32_t epoch_ = 1;
};

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From the ids of a user's keyframes or points to their numbers in a mirror. Ids come and go; memory follows those that are
/// there.

#include <cstddef>
#include <cstdint>
#include <utility>

#include "../map/id_table.hpp"
#include "../plain_vector.hpp"

namespace turbomap {

/// A number for each id that is there, -1 for every other. All O(1) amortised.
class id_numbers {
 public:
  static constexpr std::int32_t none = -1;  ///< find() of an id that has no number

  /// The number of an id, or none.
  std::int32_t find(std::uint64_t id) const {
    const std::size_t at = table_.find(id);
    return at == id_table::none ? none : numbers_[at];
  }
  /// So that the next `more` calls of set() do not throw. Throws std::bad_alloc, unchanged.
  void make_room(std::size_t more = 1) {
    if (gone_ > 1024 && 2 * gone_ > ids_.size()) drop_gone();
    const std::size_t size = ids_.size() + more;
    if (ids_.capacity() < size) ids_.reserve(2 * size);
    if (numbers_.capacity() < size) numbers_.reserve(2 * size);
    table_.make_room(more);
  }
  /// Amortised O(1). Throws std::bad_alloc, unchanged.
  void set(std::uint64_t id, std::int32_t number) {
    make_room();
    const std::size_t at = table_.place(id);
    if (at == ids_.size()) {
      ids_.push_back(id), numbers_.push_back(number);
      return;
    }
    gone_ -= numbers_[at] == none && number != none ? 1 : 0;
    numbers_[at] = number;
  }
  /// The id has no number from now on, if it has this one. Does not throw.
  void erase(std::uint64_t id, std::int32_t number) {
    const std::size_t at = table_.find(id);
    if (at == id_table::none || numbers_[at] != number) return;
    numbers_[at] = none;
    ++gone_;
  }
  /// Asks memory for where an id is looked up.
  void prefetch(std::uint64_t id) const { table_.prefetch(id); }

 private:
  void drop_gone() {
    id_table table;
    plain_vector<std::uint64_t> ids;
    plain_vector<std::int32_t> numbers;
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      if (numbers_[i] == none) continue;
      table.place(ids_[i]);
      ids.push_back(ids_[i]), numbers.push_back(numbers_[i]);
    }
    table_ = std::move(table);
    ids_.swap(ids), numbers_.swap(numbers);
    gone_ = 0;
  }

  id_table table_;  ///< places are those of the two lists
  plain_vector<std::uint64_t> ids_;
  plain_vector<std::int32_t> numbers_;
  std::size_t gone_ = 0;
};

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The keyframes of a user's map in a keyframe store: which handle each one has.

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "../error.hpp"
#include "../plain_vector.hpp"
#include "../store/keyframe_handle.hpp"

namespace turbomap {

/// From the ids of map traits to handles: a list by id, since keyframes come with ascending ids. Finds in O(log n), adds in
/// O(1) behind the last id, erases in O(n). Not synchronised.
class handle_table {
 public:
  /// Throws std::invalid_argument when the id has a handle already; std::bad_alloc. Unchanged in both cases.
  void add(std::uint64_t id, keyframe_handle handle) {
    std::size_t at = place(id);
    require(!is_at(at, id), "keyframe id", id, "is in the store already");
    entries_.push_back({id, handle});
    for (std::size_t i = entries_.size() - 1; i > at; --i) entries_[i] = entries_[i - 1];
    entries_[at] = {id, handle};
  }
  /// False, and `handle` is unchanged, when the keyframe is not in the store.
  bool find(std::uint64_t id, keyframe_handle& handle) const {
    const std::size_t at = place(id);
    if (!is_at(at, id)) return false;
    handle = entries_[at].handle;
    return true;
  }
  /// Whether a keyframe is in the store. O(log keyframes).
  bool contains(std::uint64_t id) const { return is_at(place(id), id); }
  /// Throws std::invalid_argument for a keyframe that is not in the store.
  keyframe_handle at(std::uint64_t id) const {
    const std::size_t at = place(id);
    require(is_at(at, id), "keyframe id", id, "is not in the store: insert the keyframe first");
    return entries_[at].handle;
  }
  /// Forgets a keyframe, if it is there. O(keyframes).
  void erase(std::uint64_t id) {
    std::size_t at = place(id);
    if (!is_at(at, id)) return;
    for (; at + 1 < entries_.size(); ++at) entries_[at] = entries_[at + 1];
    entries_.pop_back();
  }
  /// Number of keyframes.
  std::size_t size() const { return entries_.size(); }
  /// Calls f(handle) for each, by ascending id.
  template <class F>
  void for_each_handle(F f) const {
    for (const entry& e : entries_) f(e.handle);
  }
  /// Forgets all.
  void clear() { entries_.clear(); }

 private:
  struct entry {
    std::uint64_t id;
    keyframe_handle handle;
  };

  /// Of the first id that is not smaller.
  std::size_t place(std::uint64_t id) const {
    const auto is_before = [](const entry& e, std::uint64_t other) { return e.id < other; };
    return static_cast<std::size_t>(std::lower_bound(entries_.begin(), entries_.end(), id, is_before) -
                                    entries_.begin());
  }
  bool is_at(std::size_t place, std::uint64_t id) const { return place < entries_.size() && entries_[place].id == id; }

  plain_vector<entry> entries_;
};

}  // namespace turbomap

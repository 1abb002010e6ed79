// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The keyframes of a user's map in a keyframe store: which handle each one has.

#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>

#include "../error.hpp"
#include "../store/keyframe_handle.hpp"

namespace turbomap {

/// From the ids of map traits to handles. Not synchronised.
class handle_table {
 public:
  /// Throws std::invalid_argument when the id has a handle already; std::bad_alloc. Unchanged in both cases.
  void add(std::uint64_t id, keyframe_handle handle) {
    require(handles_.emplace(id, handle).second, "keyframe id", id, "is in the store already");
  }
  /// False, and nothing in `handle`, when the keyframe is not in the store.
  bool find(std::uint64_t id, keyframe_handle& handle) const {
    const auto found = handles_.find(id);
    if (found == handles_.end()) return false;
    handle = found->second;
    return true;
  }
  bool contains(std::uint64_t id) const { return handles_.count(id) != 0; }
  /// Throws std::invalid_argument for a keyframe that is not in the store.
  keyframe_handle at(std::uint64_t id) const {
    const auto found = handles_.find(id);
    require(found != handles_.end(), "keyframe id", id, "is not in the store: insert the keyframe first");
    return found->second;
  }
  void erase(std::uint64_t id) { handles_.erase(id); }
  std::size_t size() const { return handles_.size(); }

 private:
  std::unordered_map<std::uint64_t, keyframe_handle> handles_;
};

}  // namespace turbomap

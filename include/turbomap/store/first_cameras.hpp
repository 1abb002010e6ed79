// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How the first camera of each keyframe of a store is mounted. It has a lock of its own, which nobody holds for long: who asks may
/// hold the map's guard, while the store waits for memory.

#include <cstddef>
#include <cstdint>
#include <mutex>

#include "../plain_vector.hpp"
#include "../types.hpp"
#include "keyframe_handle.hpp"

namespace turbomap {

/// By slot. All members may be called from any thread.
class first_cameras {
 public:
  /// The next set() of this slot does not throw. Throws std::bad_alloc.
  void make_room(std::uint32_t slot) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (entries_.size() <= slot) entries_.resize(std::size_t{slot} + 1);
  }
  /// Of a keyframe whose slot has room.
  void set(keyframe_handle handle, const rigid_transform<double>& T_camera_body) noexcept {
    const std::lock_guard<std::mutex> lock(mutex_);
    entries_[handle.slot] = {handle.generation, T_camera_body};
  }
  /// The keyframe in this slot is gone.
  void forget(std::uint32_t slot) noexcept {
    const std::lock_guard<std::mutex> lock(mutex_);
    entries_[slot].generation = 0;
  }
  /// False, and T_camera_body is unchanged, where the handle names nothing.
  bool find(keyframe_handle handle, rigid_transform<double>& T_camera_body) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (handle.generation == 0 || handle.slot >= entries_.size()) return false;
    const entry& e = entries_[handle.slot];
    if (e.generation != handle.generation) return false;
    T_camera_body = e.T_camera_body;
    return true;
  }

 private:
  struct entry {
    std::uint32_t generation = 0;  // 0: none
    rigid_transform<double> T_camera_body;
  };
  mutable std::mutex mutex_;
  plain_vector<entry> entries_;
};

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a thread needs to bring one keyframe into a store, lent to as many threads as insert at once.

#include <memory_resource>
#include <mutex>

#include "../config.hpp"
#include "gather.hpp"
#include "keyframe_packing.hpp"
#include "memory_space.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A way into the memory of the store and the host memory to pack in.
template <class Descriptor, class Camera, class Memory>
struct insertion_lane {
  /// \param staging  pinned memory for a device store; must outlive this
  explicit insertion_lane(std::pmr::memory_resource* staging) : transfer(staging) {}
  transfer_lane<Memory> transfer;              ///< the way into the store's memory
  keyframe_packing_scratch scratch;            ///< for sorting and counting
  keyframe_buffer<Descriptor, Camera> buffer;  ///< for what the traits give
  insertion_lane* next = nullptr;              ///< idle one
};

/// Lanes that are idle, to be used again: never more than threads that have inserted at the same time. Thread safe.
template <class Descriptor, class Camera, class Memory>
class insertion_lanes {
 public:
  /// One lane of this store.
  using lane_type = insertion_lane<Descriptor, Camera, Memory>;

  /// \param staging  of every lane that is made; must outlive this
  explicit insertion_lanes(std::pmr::memory_resource* staging) : staging_(staging) {}
  insertion_lanes(const insertion_lanes&) = delete;
  insertion_lanes& operator=(const insertion_lanes&) = delete;
  ~insertion_lanes() {
    while (idle_ != nullptr) delete take();
  }

  /// One lane for the life of this object. Throws what making a new one throws.
  class loan {
   public:
    /// An idle lane, or a new one.
    explicit loan(insertion_lanes& lanes) : lanes_(lanes) {
      {
        const std::lock_guard<std::mutex> lock(lanes.mutex_);
        if (lanes.idle_ != nullptr) mine_ = lanes.take();
      }
      if (mine_ == nullptr) mine_ = new lane_type(lanes.staging_);
    }
    loan(const loan&) = delete;
    loan& operator=(const loan&) = delete;
    ~loan() {
      const std::lock_guard<std::mutex> lock(lanes_.mutex_);
      mine_->next = lanes_.idle_;
      lanes_.idle_ = mine_;
    }
    /// The lane.
    lane_type& operator*() { return *mine_; }
    /// The lane.
    lane_type* operator->() { return mine_; }

   private:
    insertion_lanes& lanes_;
    lane_type* mine_ = nullptr;
  };

 private:
  lane_type* take() noexcept {
    lane_type* const first = idle_;
    idle_ = first->next;
    return first;
  }

  std::pmr::memory_resource* staging_;
  std::mutex mutex_;
  lane_type* idle_ = nullptr;
};

TURBOMAP_END_NAMESPACE

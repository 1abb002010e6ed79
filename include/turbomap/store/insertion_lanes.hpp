// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a thread needs to bring one keyframe into a store, lent to as many threads as insert at once.

#include <list>
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
  explicit insertion_lane(std::pmr::memory_resource* staging) : transfer(staging) {}
  transfer_lane<Memory> transfer;
  keyframe_packing_scratch scratch;
  keyframe_buffer<Descriptor, Camera> buffer;
};

/// Lanes that are idle, to be used again: never more than threads that have inserted at the same time. Thread safe.
template <class Descriptor, class Camera, class Memory>
class insertion_lanes {
 public:
  using lane_type = insertion_lane<Descriptor, Camera, Memory>;

  explicit insertion_lanes(std::pmr::memory_resource* staging) : staging_(staging) {}

  /// One lane for the life of this object. Throws what making a new one throws.
  class loan {
   public:
    explicit loan(insertion_lanes& lanes) : lanes_(lanes) {
      {
        const std::lock_guard<std::mutex> lock(lanes.mutex_);
        if (!lanes.idle_.empty()) mine_.splice(mine_.begin(), lanes.idle_, lanes.idle_.begin());
      }
      if (mine_.empty()) mine_.emplace_back(lanes.staging_);
    }
    loan(const loan&) = delete;
    loan& operator=(const loan&) = delete;
    ~loan() {
      const std::lock_guard<std::mutex> lock(lanes_.mutex_);
      lanes_.idle_.splice(lanes_.idle_.begin(), mine_);
    }
    lane_type& operator*() { return mine_.front(); }
    lane_type* operator->() { return &mine_.front(); }

   private:
    insertion_lanes& lanes_;
    std::list<lane_type> mine_;
  };

 private:
  std::pmr::memory_resource* staging_;
  std::mutex mutex_;
  std::list<lane_type> idle_;
};

TURBOMAP_END_NAMESPACE

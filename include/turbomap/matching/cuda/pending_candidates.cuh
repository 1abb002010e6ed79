// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Candidates whose distance can win and whose geometry is still to be looked at, of one warp. Geometry takes long and few
/// candidates need it, one here and one there: they are gathered until every lane of the warp has one.

#include <cstdint>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// A pair that is near enough.
template <class Distance>
struct pending_candidate {
  std::int32_t query;      ///< number among the queries of the warp or block
  std::int32_t candidate;  ///< as pushed: a keypoint of the neighbour, or its place in search_view::candidates
  Distance distance;
};

/// A stack in shared memory; all lanes know its height. \tparam Pushed  the most that are pushed between two calls of full()
template <class Distance, int Pushed>
class pending_candidates {
 public:
  static constexpr int capacity = warp_size - 1 + Pushed;
  using entry = pending_candidate<Distance>;

  /// \param room  shared memory of this warp, `capacity` entries
  __device__ explicit pending_candidates(entry* room) : room_(room) {}

  /// Takes the entries of those lanes that have one.
  __device__ void push(bool has, const entry& mine) {
    const unsigned which = __ballot_sync(whole_warp, has);
    const unsigned before = (1U << threadIdx.x % warp_size) - 1;
    if (has) room_[count_ + __popc(which & before)] = mine;
    count_ += __popc(which);
  }
  /// Every lane can have one.
  __device__ bool full() const { return count_ >= warp_size; }
  __device__ bool empty() const { return count_ == 0; }
  /// Gives each lane one, as far as they go. False: none for this lane.
  __device__ bool pop(entry& mine) {
    __syncwarp();
    const int lane = static_cast<int>(threadIdx.x) % warp_size;
    const bool has = lane < count_;
    if (has) mine = room_[count_ - 1 - lane];
    count_ = count_ > warp_size ? count_ - warp_size : 0;
    __syncwarp();
    return has;
  }

 private:
  entry* room_;
  int count_ = 0;
};

}  // namespace detail

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// staged_columns: the columns of slots that a warp reads out of order, by way of shared memory. Lanes that follow each other
/// copy numbers that follow each other; where each lane read a slot of its own from device memory, every access would touch as
/// many lines of the cache as there are lanes.

#include <cuda_pipeline.h>

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "load_numbers.cuh"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// In shared memory: a slot for each of `Lanes` lanes of a warp. \tparam V  numbers of a column; a slot has three
template <class A, int V, int Lanes>
class staged_columns {
  static constexpr int numbers = 3 * V;
  static constexpr int at_once = numbers % 2 == 0 ? 2 : 1;  // numbers
  static constexpr int copies = numbers / at_once;          // of a slot

 public:
  /// Begins to copy the slots that lanes [first, first + Lanes) name, of those below `count`. All lanes of the warp take part;
  /// see __pipeline_commit().
  __device__ void copy(const A* columns, int slot, int first, int count) {
    const int lane = static_cast<int>(threadIdx.x) % warp_size;
#pragma unroll
    for (int i = 0; i < (copies * Lanes + warp_size - 1) / warp_size; ++i) {
      const int at = i * warp_size + lane, own = at / copies;
      const int from = __shfl_sync(whole_warp, slot, first + own);
      if (own < Lanes && first + own < count)
        __pipeline_memcpy_async(data_ + at * at_once,
                                columns + static_cast<std::ptrdiff_t>(from) * numbers + at % copies * at_once,
                                at_once * sizeof(A));
    }
  }
  /// A column of the slot of a lane, once the copies of all lanes are there. \param own  from `first` on
  __device__ void load(int own, int column, A (&to)[V]) const { load_numbers(data_ + own * numbers + column * V, to); }

 private:
  alignas(2 * sizeof(A)) A data_[Lanes * numbers];
};

}  // namespace detail

TURBOMAP_END_NAMESPACE

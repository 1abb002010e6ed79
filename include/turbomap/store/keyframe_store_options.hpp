// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Options and statistics of the keyframe store: plain data, for .cpp and .cu alike.

#include <cstddef>
#include <cstdint>
#include <memory_resource>

#include "../config.hpp"
#include "../types.hpp"

namespace turbomap {

/// How keyframes are packed; the same for all keyframes of a store.
struct keyframe_packing_options {
  int grid_columns = 64;      ///< cells per image row [ORB-SLAM3]; 0: no cell index
  int grid_rows = 48;         ///< cells per image column [ORB-SLAM3]; 0: no cell index
  turbomap::pyramid pyramid;  ///< octaves must be below its levels
};

/// How a keyframe store is set up.
struct keyframe_store_options {
  /// Most bytes of the policy's memory that the store reserves, chunks included; 0: no limit. Beyond it the least
  /// recently used keyframes that are not pinned are paged out to host memory.
  std::size_t byte_budget = 0;
  /// Memory is reserved in chunks of this many bytes: about 170 keyframes of 1200 ORB keypoints, and an allocation
  /// seldom enough that its cost does not show. A larger keyframe gets a chunk of its own.
  std::size_t chunk_bytes = std::size_t{16} << 20;
  keyframe_packing_options packing;               ///< what is computed and kept with each keyframe.
  std::pmr::memory_resource* resident = nullptr;  ///< the policy's memory; null: its default
  /// Host memory for those paged out; null: pinned for CUDA, else the default.
  std::pmr::memory_resource* paging = nullptr;
  std::pmr::memory_resource* staging = nullptr;  ///< host memory to pack uploads in (CUDA only); null: pinned
};

/// What a keyframe store holds and has done.
struct keyframe_store_statistics {
  std::size_t keyframes = 0;           ///< alive
  std::size_t resident_blocks = 0;     ///< keyframes in the policy's memory, erased ones that are still read included
  std::size_t paged_blocks = 0;        ///< keyframes paged out
  std::size_t resident_bytes = 0;      ///< of resident_blocks
  std::size_t paged_bytes = 0;         ///< of paged_blocks
  std::size_t chunk_bytes = 0;         ///< reserved in the policy's memory
  std::size_t peak_chunk_bytes = 0;    ///< the most ever reserved there
  std::size_t paging_chunk_bytes = 0;  ///< reserved in host memory for paging
  std::size_t pinned_sets = 0;         ///< pinned_keyframes that are alive, or whose work has not been seen to end
  std::uint64_t uploads = 0;           ///< insertions so far, one copy each
  std::uint64_t page_ins = 0;          ///< keyframes brought back so far
  std::uint64_t page_outs = 0;         ///< keyframes paged out so far
  double bytes_per_keyframe = 0;       ///< mean over resident and paged blocks
};

}  // namespace turbomap

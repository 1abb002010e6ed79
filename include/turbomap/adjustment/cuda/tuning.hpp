// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How adjustments are laid out for a CUDA device, and launch shapes of their kernels.

#include <cstddef>
#include <cstdint>

#include "../../config.hpp"
#include "../../memory.hpp"
#include "../factor_sums.hpp"
#include "../structure.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One partial sum per chunk. Reprojections have a lane per observation of it (linearise_tuning), other factors and chi2 a
/// thread per chunk.
template <>
struct observation_shape<device_memory> {
  static constexpr int lanes = 1;                    ///< a thread per observation
  static constexpr int chunk = observation_padding;  ///< observations of a chunk
};

/// launch_sum_frames, launch_sum_and_eliminate: one block per frame. Its warps take the partial sums of the frame in turn, a lane
/// one element of each; a block of that size has the landmarks of four of landmark_tuning.
struct sum_frames_tuning {
  static constexpr int warps = 16;  ///< per block
};

/// launch_linearise_reprojections, launch_sum_reprojection_cost: a lane per observation of a chunk.
struct linearise_tuning {
  static constexpr int lanes = observation_padding;  ///< per chunk
  static constexpr int threads = 128;                ///< per block
};

/// launch_eliminate_landmarks, launch_substitute_landmarks: 8 lanes per landmark, which free frames see 5 to 30 times. A block
/// has the landmarks of one index of substitute_landmarks.
struct landmark_tuning {
  static constexpr int lanes = 8;                    ///< per landmark
  static constexpr int landmarks = 16;               ///< per block
  static constexpr int threads = lanes * landmarks;  ///< per block
};

/// launch_reduce_blocks: 4 warps per block of the matrix. Lists have up to a thousand entries, and a window about 500 blocks:
/// one warp per scheduler of a large device if each had one.
struct reduce_blocks_tuning {
  static constexpr int warps = 4;           ///< per block
  static constexpr int most_unknowns = 12;  ///< of a frame: a thread keeps their square; for more the generic body
  /// Blocks per multiprocessor, which registers are limited for.
  template <class A, int V>
  static constexpr int at_once = V > 6            ? 1
                                 : sizeof(A) == 4 ? 4
                                                  : 3;
};

/// launch_multiply_frames: a block per frame, which has hundreds to thousands of slots. (launch_gather_landmarks: landmark_tuning)
struct schur_product_tuning {
  static constexpr int warps = 8;  ///< per block
};

/// launch_begin_gradients, one block; launch_gradient_iteration: a thread per frame, and each block sums parts of all frames.
struct gradient_tuning {
  static constexpr int begin_threads = 1024;  ///< of the one block
  static constexpr int threads = 128;         ///< per block
};

/// launch_adjust_poses: a cluster of blocks per frame, which has a few hundred to a thousand observations: most threads have one.
/// The same for one frame and for thousands, so that the bits of a frame do not depend on the others.
struct adjust_poses_tuning {
  static constexpr int blocks = 4;   ///< per frame
  static constexpr int warps = 5;    ///< per block
  static constexpr int at_once = 2;  ///< blocks per multiprocessor: what registers are limited for
};

/// launch_list_blocks: a warp per two of up to `frames` free frames, whose table of slots has a row each; one block scans the
/// lengths of their lists.
struct list_blocks_tuning {
  static constexpr int threads = 256;        ///< per block
  static constexpr int scan_threads = 1024;  ///< of the block that scans
  static constexpr int frames = 128;         ///< the most that the table has rows for
  /// Numbers of the table, of 4 bytes each: the host's lists are smaller where it would be larger.
  static constexpr std::size_t most_of_table = std::size_t{1} << 26;
};

/// launch_order_observations: a warp per landmark compares each two of its rows, up to `most_rows`; a block per frame and kind
/// goes through all rows, at most `most_looks` in all: a millisecond or so. The last block of two of the kernels scans.
struct order_observations_tuning {
  static constexpr int threads = 128;                                ///< of a block of landmarks
  static constexpr int bin_threads = 1024;                           ///< of the block of a frame and kind
  static constexpr int scan_threads = 1024;                          ///< of a block of which one scans
  static constexpr int most_rows = 4096;                             ///< of a landmark
  static constexpr std::int64_t most_looks = std::int64_t{1} << 29;  ///< at rows, in all
};

/// launch_sum_step, launch_survey_frames: one block, which has some thousands of numbers to add up.
struct sum_step_tuning {
  static constexpr int threads = 1024;  ///< per block
};

/// launch_linearise_frame_factors: a block per factor; between two frames of 15 unknowns there are 495 products to sum.
struct frame_factor_tuning {
  static constexpr int threads = 256;  ///< per block
};

/// launch_solve_dense: a block of 16 warps, a warp per tile. Systems of up to `unknowns` (25 frames of 15, 64 of 6); larger ones
/// the host solves. The tiles of a full system fit the shared memory of a block for up to 224 unknowns where it has 227 KiB, 192
/// where it has 163, 144 where it has 99, 112 where it has 64; larger systems are taken in parts.
struct solve_dense_tuning {
  static constexpr int threads = 512;   ///< per block
  static constexpr int unknowns = 384;  ///< the most that a block solves
};

TURBOMAP_END_NAMESPACE

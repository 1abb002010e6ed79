// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What factors are summed into: partial sums of the normal equations, per chunk of observations, per observation and per
/// factor of frames, and partial costs. Everything has its fixed place; sums over several places follow the lists of
/// structure.hpp. Symmetric matrices are lower triangles, row by row; b is the negative gradient.

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/pack.hpp"
#include "../memory.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A landmark takes this many doubles: one aligned vector.
inline constexpr int landmark_stride = 4;

/// How observations are computed in a memory. The host computes packs of them, a thread of a device one.
template <class Memory>
struct observation_shape;
/// Packs of eight where the compiler has vectors.
template <>
struct observation_shape<host_memory> {
  static constexpr int lanes = TURBOMAP_VECTOR_BYTES > 0 ? 8 : 1;  ///< observations computed at once
  static constexpr int chunk = 128;                                ///< observations of a chunk
};

/// Sizes of what a factor with landmarks gives, V = unknowns of the frame that it depends on.
template <int V>
struct landmark_block {
  static constexpr int triangle = V * (V + 1) / 2;  ///< numbers of the frame's H
  static constexpr int partial = triangle + V;      ///< of a chunk: H of the frame, b of the frame
  static constexpr int row = 9;                     ///< of an observation: H of the landmark (6), b of the landmark (3)
  static constexpr int coupling = 3 * V;            ///< of an observation: column by column, d_frame^T w d_landmark
};

/// Sizes of what a factor of frames gives, D = unknowns of a frame.
template <int D>
struct frame_block {
  static constexpr int triangle = D * (D + 1) / 2;  ///< numbers of a frame's H
  static constexpr int partial = triangle + D;      ///< H (lower triangle) and b of one frame
  static constexpr int square = D * D;              ///< of a pair: d_first^T w d_second, row-major
};

/// Where all groups write. \tparam A  numbers of the normal equations of landmarks
template <class A>
struct factor_sums {
  double* chunk_partial;   ///< [chunk of all groups] landmark_block::partial
  A* row;                  ///< [row] landmark_block::row
  A* coupling;             ///< [coupling] landmark_block::coupling; null: made of rows (row_couplings.hpp)
  double* factor_partial;  ///< [factor partial] frame_block::partial
  double* factor_square;   ///< [factor between two frames] frame_block::square
};

/// Robust costs: of chunks, then of factors of frames.
struct cost_sums {
  double* cost;       ///< robust costs
  double* undefined;  ///< how many observations were not defined
};

/// Where the sums of one group begin, and which of the groups with landmarks it is.
struct group_place {
  double distance = 0;           ///< typical one of a landmark from a frame that sees it, in units of the map
  int landmark_group = 0;        ///< number among the groups with landmarks
  int first_chunk = 0;           ///< among those of all groups
  int first_cost = 0;            ///< of a group of factors of frames
  int first_factor_partial = 0;  ///< the same
  int first_square = 0;          ///< the same
};

/// Frames and landmarks where the policy computes.
template <class Frame>
struct estimate_view {
  typename Frame::template state<double>* states;  ///< [frame]
  isometry<double>* poses;                         ///< of the states, their quaternions normalised
  double* landmarks;                               ///< landmark_stride numbers each
};

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/tuning.hpp"
#endif

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Where a full reduced system is solved: on the host (dense_cholesky.hpp), unless the policy has a solver of its own.

#include <cstddef>

#include "../config.hpp"
#include "../context.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A full symmetric system in the memory of the policy.
struct dense_equations {
  double* S;         ///< lower triangle, column by column of `stride` numbers; overwritten
  double* x;         ///< the right hand side, then the solution
  double* solved;    ///< 1, or 0: singular or not positive definite
  int n;             ///< unknowns
  int stride;        ///< a multiple of 8; so many columns have room
  double tolerance;  ///< see dense_cholesky::factorise
  /// Of frames with more unknowns than landmarks see: room for the matrix in an unknown_order, ordered_room(stride) numbers.
  /// Null: solved in the order that it has.
  double* ordered = nullptr;
  int frames = 0;                  ///< with `ordered`: how many, n / frames unknowns each
  int seen = 0;                    ///< with `ordered`: the first unknowns of each, those that landmarks see
  const double* lambda = nullptr;  ///< see schur_view: NaN there, and nothing is solved

  static constexpr int most_tiles = 32;  ///< in a row of the matrix: bits of a word
  /// Numbers that `ordered` has room for: the matrix, and which of its tiles are not zero.
  static std::size_t ordered_room(int stride) {
    return static_cast<std::size_t>(stride) * static_cast<std::size_t>(stride) + most_tiles * most_tiles / 2;
  }
};

/// Solves S x = b where the policy computes. False: it leaves that to the host, and nothing was launched.
template <class Derived>
bool launch_solve_dense(const thrust::execution_policy<Derived>&, const dense_equations&) {
  return false;
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/solve_dense.cuh"
#endif

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What conjugate gradients do with vectors of the free frames, D numbers per frame: combine them, take their inner products
/// (one part per frame; who decides by them sums them), apply the block-Jacobi preconditioner.

#include <cstddef>

#include "../config.hpp"
#include "../parallel.hpp"
#include "small_cholesky.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = free frame: replaces its diagonal block by the Cholesky factor; `good`: 1, or 0 where there is none.
template <int D>
struct factorise_diagonal_blocks {
  double* blocks;  ///< [free frame] D x D, row by row
  double* good;    ///< [free frame]

  /// Free frame f.
  TURBOMAP_HD void operator()(int f) const {
    good[f] = factorise_small<D>(blocks + static_cast<std::ptrdiff_t>(f) * D * D) ? 1 : 0;
  }
};

/// Index = free frame: z = M^-1 r by the factors, and its part of r z.
template <int D>
struct precondition_frames {
  const double* factors;  ///< [free frame] D x D, row by row
  const double* r;        ///< D per free frame
  double* z;              ///< D per free frame
  double* product;        ///< [free frame]

  /// Free frame f.
  TURBOMAP_HD void operator()(int f) const {
    const double* L = factors + static_cast<std::ptrdiff_t>(f) * D * D;
    const double* from = r + static_cast<std::ptrdiff_t>(f) * D;
    double y[D], sum = 0;
    for (int i = 0; i < D; ++i) y[i] = from[i];
    solve_lower<D>(L, y);
    solve_upper<D>(L, y);
    for (int i = 0; i < D; ++i) z[static_cast<std::ptrdiff_t>(f) * D + i] = y[i], sum += y[i] * from[i];
    product[f] = sum;
  }
};

/// Index = free frame: to = a + s b, and its part of a b (of the vectors as they were).
template <int D>
struct combine_frames {
  const double* a;  ///< D per free frame
  double s;         ///< factor of b
  const double* b;  ///< D per free frame
  double* to;       ///< D per free frame; may be a or b
  double* product;  ///< may be null

  /// Free frame f.
  TURBOMAP_HD void operator()(int f) const {
    double sum = 0;
    for (int i = f * D; i < (f + 1) * D; ++i) {
      sum += a[i] * b[i];
      to[i] = a[i] + s * b[i];
    }
    if (product != nullptr) product[f] = sum;
  }
};

/// Factorises the diagonal blocks in place.
template <int D, class Derived>
void launch_factorise_blocks(const thrust::execution_policy<Derived>& policy, int free_frames, double* blocks,
                             double* good) {
  for_each_index(derived(policy), free_frames, factorise_diagonal_blocks<D>{blocks, good});
}

/// z = M^-1 r, and the parts of the inner product r z.
template <int D, class Derived>
void launch_precondition_frames(const thrust::execution_policy<Derived>& policy, int free_frames, const double* factors,
                                const double* r, double* z, double* product) {
  for_each_index(derived(policy), free_frames, precondition_frames<D>{factors, r, z, product});
}

/// to = a + s b, and the parts of the inner product a b where `product` is not null.
template <int D, class Derived>
void launch_combine_frames(const thrust::execution_policy<Derived>& policy, int free_frames, const double* a, double s,
                           const double* b, double* to, double* product) {
  for_each_index(derived(policy), free_frames, combine_frames<D>{a, s, b, to, product});
}

TURBOMAP_END_NAMESPACE

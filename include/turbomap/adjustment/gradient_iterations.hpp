// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Conjugate gradients for policies whose memory the host does not read. The sums that decide stay where the policy computes; the
/// host enqueues an iteration while the one before it runs, and hears of each whether it was the last. So the device does not wait for
/// the host; the one iteration that is enqueued after the last one finds that there is nothing to do.

#include <cstdint>

#include "../config.hpp"
#include "../memory.hpp"
#include "damping.hpp"
#include "schur_view.hpp"
#include "step_sums.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// How far conjugate gradients are.
struct gradient_state {
  double rz;                ///< r M^-1 r of the residual r
  double enough;            ///< the end where it is no more than this
  std::int32_t iterations;  ///< done
  std::int32_t ended;       ///< not 0: there is nothing left to do
  std::int32_t solvable;    ///< 0: a diagonal block is not positive definite, and x means nothing
  std::int32_t unused;      ///< no bytes that nobody writes
};

/// The vectors of one system, in the memory of the policy: D numbers per free frame where nothing else is said.
struct gradient_vectors {
  int free_frames;        ///< frames
  const double* factors;  ///< [free frame] Cholesky factor of its diagonal block, D x D
  double* x;              ///< the solution
  double* r;              ///< residual
  double* z;              ///< M^-1 r
  double* p;              ///< direction
  double* q;              ///< S p
  double* product;   ///< [free frame] parts of p q; before the first iteration 1, or 0 where the block has no factor
  double* residual;  ///< [free frame] parts of r z
  gradient_state* states;  ///< 2, in turns: that of before, and what becomes of it
  std::int32_t* lost;      ///< 1: p q of this iteration is lost to rounding
};

/// The state before the first iteration, to states[0] and to the host. Only under policies whose memory the host does not read, as
/// launch_gradient_iteration(): see cuda/gradient_iterations.cuh. \param tolerance  relative, of the residual
template <class Derived>
void launch_begin_gradients(const thrust::execution_policy<Derived>& policy, const gradient_vectors& vectors,
                            double tolerance, awaited<gradient_state>* to);

/// One iteration, of which the state goes to states[1 - turn] and to the host; none where states[turn] has ended.
/// \param y  room for 3 numbers per landmark
template <int V, int D, class Derived, class A>
void launch_gradient_iteration(const thrust::execution_policy<Derived>& policy, const schur_view<A>& s,
                               const damping& damping, double* y, const gradient_vectors& vectors, int turn,
                               awaited<gradient_state>* to);

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/gradient_iterations.cuh"
#endif

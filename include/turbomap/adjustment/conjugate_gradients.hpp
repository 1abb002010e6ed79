// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Conjugate gradients on the reduced system without forming it: S p = H p - Z (Z^T p), preconditioned by the diagonal
/// blocks of S. For problems whose reduced matrix would not fit, or whose factor would fill up.

#include <cmath>
#include <cstddef>
#include <vector>

#include "host_sums.hpp"
#include "linear_solver.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = landmark: y = sum of Z^T p over the frames that see it.
template <class A, int V, int D>
struct gather_landmarks {
  schur_view<A> s;
  const double* p;
  double* y;

  TURBOMAP_HD void operator()(int l) const {
    double sum[3] = {};
    for (int slot = s.landmark_slot[l]; slot < s.landmark_slot[l + 1]; ++slot) {
      const A* z = s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V;
      const double* x = p + static_cast<std::ptrdiff_t>(s.slot_frame[slot]) * D;
      for (int m = 0; m < 3; ++m)
        for (int v = 0; v < V; ++v) sum[m] += static_cast<double>(z[m * V + v]) * x[v];
    }
    for (int m = 0; m < 3; ++m) y[static_cast<std::ptrdiff_t>(l) * 3 + m] = sum[m];
  }
};

/// Index = free frame: q = S p.
template <class A, int V, int D>
struct multiply_frames {
  schur_view<A> s;
  const double* p;
  const double* y;
  turbomap::damping damping;
  double* q;

  TURBOMAP_HD void operator()(int f) const {
    const double* H = s.H + static_cast<std::ptrdiff_t>(f) * frame_block<D>::triangle;
    const double* x = p + static_cast<std::ptrdiff_t>(f) * D;
    double sum[D];
    for (int r = 0; r < D; ++r) {
      sum[r] = damping(H[r * (r + 3) / 2]) * x[r];
      for (int c = 0; c < D; ++c) sum[r] += H[r >= c ? r * (r + 1) / 2 + c : c * (c + 1) / 2 + r] * x[c];
    }
    for (int k = s.frame_pair[f]; k < s.frame_pair[f + 1]; ++k) {
      const frame_neighbour& n = s.frame_pair_list[k];
      const double* square = s.factor_square + static_cast<std::ptrdiff_t>(n.factor) * D * D;
      const double* other = p + static_cast<std::ptrdiff_t>(n.other) * D;
      for (int r = 0; r < D; ++r)
        for (int c = 0; c < D; ++c) sum[r] += (n.is_first != 0 ? square[r * D + c] : square[c * D + r]) * other[c];
    }
    for (int k = s.frame_slot[f]; k < s.frame_slot[f + 1]; ++k) {
      const int slot = s.slot_list[k];
      const A* z = s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V;
      const double* l = y + static_cast<std::ptrdiff_t>(s.slot_landmark[slot]) * 3;
      for (int m = 0; m < 3; ++m)
        for (int v = 0; v < V; ++v) sum[v] -= static_cast<double>(z[m * V + v]) * l[m];
    }
    for (int r = 0; r < D; ++r) q[static_cast<std::ptrdiff_t>(f) * D + r] = sum[r];
  }
};

/// Index = free frame: replaces its diagonal block by the Cholesky factor; `good`: 1, or 0 where there is none.
template <int D>
struct factorise_diagonal_blocks {
  double* blocks;
  double* good;

  TURBOMAP_HD void operator()(int f) const {
    double* l = blocks + static_cast<std::ptrdiff_t>(f) * D * D;
    good[f] = 0;
    for (int j = 0; j < D; ++j) {
      for (int i = j; i < D; ++i)
        for (int m = 0; m < j; ++m) l[i * D + j] -= l[i * D + m] * l[j * D + m];
      if (!(l[j * D + j] > 0) || !detail::is_finite(l[j * D + j])) return;
      l[j * D + j] = ::sqrt(l[j * D + j]);
      for (int i = j + 1; i < D; ++i) l[i * D + j] /= l[j * D + j];
    }
    good[f] = 1;
  }
};

/// Index = free frame: z = M^-1 r by the factors, and its part of r z.
template <int D>
struct precondition_frames {
  const double* factors;
  const double* r;
  double* z;
  double* product;

  TURBOMAP_HD void operator()(int f) const {
    const double* l = factors + static_cast<std::ptrdiff_t>(f) * D * D;
    double y[D], sum = 0;
    for (int i = 0; i < D; ++i) {
      y[i] = r[static_cast<std::ptrdiff_t>(f) * D + i];
      for (int j = 0; j < i; ++j) y[i] -= l[i * D + j] * y[j];
      y[i] /= l[i * D + i];
    }
    for (int i = D - 1; i >= 0; --i) {
      for (int j = i + 1; j < D; ++j) y[i] -= l[j * D + i] * y[j];
      y[i] /= l[i * D + i];
    }
    for (int i = 0; i < D; ++i) z[static_cast<std::ptrdiff_t>(f) * D + i] = y[i], sum += y[i] * r[f * D + i];
    product[f] = sum;
  }
};

/// Index = free frame: to = a + s b, and its part of a b (of the vectors as they were).
template <int D>
struct combine_frames {
  const double* a;
  double s;
  const double* b;
  double* to;
  double* product;  ///< may be null

  TURBOMAP_HD void operator()(int f) const {
    double sum = 0;
    for (int i = f * D; i < (f + 1) * D; ++i) {
      sum += a[i] * b[i];
      to[i] = a[i] + s * b[i];
    }
    if (product != nullptr) product[f] = sum;
  }
};

/// Solves to a relative residual, in the norm of the preconditioner.
template <class A, int V, int D, class Policy>
class pcg_reduced_solver {
 public:
  pcg_reduced_solver(context<Policy>& ctx, const schur_view<A>& s, int landmarks, reduced_workspace<D>& workspace,
                     double tolerance, int max_iterations)
      : s_(s), workspace_(workspace), landmarks_(landmarks), tolerance_(tolerance), max_iterations_(max_iterations) {
    const std::size_t f = static_cast<std::size_t>(s.free_frames), n = f * D;
    for (double** v : {&x_, &r_, &z_, &p_, &q_}) *v = ctx.template scratch<double>(n);
    blocks_ = ctx.template scratch<double>(n * D);
    product_ = ctx.template scratch<double>(f);
    y_ = ctx.template scratch<double>(3 * static_cast<std::size_t>(landmarks));
    s_.blocks = 0;  // the diagonal ones alone
  }

  reduced_step solve(context<Policy>& ctx, const damping& damping, double*& x, double*& on_host_x) {
    const Policy& policy = ctx.policy();
    const int f = s_.free_frames;
    const std::size_t n = static_cast<std::size_t>(f) * D;
    launch_reduction<A, V, D>(policy, s_, {blocks_, r_, 0, false}, damping);
    for_each_index(policy, f, factorise_diagonal_blocks<D>{blocks_, product_});
    if (sum(ctx) != f) return {false, 0};
    fill_bytes(policy, x_, 0, n * sizeof(double));
    for_each_index(policy, f, precondition_frames<D>{blocks_, r_, z_, product_});
    double rz = sum(ctx);
    const double enough = tolerance_ * tolerance_ * rz;
    for_each_index(policy, f, combine_frames<D>{z_, 0, z_, p_, nullptr});
    int i = 0;
    while (i < max_iterations_ && rz > enough) {
      ++i;
      for_each_index(policy, landmarks_, gather_landmarks<A, V, D>{s_, p_, y_});
      for_each_index(policy, f, multiply_frames<A, V, D>{s_, p_, y_, damping, q_});
      for_each_index(policy, f, combine_frames<D>{p_, 0, q_, p_, product_});
      const double pq = sum(ctx);
      if (!(pq > 0) || !detail::is_finite(pq)) break;  // lost to rounding: what there is must do
      const double alpha = rz / pq;
      for_each_index(policy, f, combine_frames<D>{x_, alpha, p_, x_, nullptr});
      for_each_index(policy, f, combine_frames<D>{r_, -alpha, q_, r_, nullptr});
      for_each_index(policy, f, precondition_frames<D>{blocks_, r_, z_, product_});
      const double next = sum(ctx);
      for_each_index(policy, f, combine_frames<D>{z_, next / rz, p_, p_, nullptr});
      rz = next;
    }
    x = x_, on_host_x = on_host(ctx, x_, n, workspace_.x);
    return {detail::is_finite(rz), i};
  }

 private:
  double sum(context<Policy>& ctx) {
    const auto n = static_cast<std::size_t>(s_.free_frames);
    return detail::sum_in_order(on_host(ctx, product_, n, workspace_.matrix), n);
  }

  schur_view<A> s_;
  reduced_workspace<D>& workspace_;
  int landmarks_;
  double tolerance_;
  int max_iterations_;
  double *x_ = nullptr, *r_ = nullptr, *z_ = nullptr, *p_ = nullptr, *q_ = nullptr, *blocks_ = nullptr,
         *product_ = nullptr, *y_ = nullptr;
};

TURBOMAP_END_NAMESPACE

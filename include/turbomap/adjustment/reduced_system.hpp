// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The reduced system of the frames, block by block: what is left when the landmarks are eliminated. A block gathers the
/// products of the columns (eliminate_landmarks.hpp) of all landmarks that its two frames share, from a fixed list.

#include <cstddef>

#include "../config.hpp"
#include "../first_where.hpp"
#include "../math/pack.hpp"
#include "../parallel.hpp"
#include "compact_products.hpp"
#include "damping.hpp"
#include "schur_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Where the blocks of the reduced matrix go: row-major, the upper triangle of blocks. In a dense matrix of leading
/// dimension `stride`, or one after the other (diagonal ones first).
struct reduced_layout {
  double* S;    ///< the matrix
  double* rhs;  ///< right hand side, D per free frame
  int stride;   ///< numbers from row to row of a dense matrix
  bool dense;   ///< whether it is one matrix, not blocks one after the other

  /// Where block `index` of two frames begins; row == column: the diagonal block.
  TURBOMAP_HD double* block(int index, int row, int column, int free_frames, int D) const {
    if (dense) return S + static_cast<std::ptrdiff_t>(row) * D * stride + column * D;
    return S + (row == column ? static_cast<std::ptrdiff_t>(row) : static_cast<std::ptrdiff_t>(free_frames) + index) *
                   D * D;
  }
};

/// Index = blocks that follow each other, row by row: the diagonal block of a row and its right hand side, then the others. The
/// blocks of a row share a frame, so they find its columns in the cache; and as landmarks are in the order of their frames,
/// a thread that takes indices in a row reads mostly columns that it eliminated. All indices have about as much to sum.
/// \tparam Compact  columns are in compact form; there are no factors between frames
template <class A, int V, int D, bool Compact = false>
struct reduce_blocks {
  schur_view<A> s;            ///< landmarks and lists
  reduced_layout out;         ///< where the blocks go
  turbomap::damping damping;  ///< of the diagonal; its lambda is that of `s`, where it has one
  int parts;                  ///< number of indices

  static constexpr int n = column_lanes<V>;  ///< lanes of a column
  /// Entries of a list between asking for memory and reading it: a third-level cache is that far.
  static constexpr int ahead = 24;
  static constexpr int row_bytes = 3 * V * static_cast<int>(sizeof(A));  ///< of the columns of a slot
  using P = pack<A, n>;                                                  ///< numbers of a column

  /// The blocks of index i.
  TURBOMAP_HD void operator()(int i) const {
    position at = cut(i);
    const position end = cut(i + 1);
    while (at.row < end.row || at.block < end.block) {
      if (at.row < end.row && (at.block == end.block || at.row <= s.block_row[at.block]))
        diagonal(at.row++);
      else
        other(at.block++);
    }
  }

 private:
  /// The next diagonal block and the next other one.
  struct position {
    int row, block;
  };

  /// What is to be done for the diagonal blocks of the rows before `row` and the blocks before `block`: entries of lists, and a
  /// few for each block.
  TURBOMAP_HD long long work(int row, int block) const {
    constexpr int each = 4;
    return static_cast<long long>(s.frame_slot[row]) + (s.blocks > 0 ? s.block_pair[block] : 0) + each * (row + block);
  }

  /// Where index i begins.
  TURBOMAP_HD position cut(int i) const {
    if (i == 0) return {0, 0};
    if (i == parts) return {s.free_frames, s.blocks};
    const long long before = work(s.free_frames, s.blocks) * i / parts;
    const int block = first_where(0, s.blocks, [&](int b) { return work(s.block_row[b] + 1, b + 1) > before; });
    if (block < s.blocks) return {s.block_row[block] + 1, block};
    const int row = s.blocks > 0 ? s.block_row[s.blocks - 1] + 1 : 0;
    return {first_where(row, s.free_frames, [&](int r) { return work(r + 1, s.blocks) > before; }), s.blocks};
  }

  TURBOMAP_HD void diagonal(int f) const {
    turbomap::damping damping = this->damping;
    if (s.lambda != nullptr) damping.lambda = *s.lambda;
    double product[V * V], right[V];
    if constexpr (Compact)
      compact_products<A, V>{s}.of_frame(f, product, right);
    else
      sum_of_frame(f, product, right);
    double* S = out.block(0, f, f, s.free_frames, D);
    const int stride = out.dense ? out.stride : D;
    for (int r = 0; r < D; ++r)
      for (int c = 0; c < D; ++c) {
        const int h = r >= c ? r * (r + 1) / 2 + c : c * (c + 1) / 2 + r;
        double x = s.H[static_cast<std::ptrdiff_t>(f) * frame_block<D>::triangle + h];
        if (r == c) x += damping(x);
        if (r < V && c < V) x -= product[r * V + c];
        S[static_cast<std::ptrdiff_t>(r) * stride + c] = x;
      }
    for (int r = 0; r < D; ++r)
      out.rhs[f * D + r] = s.b[static_cast<std::ptrdiff_t>(f) * D + r] - (r < V ? right[r] : 0);
  }

  TURBOMAP_HD void other(int b) const {
    double product[V * V];
    if constexpr (Compact)
      compact_products<A, V>{s}.between(s.block_row[b], s.block_column[b], s.block_pair[b], s.block_pair[b + 1],
                                        product);
    else
      sum_between(b, product);
    double* S = out.block(b, s.block_row[b], s.block_column[b], s.free_frames, D);
    const int stride = out.dense ? out.stride : D;
    for (int r = 0; r < D; ++r)
      for (int c = 0; c < D; ++c)
        S[static_cast<std::ptrdiff_t>(r) * stride + c] = r < V && c < V ? -product[r * V + c] : 0;
    if constexpr (!Compact)
      for (int k = s.block_factor[b]; k < s.block_factor[b + 1]; ++k) {
        const int code = s.factor_list[k];
        const double* square = s.sums.factor_square + static_cast<std::ptrdiff_t>(code / 2) * D * D;
        for (int r = 0; r < D; ++r)
          for (int c = 0; c < D; ++c)
            S[static_cast<std::ptrdiff_t>(r) * stride + c] += code % 2 == 0 ? square[r * D + c] : square[c * D + r];
      }
  }

  TURBOMAP_HD void sum_of_frame(int f, double (&product)[V * V], double (&right_sum)[V]) const {
    P sum[V], right(A(0));
    for (int r = 0; r < V; ++r) sum[r] = P(A(0));
    const int last = s.frame_slot[f + 1] - 1;
    for (int k = s.frame_slot[f]; k <= last; ++k) {
      const int slot = s.slot_list[k], later = s.slot_list[k + ahead < last ? k + ahead : last];
      prefetch(s.eliminated + static_cast<std::ptrdiff_t>(later) * 3 * V, row_bytes);
      prefetch(s.landmark[s.slot_landmark[later]].c, 24);
      const A* z = s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V;
      const eliminated_landmark& e = s.landmark[s.slot_landmark[slot]];
      for (int m = 0; m < 3; ++m) {
        const P column = P::load(z + m * V);
        for (int r = 0; r < V; ++r) sum[r] = multiply_add(P(z[m * V + r]), column, sum[r]);
        right = multiply_add(P(static_cast<A>(e.c[m])), column, right);
      }
    }
    for (int r = 0; r < V; ++r) store(sum[r], product + r * V);
    store(right, right_sum);
  }

  TURBOMAP_HD void sum_between(int b, double (&product)[V * V]) const {
    P sum[V];
    for (int r = 0; r < V; ++r) sum[r] = P(A(0));
    const int last = s.block_pair[b + 1] - 1;
    for (int k = s.block_pair[b]; k <= last; ++k) {
      const slot_pair& later = s.pairs[k + ahead < last ? k + ahead : last];
      prefetch(s.eliminated + static_cast<std::ptrdiff_t>(later.first) * 3 * V, row_bytes);
      prefetch(s.eliminated + static_cast<std::ptrdiff_t>(later.second) * 3 * V, row_bytes);
      const A* first = s.eliminated + static_cast<std::ptrdiff_t>(s.pairs[k].first) * 3 * V;
      const A* second = s.eliminated + static_cast<std::ptrdiff_t>(s.pairs[k].second) * 3 * V;
      for (int m = 0; m < 3; ++m) {
        const P column = P::load(second + m * V);
        for (int r = 0; r < V; ++r) sum[r] = multiply_add(P(first[m * V + r]), column, sum[r]);
      }
    }
    for (int r = 0; r < V; ++r) store(sum[r], product + r * V);
  }
  TURBOMAP_HD static void store(const P& sum, double* to) {
    A lanes[n];
    sum.store(lanes);
    for (int c = 0; c < V; ++c) to[c] = static_cast<double>(lanes[c]);
  }
};

/// All blocks of the reduced system.
template <int V, int D, class Derived, class A>
void launch_reduce_blocks(const thrust::execution_policy<Derived>& policy, const schur_view<A>& s,
                          const reduced_layout& out, const damping& damping) {
  constexpr int most = 64;  // shares for up to as many threads
  const int blocks = s.free_frames + s.blocks;
  const int parts = is_host_accessible_v<memory_of_t<Derived>> && blocks > most ? most : blocks;
  if constexpr (is_host_accessible_v<memory_of_t<Derived>> && compact_form<A, V, D>)
    if (s.compact) return for_each_index(derived(policy), parts, reduce_blocks<A, V, D, true>{s, out, damping, parts});
  for_each_index(derived(policy), parts, reduce_blocks<A, V, D>{s, out, damping, parts});
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/reduce_blocks.cuh"
#endif

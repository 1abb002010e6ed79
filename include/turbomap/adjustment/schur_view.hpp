// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the Schur complement works on, where the policy computes: the lists of the structure, the sums of the factors, and
/// the eliminated landmarks.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../math/pack.hpp"
#include "factor_sums.hpp"
#include "structure.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A landmark after elimination: damped H = L L^T.
struct eliminated_landmark {
  double c[3];        ///< L^-1 b; first, so that no two lines of a cache hold it: blocks of S read it out of order
  double inverse[6];  ///< of L, lower triangle; 0: it does not move (along this direction)
  double b[3];        ///< negative gradient
};

/// Lanes that hold a column of V numbers. What is beyond V is read, so arrays of columns have room for column_slack more.
template <int V>
inline constexpr int column_lanes = TURBOMAP_VECTOR_BYTES == 0 ? V
                                    : (V + 3) / 4 * 4 == 4     ? 4
                                                               : (V + 7) / 8 * 8;

inline constexpr int column_slack = 16;  ///< see column_lanes

/// \tparam A  numbers of the normal equations of landmarks
template <class A>
struct schur_view : sum_lists<list_pointer>, block_lists<list_pointer> {
  int free_frames = 0;                           ///< frames that move
  int landmarks = 0;                             ///< all, fixed ones included
  int blocks = 0;                                ///< 0: not formed
  const std::uint8_t* landmark_fixed = nullptr;  ///< null: none
  factor_sums<A> sums{};                         ///< what the factors were summed into
  A* eliminated = nullptr;                       ///< [slot] Z = coupling L^-T, as couplings; or in compact form
  bool compact = false;                          ///< `eliminated` is in compact form (compact_columns.hpp); on the host
  double* turned = nullptr;                      ///< [free frame] room for turn_steps(), where compact
  eliminated_landmark* landmark = nullptr;       ///< [landmark]
  // Where sums.coupling is null, couplings are made of rows (row_couplings.hpp), and of these:
  const double* positions = nullptr;        ///< of the landmarks where the rows were computed
  const A* axes = nullptr;                  ///< [free frame] on the host
  const double* centres = nullptr;          ///< [free frame] landmark_stride; on the host
  const isometry<double>* poses = nullptr;  ///< [frame] on a device, where the rows were computed
  const std::uint32_t* held = nullptr;      ///< [free frame] on a device; null: none
  /// Damping that the policy finds before it is needed (step_sums.hpp), in place of the one that a launcher is given; NaN:
  /// nothing is to be done. Null: the one that is given. On a device.
  const double* lambda = nullptr;
  double* H = nullptr;  ///< [free frame] lower triangle
  double* b = nullptr;  ///< [free frame]

  /// Whether landmark l moves.
  TURBOMAP_HD bool moves(int l) const { return landmark_fixed == nullptr || landmark_fixed[l] == 0; }
};

/// The work before landmarks that are taken some at a time: entries of a list of theirs, and a few per landmark.
struct work_of_landmarks {
  const std::int32_t* list;  ///< [landmark + 1]
  int landmarks;             ///< of the problem
  int per_index;             ///< landmarks of an index
  int each;                  ///< entries that a landmark itself stands for

  /// Of the indices before i.
  TURBOMAP_HD long long operator()(int i) const {
    const long long before = static_cast<long long>(i) * per_index;
    const long long l = before < landmarks ? before : landmarks;
    return list[l] + each * l;
  }
};

namespace detail {

/// Sum of the rows of a landmark: H (lower triangle), then b.
template <class A>
[[gnu::always_inline]] TURBOMAP_HD inline void sum_rows(const schur_view<A>& s, int l, double (&total)[9]) {
  using P = pack<A, 8>;
  P head(A(0));
  A last(0);
  for (int r = s.landmark_row[l]; r < s.landmark_row[l + 1]; ++r) {
    const A* row = s.sums.row + static_cast<std::ptrdiff_t>(r) * 9;
    head = head + P::load(row);
    last += row[8];
  }
  A out[8];
  head.store(out);
  for (int i = 0; i < 8; ++i) total[i] = static_cast<double>(out[i]);
  total[8] = static_cast<double>(last);
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

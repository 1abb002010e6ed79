// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Who adjusts one pose (adjust_pose.hpp): a team, whose members share the observations of the frame, and agree on all else. Here is
/// the team of one thread; that of a cluster of blocks is in cuda/adjust_poses.cuh.

#include "../config.hpp"
#include "small_cholesky.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A team of one thread. Members of a team compute the same but for the loops over observations, which they share.
struct team_of_one {
  /// @{
  /// Number of this member; number of members; the most numbers that are summed at once.
  static constexpr int rank = 0, size = 1, most = 28;
  /// @}
  /// What the members share.
  struct memory {
    double total[2][most];  ///< by place
  };
  memory& sums;  ///< where sums are kept

  /// The sums of numbers over the members, kept until the next ones at this place. \param place  0 or 1
  template <int N>
  TURBOMAP_HD const double* sum(const double (&x)[N], int place) const {
    for (int i = 0; i < N; ++i) sums.total[place][i] = x[i];
    return sums.total[place];
  }
  /// (H + lambda I) x = b. False: it has no solution.
  TURBOMAP_HD bool solve(const double* H, const double* b, double lambda, double (&x)[6]) const {
    double L[36];
    for (int i = 0, at = 0; i < 6; ++i)
      for (int j = 0; j <= i; ++j, ++at) L[i * 6 + j] = H[at] + (i == j ? lambda : 0);
    if (!factorise_small<6>(L)) return false;
    for (int i = 0; i < 6; ++i) x[i] = b[i];
    solve_lower<6>(L, x);
    solve_upper<6>(L, x);
    return true;
  }
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Shares out indices of unequal work: a host policy gives each thread equally many indices that follow each other, so the
/// indices it is given here are runs of about equal work. Runs, not single indices in turns: neighbours share memory.

#include <limits>

#include "../config.hpp"
#include "../first_where.hpp"
#include "../memory.hpp"
#include "../parallel.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = a run of indices of `f`: those whose work before them lies within the share.
/// \tparam Work  long long operator()(int i): the work of all indices before i; it does not fall
template <class Work, class Function>
struct equal_shares {
  int n;       ///< indices of f
  int shares;  ///< they are cut into
  Work work;   ///< before an index
  Function f;  ///< called for each index

  /// Calls f for the indices of a share.
  TURBOMAP_HD void operator()(int share) const {
    const long long all = work(n);
    const long long begin = all * share / shares;
    const long long end = share + 1 < shares ? all * (share + 1) / shares : std::numeric_limits<long long>::max();
    for (int i = first_where(0, n, [&](int k) { return work(k) >= begin; }); i < n && work(i) < end; ++i) f(i);
  }
};

/// Calls f(i) for i in [0, n), in any order and possibly concurrently: on the host in shares of equal work, the same for any
/// number of threads; on a device each index by itself.
template <class Derived, class Work, class Function>
void for_each_in_shares(const thrust::execution_policy<Derived>& policy, int n, const Work& work, const Function& f) {
  if constexpr (is_host_accessible_v<memory_of_t<Derived>>) {
    constexpr int most = 64;  // of up to so many threads
    const int shares = n < most ? n : most;
    for_each_index(policy, shares, equal_shares<Work, Function>{n, shares, work, f});
  } else {
    (void)work;
    for_each_index(policy, n, f);
  }
}

TURBOMAP_END_NAMESPACE

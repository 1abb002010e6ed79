// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Delta debugging: of a set of things that together make something fail, a small subset that still does. Ever smaller groups are
/// taken out, and what the failure does not need stays out. A. Zeller, R. Hildebrandt, "Simplifying and isolating
/// failure-inducing input", IEEE Transactions on Software Engineering 28(2), 2002: the algorithm ddmin, section 3.2.

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace turbomap_reduce {

/// The indices of a subset of 0..count-1, ascending, for which `fails` holds, and for no subset with one index less. `fails` takes
/// ascending indices, never none of them, and holds for all of them. At most count^2 + 3 count calls of it, where one index is
/// to blame about 2 log2(count).
template <class Fails>
std::vector<std::size_t> minimise(std::size_t count, Fails fails) {
  std::vector<std::size_t> kept(count), tried;
  std::iota(kept.begin(), kept.end(), std::size_t{0});
  std::size_t groups = 2;
  while (kept.size() >= 2) {
    groups = std::min(groups, kept.size());
    const auto begin = [&](std::size_t g) {
      return kept.begin() + static_cast<std::ptrdiff_t>(g * kept.size() / groups);
    };
    bool smaller = false;
    for (std::size_t g = 0; g < groups && !smaller; ++g) {  // one group alone
      tried.assign(begin(g), begin(g + 1));
      if ((smaller = fails(tried))) groups = 2;
    }
    for (std::size_t g = 0; g < groups && !smaller && groups > 2;
         ++g) {  // all but one; of two groups that is the other
      tried.assign(kept.begin(), begin(g));
      tried.insert(tried.end(), begin(g + 1), kept.end());
      if ((smaller = fails(tried))) groups = std::max<std::size_t>(groups - 1, 2);
    }
    if (smaller)
      kept = tried;
    else if (groups == kept.size())
      break;
    else
      groups *= 2;
  }
  return kept;
}

}  // namespace turbomap_reduce

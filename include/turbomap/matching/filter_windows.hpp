// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What can be consistent with a keypoint, for the filters of host policies: a window of the sorted tables, as in the ordered
/// search. A filter that asks only those keypoints decides as if it had asked all.

#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "apply_filter.hpp"
#include "ordered_tables.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Windows of one side of a search. Host only.
template <class Descriptor, class Camera, sorted_side Side>
class filter_windows {
 public:
  /// \param tables  built before; their arrays must outlive this
  explicit filter_windows(const ordered_tables<Descriptor, Camera, Side>& tables) : tables_(tables) {}

  /// Whether any keypoint of this side that can be consistent with `keypoint` of the other one satisfies the predicate.
  template <class Predicate>
  bool any(int n, std::int32_t keypoint, Predicate predicate) const {
    constexpr bool of_candidates = Side == sorted_side::candidates;
    const auto& search = tables_.search;
    const int camera = of_candidates ? search.query().camera_of(keypoint) : search.neighbour(n).camera_of(keypoint);
    const int others = of_candidates ? search.neighbour(n).camera_count : search.query_cameras;
    for (int other = 0; other < others; ++other) {
      const int a = of_candidates ? camera : other, b = of_candidates ? other : camera;
      const epipolar_table table = tables_.view(n, a, b);
      if (table.empty()) continue;
      const pair_geometry& g = search.pair(n, a, b);
      const plane_interval interval = of_candidates
                                          ? tables_.query_interval(tables_.query_measure(g, a), keypoint)
                                          : tables_.candidate_interval(tables_.candidate_measure(g, n, b), n, keypoint);
      bool found = false;
      table.windows(epipolar_table::code_of(interval), [&](std::int32_t begin, std::int32_t end) {
        for (std::int32_t k = begin; k < end && !found; ++k) found = predicate(table.candidates[k]);
      });
      if (found) return true;
    }
    return false;
  }

 private:
  ordered_tables<Descriptor, Camera, Side> tables_;
};

/// Whether the windows pay: the search itself was ordered, and there are enough matches. O(results).
template <class Descriptor, class Camera>
bool windows_pay(const search_view<Descriptor, Camera>& search) {
  if (search.options.candidate_set != candidates::epipolar_ordered) return false;
  const std::int64_t results = static_cast<std::int64_t>(search.neighbour_count) * search.slot_count;
  std::int64_t matches = 0;
  for (std::int64_t i = 0; i < results; ++i) matches += search.match[i] != no_match ? 1 : 0;
  // Matches per table from which sorting costs less than comparing with all keypoints: measured, no influence on results.
  constexpr std::int64_t worthwhile = 2;
  return matches > worthwhile * search.neighbour_count * search.query_cameras * search.neighbour_cameras;
}

namespace detail {

/// Index = result: asks the windows. Not drop_matches, whose filters are compiled for devices too.
template <class Descriptor, class Camera, class Filter, sorted_side Side>
struct drop_matches_in_windows {
  search_view<Descriptor, Camera> search;
  Filter filter;
  filter_windows<Descriptor, Camera, Side> windows;

  void operator()(int i) const {
    if (search.match[i] != no_match && !filter.keep_among(search, i, windows)) search.match[i] = no_match;
  }
};

}  // namespace detail

/// Drops the matches that the filter does not keep when it compares them with all keypoints of Side: by windows where that
/// pays. A device compares with all (cuda/drop_compared.cuh).
template <sorted_side Side, class Derived, class Descriptor, class Camera, class Memory, class Filter>
void launch_drop_compared(const thrust::execution_policy<Derived>& policy,
                          const search_view<Descriptor, Camera>& search, scratch_arena<Memory>& scratch,
                          const Filter& filter) {
  if (!windows_pay(search)) return launch_drop_matches(derived(policy), search, filter);
  const auto tables = take_tables<Side>(scratch, search, false);
  launch_build_tables(derived(policy), tables);
  const filter_windows<Descriptor, Camera, Side> windows(tables);
  for_each_index(derived(policy), search.neighbour_count * search.slot_count,
                 detail::drop_matches_in_windows<Descriptor, Camera, Filter, Side>{search, filter, windows});
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/drop_compared.cuh"
#endif

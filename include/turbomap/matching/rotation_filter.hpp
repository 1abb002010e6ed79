// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The filter of orientations. When a camera rolls, the orientation of all true matches changes by about the same angle:
/// changes are counted in a histogram, and matches outside its fullest bins are dropped [ORB-SLAM3].

#include <cstdint>

#include "../atomic.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "apply_filter.hpp"

namespace turbomap {

/// Keeps, per neighbour, the matches whose change of orientation falls into the fullest bins [ORB-SLAM3].
struct rotation_histogram {
  int bins = 30;              ///< over 360 degrees
  int kept = 3;               ///< fullest bins; equal counts: the lower bin
  double min_fraction = 0.1;  ///< a bin with less than this part of the fullest one's matches is dropped all the same
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Rotation bins of all neighbours.
struct keep_rotation {
  rotation_histogram options;
  std::int32_t* counts;  ///< [neighbour][bin]

  template <class Descriptor, class Camera>
  TURBOMAP_HD int bin(const search_view<Descriptor, Camera>& search, int i) const {
    using S = strict<float>;
    const auto& neighbour = search.neighbour(i / search.slot_count);
    S change = S(search.query().angle[search.queries[i % search.slot_count]]) - S(neighbour.angle[search.match[i]]);
    if (change < S(0)) change += S(360);
    const float b = (change * S(static_cast<float>(options.bins)) / S(360)).value;
    // Compared before it is converted: what an int cannot hold becomes another one on each processor.
    return !(b > 0) ? 0 : b >= static_cast<float>(options.bins) ? options.bins - 1 : static_cast<int>(b);
  }
  template <class Descriptor, class Camera>
  TURBOMAP_HD bool keep(const search_view<Descriptor, Camera>& search, int i) const {
    const std::int32_t* mine = counts + i / search.slot_count * options.bins;
    const int b = bin(search, i);
    std::int32_t fullest = 0;
    int before = 0;
    for (int k = 0; k < options.bins; ++k) {
      fullest = mine[k] > fullest ? mine[k] : fullest;
      before += mine[k] > mine[b] || (mine[k] == mine[b] && k < b) ? 1 : 0;
    }
    return before < options.kept && static_cast<double>(mine[b]) >= options.min_fraction * static_cast<double>(fullest);
  }
};
template <class Descriptor, class Camera>
struct count_rotations {
  search_view<Descriptor, Camera> search;
  keep_rotation bins;

  TURBOMAP_HD void operator()(int i) const {
    if (search.match[i] != no_match)
      atomic_increment(bins.counts + i / search.slot_count * bins.options.bins + bins.bin(search, i));
  }
};

}  // namespace detail

/// Counts the change of orientation of every match.
template <class Derived, class Descriptor, class Camera>
void launch_count_rotations(const thrust::execution_policy<Derived>& policy,
                            const search_view<Descriptor, Camera>& search, const detail::keep_rotation& bins) {
  for_each_index(derived(policy), search.neighbour_count * search.slot_count,
                 detail::count_rotations<Descriptor, Camera>{search, bins});
}

/// Throws std::invalid_argument as apply_filter() does.
template <class Matches>
void check_filter(const Matches& matches, const rotation_histogram& filter) {
  require(filter.bins >= 1, "rotation_histogram.bins", filter.bins, "must be at least 1");
  require(filter.kept >= 1, "rotation_histogram.kept", filter.kept, "must be at least 1");
  require(filter.min_fraction >= 0 && filter.min_fraction <= 1, "rotation_histogram.min_fraction", filter.min_fraction,
          "must be in [0, 1]");
  require(matches.has_angles(), "rotation_histogram", "no angles", "every keyframe needs the angle of its keypoints");
}

/// \throws std::invalid_argument  bins or kept below 1, min_fraction not in [0, 1], or a keyframe without angles
template <class Descriptor, class Camera, class Policy>
void apply_filter(context<Policy>& ctx, correspondences<Descriptor, Camera, Policy>& matches,
                  const rotation_histogram& filter) {
  check_filter(matches, filter);
  const auto& search = matches.view();
  const std::size_t counters = static_cast<std::size_t>(search.neighbour_count) * static_cast<std::size_t>(filter.bins);
  ctx.begin_call();
  detail::keep_rotation bins{filter, ctx.template scratch<std::int32_t>(counters)};
  fill_bytes(ctx.policy(), bins.counts, 0, counters * sizeof(std::int32_t));
  launch_count_rotations(ctx.policy(), search, bins);
  apply_filter(ctx, matches, bins);
}

TURBOMAP_END_NAMESPACE

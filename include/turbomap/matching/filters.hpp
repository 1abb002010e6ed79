// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Filters of correspondences, composable in any order: `filter(ctx, matches, ratio_test{0.8}, mutual_best{}, one_to_one{})`.
/// Each removes matches, where the matches are. A user's own filter is a plain struct with
/// `template <class D, class C> TURBOMAP_HD bool keep(const search_view<D, C>& search, int i) const`. It is asked about
/// results search.match[i] that are a match, concurrently: of `match` it may read element i only.

#include <cstdint>
#include <cstring>

#include "../atomic.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "correspondences.hpp"
#include "exhaustive_search.hpp"

namespace turbomap {

/// Keeps a match if no other candidate that passes the epipolar test comes close: distance <= ratio x its distance (Lowe).
struct ratio_test {
  double ratio = 0.8;
};

/// Keeps a match if no other query keypoint that passes the epipolar test is nearer to the candidate (equal: the lower index).
struct mutual_best {};

/// Keeps, per neighbour, the matches whose change of orientation falls into the fullest bins [ORB-SLAM3].
struct rotation_histogram {
  int bins = 30;              ///< over 360 degrees
  int kept = 3;               ///< fullest bins; equal counts: the lower bin
  double min_fraction = 0.1;  ///< a bin with less than this part of the fullest one's matches is dropped all the same
};

/// Keeps, of the matches that claim one neighbour keypoint, the one of least (distance, query keypoint).
struct one_to_one {};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The group that holds a keypoint, or -1: keypoints of a group ascend, so each is searched by halving.
TURBOMAP_HD inline int group_containing(const group_index_view& groups, std::uint32_t keypoint) {
  for (int g = 0; g < groups.group_count; ++g) {
    std::uint32_t low = groups.offsets[static_cast<std::size_t>(g)],
                  high = groups.offsets[static_cast<std::size_t>(g) + 1];
    const std::uint32_t end = high;
    while (low < high) {
      const std::uint32_t middle = (low + high) / 2;
      if (groups.keypoints[middle] < keypoint)
        low = middle + 1;
      else
        high = middle;
    }
    if (low < end && groups.keypoints[low] == keypoint) return g;
  }
  return -1;
}

/// Whether any neighbour keypoint that `query` was compared with satisfies the predicate.
template <class Descriptor, class Camera, class Predicate>
TURBOMAP_HD bool any_candidate(const search_view<Descriptor, Camera>& search, int n, std::int32_t match,
                               Predicate predicate) {
  if (search.options.candidate_set == candidates::grouped) {
    const auto& groups = search.neighbour(n).groups;
    const std::uint8_t* has_point = search.has_point + search.has_point_offset[n];
    const int g = group_containing(groups, static_cast<std::uint32_t>(match));
    if (g < 0) return false;  // a given match of keypoints without a group
    for (std::uint32_t k = groups.offsets[static_cast<std::size_t>(g)];
         k < groups.offsets[static_cast<std::size_t>(g) + 1]; ++k) {
      const auto c = static_cast<std::int32_t>(groups.keypoints[k]);
      if (has_point[c] == 0 && predicate(c)) return true;
    }
    return false;
  }
  for (int k = search.candidate_offset[n]; k < search.candidate_offset[n + 1]; ++k)
    if (predicate(search.candidates[k])) return true;
  return false;
}

/// Whether any query keypoint that `match` was compared with satisfies the predicate.
template <class Descriptor, class Camera, class Predicate>
TURBOMAP_HD bool any_query(const search_view<Descriptor, Camera>& search, std::int32_t query, Predicate predicate) {
  const bool grouped = search.options.candidate_set == candidates::grouped;
  const auto& groups = search.query().groups;
  const int group = grouped ? group_containing(groups, static_cast<std::uint32_t>(query)) : -1;
  if (grouped && group < 0) return false;  // a given match of keypoints without a group
  for (int k = 0; k < search.slot_count; ++k) {
    const std::int32_t q = search.queries[k];
    if (predicate(q) && (!grouped || group_containing(groups, static_cast<std::uint32_t>(q)) == group)) return true;
  }
  return false;
}

struct keep_ratio {
  double ratio;

  template <class Descriptor, class Camera>
  TURBOMAP_HD bool keep(const search_view<Descriptor, Camera>& search, int i) const {
    const int n = i / search.slot_count;
    const std::int32_t keypoint = search.queries[i % search.slot_count], match = search.match[i];
    const auto* descriptor = search.query().descriptor_of(keypoint);
    const double distance = static_cast<double>(search.distance[i]);
    candidate_scan<Descriptor, Camera> scan(search, n, keypoint);
    return !any_candidate(search, n, match, [&](std::int32_t c) {
      const double other = static_cast<double>(Descriptor::distance(descriptor, search.neighbour(n).descriptor_of(c)));
      return c != match && distance > ratio * other && scan.consistent(c);
    });
  }
};

struct keep_mutual {
  template <class Descriptor, class Camera>
  TURBOMAP_HD bool keep(const search_view<Descriptor, Camera>& search, int i) const {
    const int n = i / search.slot_count;
    const std::int32_t keypoint = search.queries[i % search.slot_count], match = search.match[i];
    const auto* descriptor = search.neighbour(n).descriptor_of(match);
    const auto distance = search.distance[i];
    return !any_query(search, keypoint, [&](std::int32_t q) {
      const auto other = Descriptor::distance(search.query().descriptor_of(q), descriptor);
      if (q == keypoint || !(other < distance || (other == distance && q < keypoint))) return false;
      return candidate_scan<Descriptor, Camera>(search, n, q).consistent(match);
    });
  }
};

/// Index = result: drops what the filter does not keep.
template <class Descriptor, class Camera, class Filter>
struct drop_matches {
  search_view<Descriptor, Camera> search;
  Filter filter;

  TURBOMAP_HD void operator()(int i) const {
    if (search.match[i] != no_match && !filter.keep(search, i)) search.match[i] = no_match;
  }
};

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

/// The best claim of every neighbour keypoint: distance in the upper half, slot in the lower.
struct keep_winner {
  std::uint64_t* claims;  ///< at has_point_offset[n] + keypoint

  template <class Descriptor, class Camera>
  TURBOMAP_HD static std::uint64_t claim(const search_view<Descriptor, Camera>& search, int i) {
    // Distances are not negative, so the bits of a float are ordered like its value, and those of an int anyway.
    static_assert(sizeof(typename Descriptor::distance_type) == 4,
                  "turbomap: one_to_one needs a descriptor whose distance_type has 32 bits: float, std::int32_t...");
    std::uint32_t bits = 0;
    if (search.distance[i] != 0) std::memcpy(&bits, &search.distance[i], sizeof(bits));  // -0.0F is 0
    return static_cast<std::uint64_t>(bits) << 32 | static_cast<std::uint32_t>(i % search.slot_count);
  }
  template <class Descriptor, class Camera>
  TURBOMAP_HD std::uint64_t* cell(const search_view<Descriptor, Camera>& search, int i) const {
    return claims + search.has_point_offset[i / search.slot_count] + search.match[i];
  }
  template <class Descriptor, class Camera>
  TURBOMAP_HD bool keep(const search_view<Descriptor, Camera>& search, int i) const {
    return *cell(search, i) == claim(search, i);
  }
};
template <class Descriptor, class Camera>
struct make_claims {
  search_view<Descriptor, Camera> search;
  keep_winner winner;

  TURBOMAP_HD void operator()(int i) const {
    if (search.match[i] != no_match) atomic_min(winner.cell(search, i), winner.claim(search, i));
  }
};

}  // namespace detail

/// \name What a filter demands
/// Throws std::invalid_argument naming the option; filter() asks all of its filters before it applies the first.
/// @{
template <class Matches, class Filter>
void check_filter(const Matches&, const Filter&) {}
template <class Matches>
void check_filter(const Matches&, const ratio_test& filter) {
  require(filter.ratio > 0 && filter.ratio <= 1, "ratio_test.ratio", filter.ratio, "must be in (0, 1]");
}
template <class Matches>
void check_filter(const Matches& matches, const rotation_histogram& filter) {
  require(filter.bins >= 1, "rotation_histogram.bins", filter.bins, "must be at least 1");
  require(filter.kept >= 1, "rotation_histogram.kept", filter.kept, "must be at least 1");
  require(filter.min_fraction >= 0 && filter.min_fraction <= 1, "rotation_histogram.min_fraction", filter.min_fraction,
          "must be in [0, 1]");
  require(matches.has_angles(), "rotation_histogram", "no angles", "every keyframe needs the angle of its keypoints");
}
/// @}

/// \name One filter
/// Removes matches that the filter does not keep. A user's own filter goes the first way.
/// @{
template <class Descriptor, class Camera, class Policy, class Filter>
void apply_filter(context<Policy>& ctx, correspondences<Descriptor, Camera, Policy>& matches, const Filter& filter) {
  const auto& search = matches.view();
  for_each_index(ctx.policy(), search.neighbour_count * search.slot_count,
                 detail::drop_matches<Descriptor, Camera, Filter>{search, filter});
}
/// \throws std::invalid_argument  the ratio is not in (0, 1]
template <class Descriptor, class Camera, class Policy>
void apply_filter(context<Policy>& ctx, correspondences<Descriptor, Camera, Policy>& matches,
                  const ratio_test& filter) {
  check_filter(matches, filter);
  apply_filter(ctx, matches, detail::keep_ratio{filter.ratio});
}
template <class Descriptor, class Camera, class Policy>
void apply_filter(context<Policy>& ctx, correspondences<Descriptor, Camera, Policy>& matches, const mutual_best&) {
  apply_filter(ctx, matches, detail::keep_mutual{});
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
  for_each_index(ctx.policy(), search.neighbour_count * search.slot_count,
                 detail::count_rotations<Descriptor, Camera>{search, bins});
  apply_filter(ctx, matches, bins);
}
template <class Descriptor, class Camera, class Policy>
void apply_filter(context<Policy>& ctx, correspondences<Descriptor, Camera, Policy>& matches, const one_to_one&) {
  const auto& search = matches.view();
  const std::size_t keypoints = matches.neighbour_keypoint_count();
  ctx.begin_call();
  detail::keep_winner winner{ctx.template scratch<std::uint64_t>(keypoints)};
  fill_bytes(ctx.policy(), winner.claims, 0xFF, keypoints * sizeof(std::uint64_t));
  for_each_index(ctx.policy(), search.neighbour_count * search.slot_count,
                 detail::make_claims<Descriptor, Camera>{search, winner});
  apply_filter(ctx, matches, winner);
}
/// @}

/// Applies the filters one after the other. The result is equal on every policy. When one of them has bad options, none is
/// applied. Cost: ratio_test and mutual_best compare each match with all candidates, and all query keypoints, of its pair:
/// O(matches x keypoints), more than an ordered search where there are thousands of matches; the others O(results).
template <class Descriptor, class Camera, class Policy, class... Filters>
void filter(context<Policy>& ctx, correspondences<Descriptor, Camera, Policy>& matches, const Filters&... filters) {
  (check_filter(matches, filters), ...);
  (apply_filter(ctx, matches, filters), ...);
}

TURBOMAP_END_NAMESPACE

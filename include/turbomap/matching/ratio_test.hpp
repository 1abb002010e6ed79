// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The filter of ambiguous matches. Where a second candidate looks almost as similar as the best one, as on repeated
/// structure, there is no telling which one is right, so the match is dropped (Lowe's ratio test).

#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "../descriptor/descriptor_concept.hpp"
#include "../error.hpp"
#include "apply_filter.hpp"
#include "candidate_scan.hpp"
#include "filter_windows.hpp"
#include "find_group.hpp"
#include "group_lookup.hpp"

namespace turbomap {

/// Keeps a match if no other candidate that passes the epipolar test comes close: distance <= ratio x its distance (Lowe).
struct ratio_test {
  double ratio = 0.8;  ///< of the distances; 0.8: Lowe, IJCV 2004, 7.1
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// One match against other candidates.
template <class Descriptor, class Camera>
class ratio_comparison {
 public:
  TURBOMAP_HD ratio_comparison(const search_view<Descriptor, Camera>& search, int i, double ratio)
      : search_(search),
        n_(i / search.slot_count),
        query_(search.queries[i % search.slot_count]),
        match_(search.match[i]),
        distance_(static_cast<double>(search.distance[i])),
        ratio_(ratio_of<Descriptor>(ratio)),
        scan_(search, n_, query_) {}

  TURBOMAP_HD int neighbour() const { return n_; }
  TURBOMAP_HD std::int32_t query() const { return query_; }
  /// Whether a candidate makes the match ambiguous.
  TURBOMAP_HD bool close(std::int32_t candidate) {
    const double other = static_cast<double>(
        Descriptor::distance(search_.query().descriptor_of(query_), search_.neighbour(n_).descriptor_of(candidate)));
    return candidate != match_ && distance_ > ratio_ * other && scan_.consistent(candidate);
  }

 private:
  const search_view<Descriptor, Camera>& search_;
  int n_;
  std::int32_t query_, match_;
  double distance_, ratio_;
  candidate_scan<Descriptor, Camera> scan_;
};

/// Against all candidates, or those near its epipolar curve.
struct keep_ratio {
  double ratio;

  template <class Descriptor, class Camera>
  TURBOMAP_HD bool keep(const search_view<Descriptor, Camera>& search, int i) const {
    ratio_comparison<Descriptor, Camera> comparison(search, i, ratio);
    const int n = comparison.neighbour();
    for (int k = search.candidate_begin[n]; k < search.candidate_end[n]; ++k)
      if (comparison.close(search.candidates[k])) return false;
    return true;
  }
  template <class Descriptor, class Camera, class Windows>
  bool keep_among(const search_view<Descriptor, Camera>& search, int i, const Windows& windows) const {
    ratio_comparison<Descriptor, Camera> comparison(search, i, ratio);
    return !windows.any(comparison.neighbour(), comparison.query(),
                        [&comparison](std::int32_t c) { return comparison.close(c); });
  }
};
/// Against those of the query keypoint's group.
struct keep_ratio_in_group {
  double ratio;
  group_lookup lookup;

  template <class Descriptor, class Camera>
  TURBOMAP_HD bool keep(const search_view<Descriptor, Camera>& search, int i) const {
    ratio_comparison<Descriptor, Camera> comparison(search, i, ratio);
    const std::uint8_t* has_point = search.has_point + search.has_point_offset[comparison.neighbour()];
    return !any_of_group(search.neighbour(comparison.neighbour()).groups, lookup.query[comparison.query()],
                         [&](std::int32_t c) { return has_point[c] == 0 && comparison.close(c); });
  }
};

}  // namespace detail

/// \throws std::invalid_argument  the ratio is not in (0, 1]
template <class Matches>
void check_filter(const Matches&, const ratio_test& filter) {
  require(filter.ratio > 0 && filter.ratio <= 1, "ratio_test.ratio", filter.ratio, "must be in (0, 1]");
}
/// Cost: O(matches x candidates of the pair), after an ordered search on the host a few percent of that, O(matches x
/// group) after a grouped one.
/// \throws std::invalid_argument  the ratio is not in (0, 1]
template <class Descriptor, class Camera, class Policy>
void apply_filter(context<Policy>& ctx, correspondences<Descriptor, Camera, Policy>& matches,
                  const ratio_test& filter) {
  check_filter(matches, filter);
  ctx.begin_call();
  if (matches.view().options.candidate_set == candidates::grouped)
    apply_filter(ctx, matches, detail::keep_ratio_in_group{filter.ratio, look_up_groups(ctx, matches)});
  else
    launch_drop_compared<sorted_side::candidates>(ctx.policy(), matches.view(), ctx.scratch(),
                                                  detail::keep_ratio{filter.ratio});
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What can be consistent with a keypoint, for the filters of host policies: candidates, or queries, in epipolar order
/// as in ordered_search.hpp. A filter that asks only those decides as if it had asked all.

#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "correspondences.hpp"
#include "ordered_search.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Which keypoints the tables hold.
enum class window_of { candidates, queries };

/// Tables of one side, one for each (neighbour, query camera, neighbour camera). Host only.
template <class Descriptor, class Camera, window_of Side>
class filter_windows {
 public:
  /// Matches a table from which sorting costs less than comparing with all keypoints: measured, no influence on
  /// results.
  static constexpr int worthwhile = 2;

  /// Sorts, in the scratch of this call.
  template <class Policy>
  filter_windows(context<Policy>& ctx, const correspondences<Descriptor, Camera, Policy>& matches)
      : ordered_{matches.view(), nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr} {
    const auto& search = ordered_.search;
    const int tables = search.neighbour_count * search.query_cameras * search.neighbour_cameras;
    const std::size_t lists =
        static_cast<std::size_t>(search.query_cameras) * static_cast<std::size_t>(search.neighbour_cameras);
    const std::size_t entries =
        lists * (Side == window_of::candidates
                     ? matches.candidate_count()
                     : static_cast<std::size_t>(search.neighbour_count) * static_cast<std::size_t>(search.slot_count));
    ordered_.offsets = ctx.template scratch<std::int32_t>(static_cast<std::size_t>(tables) *
                                                          (epipolar_order_layout::total_buckets() + 1));
    ordered_.candidates = ctx.template scratch<std::int32_t>(entries);
    ordered_.narrowest = ctx.template scratch<float>(static_cast<std::size_t>(tables));
    ordered_.keypoints = ctx.template scratch<std::int32_t>(entries);
    ordered_.intervals = ctx.template scratch<plane_interval>(entries);
    ordered_.keys = ctx.template scratch<std::int32_t>(entries);
    for_each_index(ctx.policy(), tables, build{*this});
  }

  /// Whether any keypoint of this side that can be consistent with `keypoint` of the other one satisfies the predicate.
  template <class Predicate>
  bool any(int n, std::int32_t keypoint, Predicate predicate) const {
    constexpr bool of_candidates = Side == window_of::candidates;
    const auto& search = ordered_.search;
    const int camera = of_candidates ? search.query().camera_of(keypoint) : search.neighbour(n).camera_of(keypoint);
    const int others = of_candidates ? search.neighbour(n).camera_count : search.query_cameras;
    for (int other = 0; other < others; ++other) {
      const int a = of_candidates ? camera : other, b = of_candidates ? other : camera;
      const epipolar_table table = view(n, a, b);
      if (table.empty()) continue;
      const plane_interval interval =
          of_candidates ? query_interval(n, a, b, keypoint) : interval_of(n, a, b, keypoint);
      bool found = false;
      table.windows(interval, [&](std::int32_t begin, std::int32_t end) {
        for (std::int32_t k = begin; k < end && !found; ++k) found = predicate(table.candidates[k]);
      });
      if (found) return true;
    }
    return false;
  }

 private:
  using ordered = ordered_tables<Descriptor, Camera>;

  struct build {
    filter_windows windows;

    void operator()(int i) const {
      const auto& search = windows.ordered_.search;
      const int b = i % search.neighbour_cameras, a = i / search.neighbour_cameras % search.query_cameras;
      const int n = i / (search.neighbour_cameras * search.query_cameras);
      epipolar_table table = windows.view(n, a, b);
      const std::int64_t slice = table.candidates - windows.ordered_.candidates;
      std::int32_t* keypoints = windows.ordered_.keypoints + slice;
      plane_interval* intervals = windows.ordered_.intervals + slice;
      int count = 0;
      if (b < search.neighbour(n).camera_count) {
        constexpr bool of_candidates = Side == window_of::candidates;
        const std::int32_t* list = of_candidates ? search.candidates + search.candidate_offset[n] : search.queries;
        const int length =
            of_candidates ? search.candidate_offset[n + 1] - search.candidate_offset[n] : search.slot_count;
        for (int k = 0; k < length; ++k) {
          const std::int32_t keypoint = list[k];
          if (of_candidates ? search.neighbour(n).camera_of(keypoint) != b : search.query().camera_of(keypoint) != a)
            continue;
          keypoints[count] = keypoint;
          intervals[count++] =
              of_candidates ? windows.interval_of(n, a, b, keypoint) : windows.query_interval(n, a, b, keypoint);
        }
      }
      table.build(keypoints, intervals, windows.ordered_.keys + slice, count);
    }
  };

  epipolar_table view(int n, int a, int b) const {
    if constexpr (Side == window_of::candidates) {
      return ordered_.view(n, a, b);
    } else {
      const std::int64_t table = ordered_.table(n, a, b);
      return {ordered_.offsets + table * (epipolar_order_layout::total_buckets() + 1),
              ordered_.candidates + table * ordered_.search.slot_count, ordered_.narrowest + table};
    }
  }
  plane_interval interval_of(int n, int a, int b, std::int32_t candidate) const {
    const auto& search = ordered_.search;
    const auto& neighbour = search.neighbour(n);
    const vec3<float>& ray = neighbour.bearing[candidate];
    return ordered_.candidate_measure(search.pair(n, a, b), n, b)(ray, ray.z,
                                                                  search.scale[neighbour.octave[candidate]]);
  }
  plane_interval query_interval(int n, int a, int b, std::int32_t query) const {
    const auto& search = ordered_.search;
    const pair_geometry& g = search.pair(n, a, b);
    const vec3<float>& r = search.query().bearing[query];
    const auto row = [&](int k) {
      return static_cast<float>(g.T_ba.R.m[k].value) * r.x + static_cast<float>(g.T_ba.R.m[k + 1].value) * r.y +
             static_cast<float>(g.T_ba.R.m[k + 2].value) * r.z;
    };
    return ordered_.query_measure(g, a)({row(0), row(3), row(6)}, r.z, search.scale[search.query().octave[query]]);
  }

  ordered ordered_;  // without descriptors: a filter looks at few
};

/// Whether the windows pay: the search itself was ordered, and there are enough matches. O(results).
template <class Descriptor, class Camera>
bool windows_pay(const search_view<Descriptor, Camera>& search) {
  if (search.options.candidate_set != candidates::epipolar_ordered) return false;
  const std::int64_t results = static_cast<std::int64_t>(search.neighbour_count) * search.slot_count;
  std::int64_t matches = 0;
  for (std::int64_t i = 0; i < results; ++i) matches += search.match[i] != no_match ? 1 : 0;
  constexpr std::int64_t worthwhile = filter_windows<Descriptor, Camera, window_of::candidates>::worthwhile;
  return matches > worthwhile * search.neighbour_count * search.query_cameras * search.neighbour_cameras;
}

namespace detail {

/// Index = result: asks the windows. Not drop_matches, whose filters are compiled for devices too.
template <class Descriptor, class Camera, class Filter>
struct drop_matches_on_host {
  search_view<Descriptor, Camera> search;
  Filter filter;

  void operator()(int i) const {
    if (search.match[i] != no_match && !filter.keep_among(search, i)) search.match[i] = no_match;
  }
};

}  // namespace detail

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The filters of correspondences as their definitions read: one match after the other against the whole list, on the
/// host. Geometry by the search's oracle.

#include <turbomap/matching/filters.hpp>

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "descriptor_oracle.hpp"
#include "search_oracle.hpp"

namespace turbomap_test {

/// What a filter decides by, and the matches before it.
template <class Descriptor, class Camera>
struct filter_input {
  using posed = turbomap::posed_keyframe<Descriptor, Camera>;
  using match = turbomap::correspondence<typename Descriptor::distance_type>;

  filter_input(const posed& q, const std::vector<posed>& all, const turbomap::search_options& o)
      : query(q), neighbours(all), options(o), query_group(groups_of(q.view)) {
    for (const posed& n : neighbours) neighbour_group.push_back(groups_of(n.view));
  }

  posed query;
  std::vector<posed> neighbours;
  turbomap::search_options options;
  std::vector<std::uint32_t> query_group;
  std::vector<std::vector<std::uint32_t>> neighbour_group;
  std::vector<match> matches;
  std::vector<doubtful_result> doubtful;  ///< decisions that hung on a close call

  /// Was keypoint `i` of the query compared with keypoint `j` of neighbour `n`?
  bool compared(int n, int i, int j) const {
    const posed& other = neighbours[static_cast<std::size_t>(n)];
    if (!query.has_point.empty() && query.has_point[static_cast<std::size_t>(i)] != 0) return false;
    if (!other.has_point.empty() && other.has_point[static_cast<std::size_t>(j)] != 0) return false;
    if (options.candidate_set != turbomap::candidates::grouped) return true;
    const auto a = query_group[static_cast<std::size_t>(i)];
    return a != turbomap::keypoint::no_group &&
           a == neighbour_group[static_cast<std::size_t>(n)][static_cast<std::size_t>(j)];
  }
  auto distance(int n, int i, int j) const {
    return Descriptor::distance(query.view.descriptor_of(i),
                                neighbours[static_cast<std::size_t>(n)].view.descriptor_of(j));
  }
  bool consistent(int n, int i, int j, close_calls& calls) const {
    const posed& other = neighbours[static_cast<std::size_t>(n)];
    const auto pair = make_oracle_pair(query, query.view.camera_of(i), other, other.view.camera_of(j));
    return oracle_consistent(pair, query.view, i, other.view, j, options, calls);
  }
  void note(const match& m, const close_calls& calls) {
    if (calls.any) doubtful.push_back({m.neighbour, m.query});
  }
};

template <class D, class C>
bool oracle_keeps(filter_input<D, C>& in, const typename filter_input<D, C>::match& m, const turbomap::ratio_test& f) {
  close_calls calls;
  bool keep = true;
  const int count = in.neighbours[static_cast<std::size_t>(m.neighbour)].view.keypoint_count;
  for (int j = 0; j < count; ++j)
    if (j != m.candidate && above_ratio<D>(m.distance, f.ratio, in.distance(m.neighbour, m.query, j), calls) > 0 &&
        in.compared(m.neighbour, m.query, j))
      keep = !in.consistent(m.neighbour, m.query, j, calls) && keep;
  in.note(m, calls);
  return keep;
}
template <class D, class C>
bool oracle_keeps(filter_input<D, C>& in, const typename filter_input<D, C>::match& m, const turbomap::mutual_best&) {
  close_calls calls;
  bool keep = true;
  for (int i = 0; i < in.query.view.keypoint_count; ++i)
    if (std::make_pair(in.distance(m.neighbour, i, m.candidate), i) < std::make_pair(m.distance, m.query) &&
        in.compared(m.neighbour, i, m.candidate))
      keep = !in.consistent(m.neighbour, i, m.candidate, calls) && keep;
  in.note(m, calls);
  return keep;
}

/// What is left of `in.matches` after one filter.
template <class D, class C, class Filter>
auto oracle_filter(filter_input<D, C>& in, const Filter& filter) {
  auto left = in.matches;
  left.erase(std::remove_if(left.begin(), left.end(), [&](const auto& m) { return !oracle_keeps(in, m, filter); }),
             left.end());
  return left;
}
template <class D, class C>
auto oracle_filter(filter_input<D, C>& in, const turbomap::rotation_histogram& filter) {
  using match = typename filter_input<D, C>::match;
  std::vector<match> left;
  for (std::size_t n = 0; n < in.neighbours.size(); ++n) {
    std::vector<std::vector<match>> bins(static_cast<std::size_t>(filter.bins));
    for (const match& m : in.matches) {
      if (m.neighbour != static_cast<int>(n)) continue;
      float change = in.query.view.angle[m.query] - in.neighbours[n].view.angle[m.candidate];
      if (change < 0) change += 360;
      const float bin = change * static_cast<float>(filter.bins) / 360;
      bins[std::min(static_cast<std::size_t>(bin), bins.size() - 1)].push_back(m);
    }
    std::stable_sort(bins.begin(), bins.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
    for (std::size_t k = 0; k < bins.size() && k < static_cast<std::size_t>(filter.kept); ++k)
      if (static_cast<double>(bins[k].size()) >= filter.min_fraction * static_cast<double>(bins[0].size()))
        left.insert(left.end(), bins[k].begin(), bins[k].end());
  }
  std::sort(left.begin(), left.end(), [](const match& a, const match& b) {
    return std::make_pair(a.neighbour, a.query) < std::make_pair(b.neighbour, b.query);
  });
  return left;
}
template <class D, class C>
auto oracle_filter(filter_input<D, C>& in, const turbomap::one_to_one&) {
  using match = typename filter_input<D, C>::match;
  std::map<std::pair<int, int>, match> winner;
  for (const match& m : in.matches) {  // queries ascend: the first of equal ones stays
    const auto [at, fresh] = winner.insert({{m.neighbour, m.candidate}, m});
    if (!fresh && m.distance < at->second.distance) at->second = m;
  }
  auto left = in.matches;
  left.erase(std::remove_if(left.begin(), left.end(),
                            [&](const match& m) {
                              return winner.at({m.neighbour, m.candidate}).query != m.query;
                            }),
             left.end());
  return left;
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What every filter of correspondences is made of: ask each match, drop what the filter does not keep.

#include "../config.hpp"
#include "../context.hpp"
#include "correspondences.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Index = result: drops what the filter does not keep.
template <class Descriptor, class Camera, class Filter>
struct drop_matches {
  search_view<Descriptor, Camera> search;
  Filter filter;

  TURBOMAP_HD void operator()(int i) const {
    if (search.match[i] != no_match && !filter.keep(search, i)) search.match[i] = no_match;
  }
};

}  // namespace detail

/// Drops every match for which `filter` returns false, by one thread each.
template <class Derived, class Descriptor, class Camera, class Filter>
void launch_drop_matches(const thrust::execution_policy<Derived>& policy, const search_view<Descriptor, Camera>& search,
                         const Filter& filter) {
  for_each_index(derived(policy), search.neighbour_count * search.slot_count,
                 detail::drop_matches<Descriptor, Camera, Filter>{search, filter});
}

/// What a filter demands: throws std::invalid_argument naming the option. filter() asks all of its filters before it
/// applies the first.
template <class Matches, class Filter>
void check_filter(const Matches&, const Filter&) {}

/// Removes matches that the filter does not keep. A user's own filter goes this way.
template <class Descriptor, class Camera, class Policy, class Filter>
void apply_filter(context<Policy>& ctx, correspondences<Descriptor, Camera, Policy>& matches, const Filter& filter) {
  launch_drop_matches(ctx.policy(), matches.view(), filter);
}

TURBOMAP_END_NAMESPACE

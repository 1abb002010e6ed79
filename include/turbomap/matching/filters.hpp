// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Filters of correspondences, composable in any order: `filter(ctx, matches, ratio_test{0.8}, mutual_best{}, one_to_one{})`.
/// Each removes matches, where the matches are. A user's own filter is a plain struct with
/// `template <class D, class C> TURBOMAP_HD bool keep(const search_view<D, C>& search, int i) const`. It is asked about
/// results search.match[i] that are a match, concurrently: of `match` it may read element i only.

#include "../config.hpp"
#include "../context.hpp"
#include "apply_filter.hpp"
#include "correspondences.hpp"
#include "mutual_best.hpp"
#include "one_to_one.hpp"
#include "ratio_test.hpp"
#include "rotation_filter.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Applies the filters one after the other. The result is equal on every policy. When one of them has bad options, none is
/// applied. Cost: rotation_histogram and one_to_one O(results); ratio_test and mutual_best as they say.
template <class Descriptor, class Camera, class Policy, class... Filters>
void filter(context<Policy>& ctx, correspondences<Descriptor, Camera, Policy>& matches, const Filters&... filters) {
  (check_filter(matches, filters), ...);
  (apply_filter(ctx, matches, filters), ...);
}

TURBOMAP_END_NAMESPACE

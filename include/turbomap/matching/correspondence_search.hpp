// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Keypoint correspondences of one keyframe against all its neighbours, in one call.

#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../context.hpp"
#include "correspondences.hpp"
#include "exhaustive_search.hpp"
#include "ordered_search.hpp"
#include "search_setup.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Keypoint -> slot of the query, -1 where it holds a map point. One index per slot or keypoint.
struct clear_slot {
  std::int32_t* slot_of_query;
  TURBOMAP_HD void operator()(int i) const { slot_of_query[i] = -1; }
};
template <class Descriptor, class Camera>
struct clear_match {
  search_view<Descriptor, Camera> search;
  TURBOMAP_HD void operator()(int i) const {
    search.match[i] = no_match;
    search.distance[i] = search.max_distance;
  }
};
struct set_slot {
  std::int32_t* slot_of_query;
  const std::int32_t* queries;
  TURBOMAP_HD void operator()(int i) const { slot_of_query[queries[i]] = i; }
};

}  // namespace detail

/// For each keypoint of `query` without a map point and each neighbour: the keypoint of the neighbour without a map point,
/// of least descriptor distance <= options.max_distance, that passes the epipole guard and the epipolar test
/// [TurboMap §IV-C], [ORB-SLAM3]. A neighbour keypoint may be claimed by several query keypoints: see filters.hpp.
///
/// \param ctx         the execution context; a bare policy works too, see below
/// \param query       the new keyframe
/// \param neighbours  any number, also none; neighbours with too short a baseline are the caller's to leave out
///                    (baseline_suffices_stereo, baseline_suffices_monocular)
/// \param options     thresholds, candidates, ties
/// \param result      of this context; overwritten, its memory reused. Under CUDA the search may still be running on return
/// \throws std::invalid_argument naming argument and value (poses that are not finite, sizes that do not fit...); `result`
///         is then as it was
/// \throws std::bad_alloc  there is no memory left; `result` then holds no matches
/// Cost: exhaustive O(query keypoints x candidates); ordered about 2 % of that; grouped O(pairs in equal words).
template <class Descriptor, class Camera, class Policy>
void search_correspondences(context<Policy>& ctx, const posed_keyframe<Descriptor, Camera>& query,
                            span<const posed_keyframe<Descriptor, Camera>> neighbours, const search_options& options,
                            correspondences<Descriptor, Camera, Policy>& result) {
  static_assert(require_descriptor<Descriptor>());
  static_assert(require_camera<Camera>());
  ctx.begin_call();
  search_setup<Descriptor, Camera, Policy> setup{ctx, result};
  setup(query, neighbours, options);
  const auto& search = result.view();
  const int results = search.neighbour_count * search.slot_count;
  if (results == 0) return;
  try {
    setup.prepare_pairs();
    if (options.candidate_set == candidates::grouped) {
      const int groups = query.view.groups.group_count, keypoints = query.view.keypoint_count;
      auto* slots = ctx.template scratch<std::int32_t>(static_cast<std::size_t>(keypoints));
      for_each_index(ctx.policy(), keypoints, detail::clear_slot{slots});
      for_each_index(ctx.policy(), search.slot_count, detail::set_slot{slots, search.queries});
      for_each_index(ctx.policy(), results, detail::clear_match<Descriptor, Camera>{search});
      for_each_index(ctx.policy(), search.neighbour_count * groups,
                     grouped_search<Descriptor, Camera>{search, slots, groups});
    } else if constexpr (std::is_same_v<memory_of_t<Policy>, host_memory>) {
      if (options.candidate_set == candidates::epipolar_ordered)
        run_ordered(ctx, search, result.candidate_count());
      else
        for_each_index(ctx.policy(), results, exhaustive_search<Descriptor, Camera>{search});
    } else {
      for_each_index(ctx.policy(), results, exhaustive_search<Descriptor, Camera>{search});
    }
  } catch (...) {  // out of memory
    result.clear();
    throw;
  }
}

/// The same with a fresh result.
template <class Descriptor, class Camera, class Policy>
correspondences<Descriptor, Camera, Policy> search_correspondences(
    context<Policy>& ctx, const posed_keyframe<Descriptor, Camera>& query,
    span<const posed_keyframe<Descriptor, Camera>> neighbours, const search_options& options = {}) {
  correspondences<Descriptor, Camera, Policy> result(ctx);
  search_correspondences(ctx, query, neighbours, options, result);
  return result;
}

/// The same under a bare policy, in a temporary context: the plan, on the host.
template <class Descriptor, class Camera, class Policy, class = std::enable_if_t<!is_context<Policy>::value>>
typename correspondences<Descriptor, Camera, Policy>::plan_type search_correspondences(
    const Policy& policy, const posed_keyframe<Descriptor, Camera>& query,
    span<const posed_keyframe<Descriptor, Camera>> neighbours, const search_options& options = {}) {
  context<Policy> ctx(policy);
  return search_correspondences(ctx, query, neighbours, options).plan(ctx);
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Keypoint correspondences of one keyframe with all its neighbours, in one call: the keypoints that may show the same point
/// of the scene, because their descriptors are alike and they lie on each other's epipolar curves.

#include <cstdint>
#include <type_traits>

#include "../config.hpp"
#include "../context.hpp"
#include "../descriptor/descriptor_concept.hpp"
#include "../named_range.hpp"
#include "../precompiled.hpp"
#include "correspondences.hpp"
#include "exhaustive_search.hpp"
#include "grouped_search.hpp"
#include "ordered_search.hpp"
#include "prepare_search.hpp"
#include "search_setup.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// For each keypoint of `query` without a map point and each neighbour: the keypoint of the neighbour without a map point,
/// of least descriptor distance <= options.max_distance, that passes the epipole guard and the epipolar test
/// [TurboMap §IV-C], [ORB-SLAM3]. A neighbour keypoint may be claimed by several query keypoints: see filters.hpp.
///
/// \param ctx         the execution context; a bare policy works too, see below
/// \param query       the new keyframe
/// \param neighbours  any number, also none; the caller leaves out those with too short a baseline
///                    (baseline_suffices_stereo, baseline_suffices_monocular)
/// \param options     thresholds, candidates, ties
/// \param result      of this context; overwritten, its memory reused. Under CUDA the search may still be running on return
/// \throws std::invalid_argument  with argument and value: poses that are not finite, sizes that do not fit...; `result` is
///                                then as it was
/// \throws std::bad_alloc  there is no memory left; `result` then holds no matches
/// Cost: exhaustive O(query keypoints x candidates); ordered about 2 % of that; grouped O(pairs in equal words).
template <class Descriptor, class Camera, class Policy>
void search_correspondences(context<Policy>& ctx, const posed_keyframe<Descriptor, Camera>& query,
                            span<const posed_keyframe<Descriptor, Camera>> neighbours, const search_options& options,
                            correspondences<Descriptor, Camera, Policy>& result) {
  static_assert(require_descriptor<Descriptor>());
  static_assert(require_camera<Camera>());
  const named_range range("search_correspondences");
  ctx.begin_call();
  set_up_search(ctx, query, neighbours, options, result.buffers());
  const auto& search = result.view();
  if (search.neighbour_count * search.slot_count == 0) return;
  if (options.candidate_set != candidates::grouped && options.stopped()) return result.clear();
  try {
    bool finished = true;
    launch_prepare_search(ctx.policy(), search);
    switch (options.candidate_set) {
      case candidates::grouped: {
        const int groups = query.view.groups.group_count, keypoints = query.view.keypoint_count;
        auto* slots = ctx.template scratch<std::int32_t>(static_cast<std::size_t>(keypoints));
        launch_number_slots(ctx.policy(), search, slots, keypoints);
        launch_clear_matches(ctx.policy(), search);
        launch_search_groups(ctx.policy(), search, slots, groups);
        break;
      }
      case candidates::epipolar_ordered:
        finished = launch_search_ordered(ctx.policy(), search, ctx.scratch());
        break;
      case candidates::exhaustive:
        finished = launch_search_exhaustive(ctx.policy(), search);
        break;
    }
    // What was not reached has no meaning.
    if (!finished) result.clear();
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

#define TURBOMAP_INSTANTIATE(Descriptor, Camera, Policy)                                                               \
  TURBOMAP_INSTANCE void search_correspondences(context<Policy>&, const posed_keyframe<Descriptor, Camera>&,           \
                                                span<const posed_keyframe<Descriptor, Camera>>, const search_options&, \
                                                correspondences<Descriptor, Camera, Policy>&);
TURBOMAP_PRECOMPILED_SEARCHES(TURBOMAP_INSTANTIATE)
#undef TURBOMAP_INSTANTIATE

TURBOMAP_END_NAMESPACE

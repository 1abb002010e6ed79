// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Points of the map looked for in a new frame: what tracking does with every image, to find the part of the map that the
/// image shows. Each point is projected with the pose that tracking predicts, and the most similar keypoint near the
/// projection is taken for a view of it. Several frames may be searched in one call.

#include <type_traits>

#include "../camera/camera_concept.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../descriptor/descriptor_concept.hpp"
#include "../named_range.hpp"
#include "../precompiled.hpp"
#include "prepare_cameras.hpp"
#include "projection_setup.hpp"
#include "projections.hpp"
#include "search_projections.hpp"
#include "settle_claims.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// For each point and each camera of each target: projects the point, and looks around it for the keypoint of least
/// descriptor distance <= options.max_distance whose octave fits [ORB-SLAM3].
/// In this order: not skipped; depth > 0; inside the image (view.cells.bounds, [min, max)); distance to the camera in
/// [min_range_factor min_distance, max_range_factor max_distance]; viewing ray . normal >= min_view_cosine x distance;
/// octave predicted as the least k with max_distance / distance <= s^k, clamped; keypoints with |du|, |dv| < radius s^k
/// (oblique_factor times that where viewing ray . normal < oblique_cosine x distance; for a point with a covariance at least
/// window_sigmas of the deviation of u, v, keypoint and projection together, at most max_radius) that are not taken, and of octave
/// k - finer_octaves to k + coarser_octaves; with options.gate, e^T W e <= mono_chi2, or stereo_chi2 with u_right
/// (rectilinear cameras with bf), see projection_gate; best distance <= max_ratio x second best, both of such keypoints. Then, with
/// one_to_one: of the points that match one keypoint the one of least (distance, index) keeps it, the others go without.
/// Ties of keypoints: first by cell column, cell row, keypoint; without a cell index by keypoint. Equal on every policy.
///
/// \param ctx      the execution context; a bare policy works too, see below
/// \param points   in host memory; a host policy reads them in place, they must stay until it returns. Points with
///                 numbers that are not finite match nothing
/// \param targets  the frames, any number, also none; views in the memory of the policy. The keyframes must stay where they
///                 are until the last use of the result. Rigs of any number of cameras
/// \param options  thresholds
/// \param result   of this context; overwritten, its memory reused. Under CUDA the search may still run on return
/// \throws std::invalid_argument  with argument and value: a pose targets[i].T_cw that is not finite, sizes that do not
///                                fit...; `result` is then as it was
/// \throws std::bad_alloc  there is no memory left; `result` then holds no matches
/// Cost: O(points x cameras of all targets), a few operations for most; O(keypoints in the window) for those in view.
template <class Descriptor, class Camera, class Policy>
void search_by_projection(context<Policy>& ctx, const map_point_view<Descriptor>& points,
                          span<const projection_target<Descriptor, Camera>> targets, const projection_options& options,
                          projections<Descriptor, Camera, Policy>& result) {
  static_assert(require_descriptor<Descriptor>());
  static_assert(require_camera<Camera>());
  const named_range range("search_by_projection");
  ctx.begin_call();
  const auto search = set_up_projection_search(ctx, points, targets, options, result.buffers());
  if (search.request_count == 0 || points.count == 0) return;
  try {
    launch_prepare_cameras(ctx.policy(), search);
    launch_search_projections(ctx.policy(), search);
    if constexpr (can_claim<Descriptor>) {
      if (!options.one_to_one) return;
      fill_bytes(ctx.policy(), search.claims, 0xFF, search.claim_count * sizeof(std::uint64_t));
      launch_claim_keypoints(ctx.policy(), search);
      launch_drop_lost_claims(ctx.policy(), search);
    }
  } catch (...) {  // out of memory
    result.clear();
    throw;
  }
}

/// The same with a fresh result.
template <class Descriptor, class Camera, class Policy>
projections<Descriptor, Camera, Policy> search_by_projection(context<Policy>& ctx,
                                                             const map_point_view<Descriptor>& points,
                                                             span<const projection_target<Descriptor, Camera>> targets,
                                                             const projection_options& options = {}) {
  projections<Descriptor, Camera, Policy> result(ctx);
  search_by_projection(ctx, points, targets, options, result);
  return result;
}

/// The same under a bare policy, in a temporary context: the plan, on the host.
template <class Descriptor, class Camera, class Policy, class = std::enable_if_t<!is_context<Policy>::value>>
typename projections<Descriptor, Camera, Policy>::plan_type search_by_projection(
    const Policy& policy, const map_point_view<Descriptor>& points,
    span<const projection_target<Descriptor, Camera>> targets, const projection_options& options = {}) {
  context<Policy> ctx(policy);
  return search_by_projection(ctx, points, targets, options).plan(ctx);
}

#define TURBOMAP_INSTANTIATE(Descriptor, Camera, Policy)                                           \
  TURBOMAP_INSTANCE void search_by_projection(context<Policy>&, const map_point_view<Descriptor>&, \
                                              span<const projection_target<Descriptor, Camera>>,   \
                                              const projection_options&, projections<Descriptor, Camera, Policy>&);
TURBOMAP_PRECOMPILED_SEARCHES(TURBOMAP_INSTANTIATE)
#undef TURBOMAP_INSTANTIATE

TURBOMAP_END_NAMESPACE

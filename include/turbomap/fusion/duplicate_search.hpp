// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Map points looked for again in keyframes that may see them, in one call. Each point is projected into a keyframe, and the
/// most similar keypoint around the projection is taken for another view of it; where that keypoint has a map point already,
/// the two are duplicates to fuse.

#include <type_traits>

#include "../config.hpp"
#include "../context.hpp"
#include "duplicate_options.hpp"
#include "projection_search.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Points found again in keyframes.
template <class Descriptor, class Camera, class Policy>
using duplicates = projections<Descriptor, Camera, Policy>;

/// For each point and each camera of each target: projects the point, and looks around it for the keypoint of least
/// descriptor distance <= options.max_distance whose octave and reprojection error fit [ORB-SLAM3], [TurboMap §IV-D].
/// In this order: not skipped; depth > 0; inside the image (view.cells.bounds, [min, max)); distance to the camera in
/// [min_range_factor min_distance, max_range_factor max_distance]; viewing ray . normal >= min_view_cosine x distance;
/// octave predicted as the least k with max_distance / distance <= s^k, clamped; keypoints with |du|, |dv| < radius s^k
/// and octave k - 1 or k; error^2 / sigma2 <= mono_chi2, or stereo_chi2 with u_right (rectilinear cameras with bf).
/// Ties: first by cell column, cell row, keypoint; without a cell index by keypoint. Equal on every policy. The search
/// changes nothing; the commit has to look at the map again.
///
/// \param ctx      the execution context; a bare policy works too, see below
/// \param points   in host memory; a host policy reads them in place, they must stay until it returns. Points with
///                 numbers that are not finite match nothing
/// \param targets  any number, also none; views in the memory of the policy. The keyframes must stay where they are
///                 until the last use of the result. Rigs of any number of cameras
/// \param options  thresholds
/// \param result   of this context; overwritten, its memory reused. Under CUDA the search may still run on return
/// \throws std::invalid_argument  with argument and value: a pose targets[i].T_cw that is not finite, sizes that do not
///                                fit...; `result` is then as it was
/// \throws std::bad_alloc  there is no memory left; `result` then holds no matches
/// Cost: O(points x cameras of all targets), a few operations for most; O(keypoints in the window) for those in view.
template <class Descriptor, class Camera, class Policy>
void find_duplicates(context<Policy>& ctx, const map_point_view<Descriptor>& points,
                     span<const duplicate_target<Descriptor, Camera>> targets, const duplicate_options& options,
                     duplicates<Descriptor, Camera, Policy>& result) {
  search_by_projection(ctx, points, targets, static_cast<projection_options>(options), result);
}

/// The same with a fresh result.
template <class Descriptor, class Camera, class Policy>
duplicates<Descriptor, Camera, Policy> find_duplicates(context<Policy>& ctx, const map_point_view<Descriptor>& points,
                                                       span<const duplicate_target<Descriptor, Camera>> targets,
                                                       const duplicate_options& options = {}) {
  duplicates<Descriptor, Camera, Policy> result(ctx);
  find_duplicates(ctx, points, targets, options, result);
  return result;
}

/// The same under a bare policy, in a temporary context: the plan, on the host.
template <class Descriptor, class Camera, class Policy, class = std::enable_if_t<!is_context<Policy>::value>>
typename duplicates<Descriptor, Camera, Policy>::plan_type find_duplicates(
    const Policy& policy, const map_point_view<Descriptor>& points,
    span<const duplicate_target<Descriptor, Camera>> targets, const duplicate_options& options = {}) {
  context<Policy> ctx(policy);
  return find_duplicates(ctx, points, targets, options).plan(ctx);
}

TURBOMAP_END_NAMESPACE

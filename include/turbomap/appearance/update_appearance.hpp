// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a map point looks like, from all keyframes that see it: the descriptor that represents it best, the direction it is
/// mostly seen from, and the distances from which the image pyramid can find it. Computed anew when the observations or the
/// position of points have changed: all such points in one call, plain arrays in, a plan out.

#include "../camera/camera_concept.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../descriptor/descriptor_concept.hpp"
#include "../named_range.hpp"
#include "../precompiled.hpp"
#include "../span.hpp"
#include "../store/posed_keyframe.hpp"
#include "appearance_check.hpp"
#include "appearance_setup.hpp"
#include "appearance_view.hpp"
#include "appearances.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Computes representative descriptor, normal and distance range of points anew from all their observations
/// [ORB-SLAM3]. The descriptor is the medoid: the one with the least median distance to all of the point's, itself
/// included with distance 0; the median of n sorted distances is element floor((n - 1) / 2); of equals the first
/// observation. Every camera's view counts. The range starts from the distance between the point and camera 0 of its
/// reference keyframe, and the octave of its keypoint there: camera 0's if that sees the point, else the first. The covariance
/// of the position (if options.covariance) is the inverse of the sum of the views' information: camera/point_uncertainty.hpp.
/// \param keyframes  all that observe a point; their arrays in the memory of the policy. has_point is not read
/// \param result     overwritten. Under CUDA the work may still be running on return
/// \throws std::invalid_argument  an index, offset, pose, position or option that cannot be; a reference keyframe that
///                                does not observe its point; a view in host memory whose keypoint, of those that are observed,
///                                names a camera that its rig does not have. The previous result stays
/// Of a point with more than options.most_views observations, so many stand for all: descriptor and normal are computed of
/// those, range and covariance of all.
/// Cost: n^2 / 2 descriptor distances for a point of which n observations take part, n^2 on a device or above
/// medoid_table_size.
template <class Descriptor, class Camera, class Policy>
void update_appearance(context<Policy>& ctx, const appearance_view& view,
                       span<const posed_keyframe<Descriptor, Camera>> keyframes, const appearance_options& options,
                       appearances<Descriptor, Camera, Policy>& result) {
  static_assert(require_descriptor<Descriptor>());
  static_assert(require_camera<Camera>());
  detail::check_appearance_arguments(memory_of_t<Policy>{}, view, keyframes, options);
  const named_range range("update_appearance");
  ctx.begin_call();
  try {
    auto& buffers = result.buffers();
    const auto in = set_up_appearance(ctx, view, keyframes, options, buffers);
    if (view.count == 0) return;
    if (options.geometry) launch_find_camera_centres(ctx.policy(), in, static_cast<int>(keyframes.size()));
    launch_compute_appearance(ctx.policy(), in, view.count, buffers.points.data(),
                              options.descriptors ? buffers.descriptors.data() : nullptr);
  } catch (...) {  // out of memory
    result.clear();
    throw;
  }
}

#define TURBOMAP_INSTANTIATE(Descriptor, Camera, Policy)                                                              \
  TURBOMAP_INSTANCE void update_appearance(context<Policy>&, const appearance_view&,                                  \
                                           span<const posed_keyframe<Descriptor, Camera>>, const appearance_options&, \
                                           appearances<Descriptor, Camera, Policy>&);
TURBOMAP_PRECOMPILED_SEARCHES(TURBOMAP_INSTANTIATE)
#undef TURBOMAP_INSTANTIATE

TURBOMAP_END_NAMESPACE

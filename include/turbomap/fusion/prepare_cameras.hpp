// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Where every camera of the targets is, computed once per search.

#include "../camera/camera_concept.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../math/linear.hpp"
#include "../math/strict.hpp"
#include "projection_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = request.
template <class Descriptor, class Camera>
struct prepare_projection_camera {
  projection_view<Descriptor, Camera> search;  ///< reads requests and keyframes, writes cameras

  /// Places camera i.
  TURBOMAP_HD void operator()(int i) const {
    projection_camera c;
    c.of = search.requests[i];
    const auto& camera = search.keyframes[c.of.target].cameras[c.of.camera];
    c.T_cw = to_isometry<decision>(camera.T_camera_body) * to_isometry<decision>(search.T_cw[c.of.target]);
    c.centre = camera_centre(c.T_cw);
    pinhole<double> K;
    c.bf = decision(as_pinhole(camera.camera, K) && camera.bf > 0 ? camera.bf : 0.0);
    search.cameras[i] = c;
  }
};

/// Places every camera, by one thread each.
template <class Derived, class Descriptor, class Camera>
void launch_prepare_cameras(const thrust::execution_policy<Derived>& policy,
                            const projection_view<Descriptor, Camera>& search) {
  for_each_index(derived(policy), search.request_count, prepare_projection_camera<Descriptor, Camera>{search});
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What update_appearance() demands of its arguments, on the host before anything is changed.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "../math/number_checks.hpp"
#include "../memory.hpp"
#include "../store/argument_checks.hpp"
#include "../store/posed_keyframe.hpp"
#include "appearance_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class Descriptor, class Camera>
void check_observing_keyframes(span<const posed_keyframe<Descriptor, Camera>> keyframes,
                               const appearance_options& options) {
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const auto& v = keyframes[i].view;
    const argument_name name("keyframes", i);
    check_keypoint_count(name, v);
    if (v.keypoint_count > 0 && options.descriptors && v.descriptor == nullptr)
      reject(name + ".view.descriptor", "null", "is needed for descriptors");
    if (!options.geometry) continue;
    check_pose(name, keyframes[i].T_cw);
    check_rig(name, v);
    if (v.keypoint_count > 0 && v.octave == nullptr) reject(name + ".view.octave", "null", "is needed for geometry");
  }
}

/// Throws std::invalid_argument naming what is wrong with the arguments of a call whose views are in `memory`. O(observations).
template <class Memory, class Descriptor, class Camera>
void check_appearance_arguments(Memory, const appearance_view& view,
                                span<const posed_keyframe<Descriptor, Camera>> keyframes,
                                const appearance_options& options) {
  const auto element = [](const char* array, std::int32_t i) {
    return argument_name(array, static_cast<std::size_t>(i));
  };
  check_scales(options.scales);
  require(!options.covariance || options.geometry, "options.covariance", options.covariance, "needs geometry");
  check_correlation("options.stereo_correlation", options.stereo_correlation);
  check_observing_keyframes(keyframes, options);
  require(options.most_views >= 0, "options.most_views", options.most_views, "must not be negative");
  require(view.count >= 0, "view.count", view.count, "must not be negative");
  if (view.count == 0) return;
  const std::int32_t* offset = view.observation_offset;
  require(offset != nullptr, "view.observation_offset", "null", "is needed");
  require(offset[0] == 0, "view.observation_offset[0]", offset[0], "must be 0");
  for (int i = 0; i < view.count; ++i)
    if (offset[i + 1] < offset[i])
      reject(element("view.observation_offset", i + 1).text(), offset[i + 1], "must ascend");
  require(offset[view.count] == 0 || view.observations != nullptr, "view.observations", "null", "are needed");
  if (options.geometry) {
    require(view.position != nullptr, "view.position", "null", "is needed for geometry");
    require(view.reference != nullptr, "view.reference", "null", "is needed for geometry");
  }
  const auto keyframe_count = static_cast<std::int64_t>(keyframes.size());
  for (int i = 0; i < view.count; ++i) {
    bool is_observer = false;
    for (std::int32_t o = offset[i]; o < offset[i + 1]; ++o) {
      const auto [keyframe, keypoint] = view.observations[o];
      if (keyframe < 0 || keyframe >= keyframe_count)
        reject(element("view.observations", o) + ".keyframe", keyframe, "is no keyframe of the call");
      if (keypoint < 0 || keypoint >= keyframes[static_cast<std::size_t>(keyframe)].view.keypoint_count)
        reject(element("view.observations", o) + ".keypoint", keypoint, "is no keypoint of its keyframe");
      // Of the keypoints that are read only: a point may have thousands of observers.
      if constexpr (is_host_accessible_v<Memory>) {
        const auto& v = keyframes[static_cast<std::size_t>(keyframe)].view;
        if (options.geometry && v.camera_of(keypoint) >= v.camera_count)
          reject(element("keyframes", keyframe) + ".view.camera", v.camera_of(keypoint),
                 "must be below the number of cameras");
      }
      is_observer = is_observer || (options.geometry && keyframe == view.reference[i]);
    }
    if (!options.geometry || offset[i] == offset[i + 1]) continue;
    if (!is_observer) reject(element("view.reference", i).text(), view.reference[i], "does not observe the point");
    const vec3<double>& X = view.position[i];
    if (!(is_finite(X.x) && is_finite(X.y) && is_finite(X.z)))
      reject(element("view.position", i).text(), X.x + X.y + X.z, "must be finite");
  }
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

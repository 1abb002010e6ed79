// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What an update of map points demands of its arguments, on the host before anything is changed.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "../store/posed_keyframe.hpp"
#include "appearance_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

inline std::string numbered(const char* array, int i) { return std::string(array) + "[" + std::to_string(i) + "]"; }

template <class Descriptor, class Camera>
void check_observers(span<const posed_keyframe<Descriptor, Camera>> keyframes, const appearance_options& options) {
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const auto& v = keyframes[i].view;
    const rigid_transform<double>& T = keyframes[i].T_cw;
    const auto refuse = [i](const char* member, auto value, const char* rule) {
      reject((numbered("keyframes", static_cast<int>(i)) + member).c_str(), value, rule);
    };
    if (!(v.keypoint_count >= 0)) refuse(".view.keypoint_count", v.keypoint_count, "must not be negative");
    if (v.keypoint_count > 0 && options.descriptors && v.descriptor == nullptr)
      refuse(".view.descriptor", "null", "is needed for descriptors");
    if (!options.geometry) continue;
    const double sum = T.qx + T.qy + T.qz + T.qw + T.tx + T.ty + T.tz;
    const double norm = T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw;
    if (!is_finite(sum)) refuse(".T_cw", sum, "a pose must be finite");
    if (!(std::abs(norm - 1) < 1e-3)) refuse(".T_cw squared quaternion norm", norm, "must be 1");
    if (!(v.camera_count >= 1 && v.cameras != nullptr))
      refuse(".view.camera_count", v.camera_count, "a keyframe needs a rig of at least one camera");
    if (v.keypoint_count > 0 && v.octave == nullptr) refuse(".view.octave", "null", "is needed for geometry");
  }
}

/// Throws std::invalid_argument naming what is wrong. O(observations).
template <class Descriptor, class Camera>
void check_appearance_arguments(const appearance_view& view, span<const posed_keyframe<Descriptor, Camera>> keyframes,
                                const appearance_options& options) {
  const pyramid& s = options.scales;
  require(s.levels >= 1 && s.levels <= 256, "options.scales.levels", s.levels,
          "must be in [1, 256]: octaves are bytes");
  require(s.scale_factor >= 1 && is_finite(s.scale_factor), "options.scales.scale_factor", s.scale_factor,
          "must be finite and at least 1");
  check_observers(keyframes, options);
  require(view.count >= 0, "view.count", view.count, "must not be negative");
  if (view.count == 0) return;
  const std::int32_t* offset = view.observation_offset;
  require(offset != nullptr, "view.observation_offset", "null", "is needed");
  require(offset[0] == 0, "view.observation_offset[0]", offset[0], "must be 0");
  for (int i = 0; i < view.count; ++i)
    if (offset[i + 1] < offset[i]) reject(numbered("view.observation_offset", i + 1), offset[i + 1], "must ascend");
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
        reject(numbered("view.observations", o) + ".keyframe", keyframe, "is no keyframe of the call");
      if (keypoint < 0 || keypoint >= keyframes[static_cast<std::size_t>(keyframe)].view.keypoint_count)
        reject(numbered("view.observations", o) + ".keypoint", keypoint, "is no keypoint of its keyframe");
      is_observer = is_observer || (options.geometry && keyframe == view.reference[i]);
    }
    if (!options.geometry || offset[i] == offset[i + 1]) continue;
    if (!is_observer) reject(numbered("view.reference", i), view.reference[i], "does not observe the point");
    const vec3<double>& X = view.position[i];
    if (!(is_finite(X.x) && is_finite(X.y) && is_finite(X.z)))
      reject(numbered("view.position", i), X.x + X.y + X.z, "must be finite");
  }
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reads a user's keyframe through its traits into flat host arrays.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../error.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "../traits.hpp"
#include "../types.hpp"
#include "keyframe_view.hpp"

namespace turbomap {

/// Host arrays that gather() fills; used again for the next keyframe.
template <class Descriptor, class Camera>
struct keyframe_buffer {
  plain_vector<keypoint> keypoints;                        ///< as the traits give them
  plain_vector<typename Descriptor::element> descriptors;  ///< one after the other, in the order of the keypoints
  plain_vector<rig_camera<Camera>> cameras;                ///< of the rig
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// The camera model behind keyframe_traits<KeyFrame>::rig.
template <class KeyFrame>
using keyframe_camera_t =
    std::decay_t<decltype(std::declval<const typename keyframe_traits<KeyFrame>::rig&>()[0].camera)>;

/// What keypoints span, as whole pixels; [0, 1) without keypoints. Keypoints that are not finite are left to
/// validate().
inline image_bounds bounds_of(span<const keypoint> keypoints) {
  if (keypoints.empty()) return {0, 0, 1, 1};
  image_bounds b{keypoints[0].x, keypoints[0].y, keypoints[0].x, keypoints[0].y};
  for (const keypoint& k : keypoints) {
    b.min_x = std::min(b.min_x, k.x), b.max_x = std::max(b.max_x, k.x);
    b.min_y = std::min(b.min_y, k.y), b.max_y = std::max(b.max_y, k.y);
  }
  return {std::floor(b.min_x), std::floor(b.min_y), std::floor(b.max_x) + 1, std::floor(b.max_y) + 1};
}

namespace detail {
template <class KeyFrame>
auto guard_of([[maybe_unused]] const KeyFrame& keyframe) {
  if constexpr (has_member<guard_member, KeyFrame, keyframe_traits<KeyFrame>>::value)
    return keyframe_traits<KeyFrame>::guard(keyframe);
  else
    return nullptr;
}
}  // namespace detail

/// Copies keypoints, descriptors and cameras of a keyframe into `buffer`, under the guard of its traits if there is
/// one, and returns the data, which point into the buffer. Throws std::invalid_argument when a descriptor is null or too
/// short, or there are more than 2^31 - 1 keypoints, and what the traits throw. O(N).
template <class KeyFrame, class Descriptor, class Camera>
keyframe_data<Descriptor, Camera> gather(const KeyFrame& keyframe, keyframe_buffer<Descriptor, Camera>& buffer) {
  keyframe_data<Descriptor, Camera> data;
  static_assert(require_keyframe_traits<KeyFrame>());
  if constexpr (has_keyframe_traits_v<KeyFrame>) {
    using traits = keyframe_traits<KeyFrame>;
    static_assert(std::is_same_v<typename traits::descriptor, Descriptor>,
                  "turbomap: this store holds other descriptors than keyframe_traits<KeyFrame>::descriptor");
    static_assert(std::is_same_v<keyframe_camera_t<KeyFrame>, Camera>,
                  "turbomap: this store holds other cameras than those of keyframe_traits<KeyFrame>::rig");
    [[maybe_unused]] const auto held = detail::guard_of(keyframe);
    const auto n = static_cast<std::size_t>(traits::keypoint_count(keyframe));
    require(n <= static_cast<std::size_t>(std::numeric_limits<int>::max()), "keypoint_count", n, "must be below 2^31");
    constexpr auto elements = static_cast<std::size_t>(Descriptor::elements);
    buffer.keypoints.resize(n);
    buffer.descriptors.resize(n * elements);
    for (std::size_t i = 0; i < n; ++i) {
      buffer.keypoints[i] = traits::keypoint(keyframe, i);
      const auto& given = traits::descriptor_data(keyframe, i);  // a value lives until it is copied
      const auto* descriptor = detail::elements_of<Descriptor>(given);
      require(descriptor != nullptr, "keypoint without descriptor_data", i, "there is a descriptor for every keypoint");
      std::copy_n(descriptor, elements, buffer.descriptors.data() + i * elements);
    }
    decltype(auto) cameras = traits::cameras(keyframe);
    buffer.cameras.clear();
    for (int i = 0; i < static_cast<int>(cameras.size()); ++i) buffer.cameras.push_back(cameras[i]);
    if constexpr (detail::has_member<detail::bounds_member, KeyFrame, traits>::value)
      data.bounds = traits::bounds(keyframe);
    else
      data.bounds = bounds_of(buffer.keypoints);
    data.keypoint_count = static_cast<int>(n);
    data.keypoints = buffer.keypoints.data();
    data.descriptors = buffer.descriptors.data();
    data.cameras = buffer.cameras.data();
    data.camera_count = static_cast<int>(buffer.cameras.size());
  }
  return data;
}

TURBOMAP_END_NAMESPACE

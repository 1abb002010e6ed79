// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Visual-word groups of keypoints from the feature vector of a bag of words (DBoW2, FBoW and their kin): for each node of the
/// vocabulary tree at some level, the keypoints below it. A grouped search compares keypoints of one node only. Includes none of
/// those libraries: anything that is walked like a std::map<unsigned, std::vector<unsigned>> will do.

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../span.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {
/// Whether x is an integer in [0, end).
template <class T>
bool in_group_range(T x, std::uint64_t end) {
  static_assert(std::is_integral_v<T>, "turbomap: nodes and keypoints of a feature vector are integers");
  if constexpr (std::is_signed_v<T>)
    if (x < 0) return false;
  return static_cast<std::uint64_t>(x) < end;
}
}  // namespace detail

/// Sets keypoint::group of each keypoint that the feature vector names to its node, of all others to keypoint::no_group.
/// \param features  pairs (node, keypoint indices), e.g. DBoW2::FeatureVector or fbow::fBow2
/// \param first  index of the first keypoint of this feature vector, where each camera of a rig has one of its own
/// \param count  of the keypoints that belong to it; those before and behind are left alone
/// Throws std::invalid_argument for a node or keypoint that is out of range, or a keypoint that is named twice; nothing is changed then.
/// O(keypoints).
template <class FeatureVector>
void set_groups(span<keypoint> keypoints, const FeatureVector& features, std::size_t first, std::size_t count) {
  require(first <= keypoints.size() && count <= keypoints.size() - first, "count", count,
          "and first must name a part of the keypoints");
  std::vector<char> named(count, 0);
  for (const auto& [node, indices] : features) {
    require(detail::in_group_range(node, keypoint::no_group), "features[].node", node, "is no group");
    for (const auto i : indices) {
      require(detail::in_group_range(i, count), "features[].keypoint", i, "is not a keypoint of the image");
      require(named[static_cast<std::size_t>(i)] == 0, "features[].keypoint", i, "is named twice");
      named[static_cast<std::size_t>(i)] = 1;
    }
  }
  for (std::size_t i = first; i < first + count; ++i) keypoints[i].group = keypoint::no_group;
  for (const auto& [node, indices] : features)
    for (const auto i : indices)
      keypoints[first + static_cast<std::size_t>(i)].group = static_cast<std::uint32_t>(node);
}
/// Of all keypoints.
template <class FeatureVector>
void set_groups(span<keypoint> keypoints, const FeatureVector& features) {
  set_groups(keypoints, features, 0, keypoints.size());
}

TURBOMAP_END_NAMESPACE

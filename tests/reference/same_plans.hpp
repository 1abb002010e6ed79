// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether two entries of a plan, or two plans, are equal to the last bit (padding aside).

#include <turbomap/fusion/projection_options.hpp>
#include <turbomap/matching/creation_plan.hpp>
#include <turbomap/matching/search_options.hpp>

#include <algorithm>
#include <cstring>

namespace turbomap_test {

template <class Distance>
bool same(const turbomap::correspondence<Distance>& a, const turbomap::correspondence<Distance>& b) {
  return a.neighbour == b.neighbour && a.query == b.query && a.candidate == b.candidate &&
         std::memcmp(&a.distance, &b.distance, sizeof a.distance) == 0;
}
template <class Distance>
bool same(const turbomap::projection_match<Distance>& a, const turbomap::projection_match<Distance>& b) {
  return a.target == b.target && a.camera == b.camera && a.point == b.point && a.keypoint == b.keypoint &&
         std::memcmp(&a.distance, &b.distance, sizeof a.distance) == 0;
}
template <class Distance>
bool same(const turbomap::projection_trial<Distance>& a, const turbomap::projection_trial<Distance>& b) {
  return a.outcome == b.outcome && a.level == b.level && a.keypoint == b.keypoint &&
         std::memcmp(&a.distance, &b.distance, sizeof a.distance) == 0;
}
inline bool same(const turbomap::created_point& a, const turbomap::created_point& b) {
  return a.neighbour == b.neighbour && a.query == b.query && a.candidate == b.candidate && a.outcome == b.outcome &&
         a.method == b.method && std::memcmp(&a.position, &b.position, sizeof a.position) == 0;
}
inline bool same(const turbomap::created_track& a, const turbomap::created_track& b) {
  if (a.outcome != b.outcome || a.method != b.method) return false;
  if (a.outcome != turbomap::creation_outcome::accepted) return true;
  return a.views == b.views && std::memcmp(&a.position, &b.position, sizeof a.position) == 0 &&
         std::memcmp(&a.covariance, &b.covariance, sizeof a.covariance) == 0;
}
template <class List>
auto same(const List& a, const List& b) -> decltype(a.begin(), bool{}) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& x, const auto& y) { return same(x, y); });
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether two points of a map are two: because one image shows both, or because it is known where they are. What is not two may
/// be merged (map_edit.hpp). The caller holds the map's guard; both points are alive.

#include <cstddef>

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/strict.hpp"
#include "../math/symmetric3.hpp"
#include "map_traits.hpp"
#include "merge_rule.hpp"
#include "observation_counts.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Whether one image shows the two points at two keypoints, so that they are two. O(views of one x views of the other).
template <class Map>
bool seen_apart(const Map& map, typename map_traits<Map>::point a, typename map_traits<Map>::point b) {
  using traits = map_traits<Map>;
  bool apart = false;
  traits::for_each_observation(map, a, [&](typename traits::keyframe observer, std::size_t keypoint) {
    apart = apart || observed_at(map, b, observer, keypoint_of(map, observer, keypoint).camera) >= 0;
  });
  return apart;
}

/// The same, of keypoints that are farther apart than the tolerance.
template <class Map>
bool seen_apart(const Map& map, typename map_traits<Map>::point a, typename map_traits<Map>::point b,
                const merge_tolerance& tolerance) {
  using traits = map_traits<Map>;
  using S = strict<double>;
  const auto sigma2 = [&](int octave) {
    S s(1);
    for (int o = 0; o < octave; ++o) s *= S(static_cast<double>(tolerance.scale_factor));
    return s * s;
  };
  bool apart = false;
  traits::for_each_observation(map, a, [&](typename traits::keyframe observer, std::size_t keypoint) {
    const auto& k = keypoint_of(map, observer, keypoint);
    const auto other = observed_at(map, b, observer, k.camera);
    if (other < 0) return;
    const auto& o = keypoint_of(map, observer, static_cast<std::size_t>(other));
    const S dx(static_cast<double>(k.x) - static_cast<double>(o.x));
    const S dy(static_cast<double>(k.y) - static_cast<double>(o.y));
    apart = apart || !(dx * dx + dy * dy <= S(tolerance.chi2) * (sigma2(k.octave) + sigma2(o.octave)));
  });
  return apart;
}

/// Whether two points lie apart by what the map knows of them: (a - b)^T (Sigma_a + Sigma_b)^-1 (a - b) > tolerance.position_chi2.
/// False where it keeps no covariances, or one of these is 0: then nobody knows.
template <class Map>
bool known_apart([[maybe_unused]] const Map& map, [[maybe_unused]] typename map_traits<Map>::point a,
                 [[maybe_unused]] typename map_traits<Map>::point b,
                 [[maybe_unused]] const merge_tolerance& tolerance) {
  if constexpr (detail::map_has_v<Map, detail::map_covariance_member>) {
    using traits = map_traits<Map>;
    using S = strict<double>;
    if (!(tolerance.position_chi2 > 0)) return false;
    const auto A = to_symmetric<S>(traits::covariance(map, a)), B = to_symmetric<S>(traits::covariance(map, b));
    const S zero(0), of_a = A.xx + A.yy + A.zz, of_b = B.xx + B.yy + B.zz;
    if (!(of_a > zero && of_b > zero)) return false;
    const S rounding(1e-6);  // covariances are kept in float
    const vec3<S> apart = cast<S>(traits::position(map, a)) - cast<S>(traits::position(map, b));
    return squared_norm(solve_lower(cholesky(A + B, rounding * (of_a + of_b)), apart)) > S(tolerance.position_chi2);
  } else {
    return false;
  }
}

TURBOMAP_END_NAMESPACE

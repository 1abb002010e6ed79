// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// New map points from the matches of a search: each match is triangulated and tested, where the search left it; the points
/// that pass come back as a plan.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../plain_vector.hpp"
#include "../precompiled.hpp"
#include "correspondences.hpp"
#include "create_point.hpp"
#include "creation_check.hpp"
#include "creation_plan.hpp"
#include "first_claims.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Candidate map points of one search. Make one and use it for every call. Move-only.
template <class Policy>
class point_creation {
 public:
  /// Where the results are.
  using memory_type = memory_of_t<Policy>;

  /// Takes its memory from the context.
  explicit point_creation(const context<Policy>& ctx) : points_(ctx.resource()) {}

  /// All matches with their outcome, in (neighbour, query keypoint) order, equal on every policy. Waits.
  /// \param matches  what create_points() was given, unchanged; throws std::invalid_argument when its size is another
  template <class Descriptor, class Camera, class List>
  void plan(context<Policy>& ctx, const correspondences<Descriptor, Camera, Policy>& matches, List& result) const {
    const auto count = static_cast<std::size_t>(matches.size());
    require(points_.size() == count, "matches", points_.size(), "are not what the points were made from");
    const std::int32_t* match = ctx.on_host(matches.view().match, count, host_match_);
    const created_point* points = ctx.on_host(points_.data(), count, host_points_);
    ctx.synchronize();
    result.clear();
    for_each_match(match, 0, matches.size(), [&](int i) { result.push_back(points[i]); });
  }
  /// The same, as a list of its own.
  template <class Descriptor, class Camera>
  std::vector<created_point> plan(context<Policy>& ctx,
                                  const correspondences<Descriptor, Camera, Policy>& matches) const {
    std::vector<created_point> result;
    plan(ctx, matches, result);
    return result;
  }

  /// Room for the points of so many results, in the memory of the policy: create_points() fills it.
  created_point* make_room(int results) {
    points_.resize_discard(static_cast<std::size_t>(results));
    return points_.data();
  }

 private:
  array<created_point, memory_type> points_;
  mutable plain_vector<std::int32_t> host_match_;
  mutable plain_vector<created_point> host_points_;
};

/// Creates and tests a point for every match [ORB-SLAM3]: triangulates where the rays of the two views have more parallax
/// than a stereo pair of either, else back-projects the stereo keypoint of larger parallax; accepts what lies before both
/// cameras, reprojects into both, and whose distances agree with the octaves. Decisions are equal on every policy.
/// \param matches  a search of this context; its keyframes must still be there
/// \param result   overwritten. Under CUDA the work may still be running on return
/// \throws std::invalid_argument  an option is not finite or out of range, or the scale factor is not that of the search
/// \throws device_error           a launch failed; `result` then holds no points
template <class Descriptor, class Camera, class Policy>
void create_points(context<Policy>& ctx, const correspondences<Descriptor, Camera, Policy>& matches,
                   const creation_options& options, point_creation<Policy>& result) {
  check_creation_options(options, matches.view().options.scales.scale_factor);
  created_point* const points = result.make_room(matches.size());
  try {
    launch_create_points(ctx.policy(), matches.view(), options, points);
  } catch (...) {
    result.make_room(0);  // nobody has written them
    throw;
  }
}

#define TURBOMAP_INSTANTIATE(Descriptor, Camera, Policy)                                                     \
  TURBOMAP_INSTANCE void create_points(context<Policy>&, const correspondences<Descriptor, Camera, Policy>&, \
                                       const creation_options&, point_creation<Policy>&);
TURBOMAP_PRECOMPILED_SEARCHES(TURBOMAP_INSTANTIATE)
#undef TURBOMAP_INSTANTIATE

TURBOMAP_END_NAMESPACE

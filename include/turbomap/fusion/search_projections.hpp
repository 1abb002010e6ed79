// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The search by projection of one block of points in one camera: most points are told apart by a few operations
/// (projection_prefilter.hpp, on the host several points at once: projection_lanes.hpp, projection_windows.hpp), the others decided in full
/// (projection_test.hpp).

#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "projection_lanes.hpp"
#include "projection_prefilter.hpp"
#include "projection_test.hpp"
#include "projection_view.hpp"
#include "projection_windows.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index i = request * blocks + block: `BlockSize` points in one camera of one target.
template <class Descriptor, class Camera, int BlockSize>
struct projection_search {
  using distance_type = typename Descriptor::distance_type;  ///< of descriptors

  projection_view<Descriptor, Camera> search;  ///< what is read and written

  /// Blocks of points per camera.
  TURBOMAP_HD int blocks() const { return (search.points.count + BlockSize - 1) / BlockSize; }

  /// Decides for the points of one block.
  TURBOMAP_HD void operator()(int i) const {
    const int request = i / blocks(), first = i % blocks() * BlockSize;
    const int last = search.points.count - first < BlockSize ? search.points.count : first + BlockSize;
    const projection_camera& camera = search.cameras[request];
    const std::int64_t at = static_cast<std::int64_t>(request) * search.points.count;
    const projection_test<Descriptor, Camera> test{search, camera};
    for (int p = first; p < last; ++p) search.hits[at + p] = {-1, no_match_distance<Descriptor>};
    if (search.trials != nullptr) {
      for (int p = first; p < last; ++p) store(at + p, search.trials[at + p] = test(p));
      return;
    }
    const projection_prefilter<Descriptor, Camera> prefilter(search, camera);
    if constexpr (has_projection_lanes)
      if (search_in_lanes(camera, prefilter, first, last, [&](int p) { store(at + p, test(p)); })) return;
    for (int p = first; p < last; ++p)
      if (is_hopeful(camera, prefilter, p)) store(at + p, test(p));
  }

  /// Whether a point is to be decided on: it is not skipped, and a few operations do not tell that it has no match.
  TURBOMAP_HD static bool is_hopeful(const projection_camera& camera,
                                     const projection_prefilter<Descriptor, Camera>& prefilter, int p) {
    const bool skipped = camera.of.skip != nullptr && camera.of.skip[p] != 0;
    return !skipped && prefilter.may_match(p);
  }
  /// Writes the hit of index `at`, if there is one.
  TURBOMAP_HD void store(std::int64_t at, const projection_trial<distance_type>& trial) const {
    if (trial.outcome == projection_outcome::matched) search.hits[at] = {trial.keypoint, trial.distance};
  }

 private:
  /// Calls decide(p) for points that may have a match. False: the camera is of a model that is not computed in packs.
  template <class Decide>
  bool search_in_lanes(const projection_camera& camera, const projection_prefilter<Descriptor, Camera>& prefilter,
                       int first, int last, const Decide& decide) const {
    projection_lanes<Descriptor, Camera, BlockSize> lanes(search, camera);
    if (!lanes.is_known()) return false;
    projection_windows<Descriptor, Camera, BlockSize> windows(search, camera);
    const bool at_once = windows.is_known();
    lanes.find(
        first, last,
        [&](int p) {
          if (prefilter.may_match(p)) decide(p);
        },
        [&](int p, const vec2<double>& pixel, double z, double distance) {
          const int level = prefilter.level_of(p, distance);
          if (at_once && level >= -1)
            windows.add(p, pixel, z, level);
          else if (prefilter.may_match_at(p, pixel, z, level))
            decide(p);
        });
    windows.find(decide);
    return true;
  }
};

/// Points that a host looks at in a row, with the camera at hand: measured, no influence on results.
inline constexpr int projection_block_size = 64;

/// Looks for every point in every camera.
template <class Derived, class Descriptor, class Camera>
void launch_search_projections(const thrust::execution_policy<Derived>& policy,
                               const projection_view<Descriptor, Camera>& search) {
  const projection_search<Descriptor, Camera, projection_block_size> body{search};
  for_each_index(derived(policy), search.request_count * body.blocks(), body);
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/search_projections.cuh"
#endif

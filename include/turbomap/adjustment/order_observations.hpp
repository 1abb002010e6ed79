// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The lists of observations of an adjustment_structure, made where the policy computes: what structure_builder.hpp makes on
/// the host, to the last integer. Only for policies whose memory the host does not read, and for problems of one group,
/// reprojections. Chunks are of observation_padding entries there, so chunk c has the entries from observation_padding * c on.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/rotation.hpp"
#include "../memory.hpp"
#include "../parallel.hpp"
#include "../types.hpp"
#include "factor_sums.hpp"
#include "observation_lists.hpp"
#include "structure.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Whether the policy makes the lists of a problem of this size.
template <class Derived>
bool can_order_observations(const thrust::execution_policy<Derived>& policy, const observation_input& in);

/// Makes them. Returns the report, where the policy computes. \param scratch  memory for the work and the report
template <class Derived, class Arena>
observation_report* launch_order_observations(const thrust::execution_policy<Derived>& policy, Arena& scratch,
                                              const observation_input& in, const observation_lists& to);

/// Index = entry: measurements in the order of the entries.
struct place_observations {
  const observation_chunk* chunks;  ///< as made
  const std::int32_t* source;       ///< [entry] as made
  const vec3<double>* pixel;        ///< [row] as given
  const double* information;        ///< [row] as given
  bool right_given;                 ///< a row is stereo whatever its u_right is
  double* u;                        ///< [entry] px
  double* v;                        ///< [entry] px
  double* u_right;                  ///< [entry] px; 0 where the row is mono
  double* to_information;           ///< [entry] px^-2; 0: padding
  observation_report* report;       ///< of the lists; told of numbers that are not finite

  /// Entry i, which need not exist.
  TURBOMAP_HD void operator()(int i) const {
    const int chunk = i / observation_padding;
    if (report->too_long != 0 || chunk >= report->sizes.chunks) return;
    const observation_chunk& c = chunks[chunk];
    const bool right = c.kind % 2 == 1;
    const std::int32_t o = source[i];
    const vec3<double> z = pixel[o];
    const double w = information[o];
    u[i] = z.x, v[i] = z.y, u_right[i] = right ? z.z : 0;
    to_information[i] = i - c.begin < c.count ? w : 0;
    const bool finite = detail::is_finite(z.x) && detail::is_finite(z.y) && detail::is_finite(w);
    if (!finite || (right_given && right && !detail::is_finite(z.z))) report->not_finite = 1;
  }
};

/// Puts the measurements of `entries` entries in their places.
template <class Derived>
void launch_place_observations(const thrust::execution_policy<Derived>& policy, int entries,
                               const place_observations& work) {
  for_each_index(derived(policy), entries, work);
}

/// Index = frame or landmark: the estimate that was given.
template <class Frame>
struct place_estimate {
  using state = typename Frame::template state<double>;  ///< of a frame
  const state* given;                                    ///< [frame]
  const vec3<double>* positions;                         ///< [landmark]
  int frames;                                            ///< how many
  int landmarks;                                         ///< how many
  estimate_view<Frame> to;                               ///< where they belong
  observation_report* report;                            ///< told of positions that are not finite

  /// Frame i and landmark i.
  TURBOMAP_HD void operator()(int i) const {
    if (i < frames) {
      to.states[i] = given[i];
      to.poses[i] = to_isometry<double>(normalised(Frame::template pose<double>(given[i])));
    }
    if (i >= landmarks) return;
    const vec3<double> p = positions[i];
    double* const x = to.landmarks + static_cast<std::ptrdiff_t>(i) * landmark_stride;
    x[0] = p.x, x[1] = p.y, x[2] = p.z, x[3] = 0;
    if (!(detail::is_finite(p.x) && detail::is_finite(p.y) && detail::is_finite(p.z))) report->not_finite = 1;
  }
};

/// Puts the estimate of all frames and landmarks in its place.
template <class Derived, class Frame>
void launch_place_estimate(const thrust::execution_policy<Derived>& policy, const place_estimate<Frame>& work) {
  for_each_index(derived(policy), work.frames > work.landmarks ? work.frames : work.landmarks, work);
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/order_observations.cuh"
#endif

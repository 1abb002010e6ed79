// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What happens to each frame when a step is tried: its new state, and its pose as a matrix.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../math/rotation.hpp"
#include "../parallel.hpp"
#include "factor_sums.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = frame: its pose as a matrix.
template <class Frame>
struct prepare_poses {
  const typename Frame::template state<double>* states;  ///< [frame]
  isometry<double>* poses;                               ///< [frame] world to body
  /// Frame f.
  TURBOMAP_HD void operator()(int f) const {
    poses[f] = to_isometry<double>(normalised(Frame::template pose<double>(states[f])));
  }
};

/// Index = frame: moves a free one by its step, copies a fixed one, and makes its pose a matrix.
template <class Frame>
struct retract_frames {
  const std::int32_t* free_of_frame;                   ///< [frame] number among the free frames; -1: fixed
  const double* step;                                  ///< of the free frames
  const typename Frame::template state<double>* from;  ///< [frame] states before the step
  prepare_poses<Frame> prepare;                        ///< what makes the pose a matrix
  typename Frame::template state<double>* to;          ///< [frame] states after it
  /// Frame f.
  TURBOMAP_HD void operator()(int f) const {
    const int free = free_of_frame[f];
    to[f] = free < 0 ? from[f]
                     : Frame::template retract<double>(from[f], step + static_cast<std::ptrdiff_t>(free) * Frame::dof);
    prepare(f);
  }
};

/// Poses of all frames as matrices.
template <class Frame, class Derived>
void launch_prepare_poses(const thrust::execution_policy<Derived>& policy, int frames, const estimate_view<Frame>& x) {
  for_each_index(derived(policy), frames, prepare_poses<Frame>{x.states, x.poses});
}

/// States and poses after a step. \param step  of the free frames
template <class Frame, class Derived>
void launch_retract_frames(const thrust::execution_policy<Derived>& policy, int frames,
                           const std::int32_t* free_of_frame, const double* step, const estimate_view<Frame>& from,
                           const estimate_view<Frame>& to) {
  for_each_index(derived(policy), frames,
                 retract_frames<Frame>{free_of_frame, step, from.states, {to.states, to.poses}, to.states});
}

TURBOMAP_END_NAMESPACE

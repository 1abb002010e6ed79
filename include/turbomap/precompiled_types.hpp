// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The instances that turbomap_compile_into() compiles unless it is given another list: ORB descriptors, cameras of two
/// models, the policy of `context ctx`. A list of one's own is such a file. A macro hands each combination to another macro,
/// once; a type with a comma in its name needs an alias. precompiled.hpp includes the list.

#include "camera/kannala_brandt.hpp"
#include "camera/pinhole.hpp"
#include "descriptor/binary.hpp"
#include "sequential_policy.hpp"

#if defined(TURBOMAP_PRECOMPILED)

/// keyframe_store in the memory of the host: descriptor, camera.
#define TURBOMAP_PRECOMPILED_STORES(instantiate)                          \
  instantiate(turbomap::binary_descriptor<256>, turbomap::pinhole<float>) \
      instantiate(turbomap::binary_descriptor<256>, turbomap::kannala_brandt<float>)

/// Search of correspondences, creation of points, search by projection, appearance: descriptor, camera, policy.
#define TURBOMAP_PRECOMPILED_SEARCHES(instantiate)                                               \
  instantiate(turbomap::binary_descriptor<256>, turbomap::pinhole<float>, thrust::detail::seq_t) \
      instantiate(turbomap::binary_descriptor<256>, turbomap::kannala_brandt<float>, thrust::detail::seq_t)

/// adjust() of problems of pose_frame and reprojections, with the default methods: camera, policy.
#define TURBOMAP_PRECOMPILED_ADJUSTMENTS(instantiate)          \
  instantiate(turbomap::pinhole<float>, thrust::detail::seq_t) \
      instantiate(turbomap::kannala_brandt<float>, thrust::detail::seq_t)

#endif

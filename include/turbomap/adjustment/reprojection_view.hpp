// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A group of reprojections where the policy computes.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../math/pack_convert.hpp"
#include "../types.hpp"
#include "adjustment_camera.hpp"
#include "factor_sums.hpp"
#include "structure.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// In the order of its group_structure.
template <class Camera, class Kernel>
struct reprojection_view {
  const observation_chunk* chunks;
  const adjustment_camera<Camera>* cameras;
  const std::int32_t* landmark;
  const std::int32_t* row;
  const std::int32_t* coupling;
  const double* u;
  const double* v;
  const double* u_right;
  const double* information;
  Kernel mono, stereo;
  double undefined_chi2;
  int first_chunk;  ///< number of its first chunk among those of all groups
  int chunk_count;

  template <class T, int N>
  TURBOMAP_HD vec3<pack<T, N>> points(const double* landmarks, int i) const {
    using P = pack<T, N>;
    return {P::gather(landmarks, landmark + i, landmark_stride),
            P::gather(landmarks + 1, landmark + i, landmark_stride),
            P::gather(landmarks + 2, landmark + i, landmark_stride)};
  }
  template <class T, int N>
  TURBOMAP_HD vec3<pack<T, N>> measurements(int i) const {
    return {convert<T>(pack<double, N>::load(u + i)), convert<T>(pack<double, N>::load(v + i)),
            convert<T>(pack<double, N>::load(u_right + i))};
  }
};

TURBOMAP_END_NAMESPACE

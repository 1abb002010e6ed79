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

/// The work before chunks of a group: their observations.
struct work_of_chunks {
  const observation_chunk* chunks;  ///< of the group
  int count;                        ///< of chunks

  /// Of the chunks before i, padding included.
  TURBOMAP_HD long long operator()(int i) const {
    if (i < count) return chunks[i].begin;
    return count > 0 ? chunks[count - 1].begin + chunks[count - 1].count : 0;
  }
};

/// In the order of its group_structure.
template <class Camera, class Kernel>
struct reprojection_view {
  const observation_chunk* chunks;           ///< observations of one frame, one camera, all stereo or none
  const adjustment_camera<Camera>* cameras;  ///< of the rig
  const std::int32_t* landmark;              ///< [entry] landmark
  const std::int32_t* row;                   ///< [entry] place in the order by landmark
  const std::int32_t* coupling;              ///< [entry] place among the couplings; -1: fixed frame
  const double* u;                           ///< [entry] px
  const double* v;                           ///< [entry] px
  const double* u_right;                     ///< [entry] px
  const double* information;                 ///< [entry] 1 / sigma^2, px^-2; 0: padding
  Kernel mono;                               ///< of rows of two residuals
  Kernel stereo;                             ///< of rows of three
  double undefined_chi2;                     ///< chi2 of rows that are not defined
  int first_chunk;                           ///< number of its first chunk among those of all groups
  int chunk_count;                           ///< chunks

  /// The landmarks of N entries from i on: world, m.
  template <class T, int N>
  TURBOMAP_HD vec3<pack<T, N>> points(const double* landmarks, int i) const {
    using P = pack<T, N>;
    return {P::gather(landmarks, landmark + i, landmark_stride),
            P::gather(landmarks + 1, landmark + i, landmark_stride),
            P::gather(landmarks + 2, landmark + i, landmark_stride)};
  }
  /// u, v, u_right of N entries from i on, px.
  template <class T, int N>
  TURBOMAP_HD vec3<pack<T, N>> measurements(int i) const {
    return {convert<T>(pack<double, N>::load(u + i)), convert<T>(pack<double, N>::load(v + i)),
            convert<T>(pack<double, N>::load(u_right + i))};
  }
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_create_tracks() under a CUDA policy: a warp per track, a lane per view. Views are projected side by side; what they
/// add is added by every lane, in the order of the views, so the bits are those of one thread.

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../create_track.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The lanes of a warp as the workers of create_track.
struct warp_workers {
  static constexpr int count = warp_size;
  view_fit* fits;  ///< shared memory, one per lane

  __device__ int number() const { return static_cast<int>(threadIdx.x) % warp_size; }
  __device__ bool any(bool of_mine) const { return __any_sync(whole_warp, of_mine) != 0; }
  __device__ unsigned all(bool of_mine) const { return __ballot_sync(whole_warp, of_mine); }
  __device__ int first(unsigned of_all) const { return __ffs(static_cast<int>(of_all)) - 1; }
  __device__ void meet() const { __syncwarp(); }
};

}  // namespace detail

template <class Descriptor, class Camera>
__global__ void __launch_bounds__(warp_size* create_tracks_tuning::warps, create_tracks_tuning::blocks)
    create_tracks_kernel(track_creation_view<Descriptor, Camera> tracks) {
  using detail::view_fit;
  constexpr int of_warp = warp_size * static_cast<int>(sizeof(view_fit));
  // Bytes, because shared memory runs no constructors: look() writes whatever of a view is read.
  alignas(view_fit) __shared__ unsigned char fits[create_tracks_tuning::warps * of_warp];
  const int warp = static_cast<int>(threadIdx.x) / warp_size;
  const int t = static_cast<int>(blockIdx.x) * create_tracks_tuning::warps + warp;
  if (t >= tracks.track_count) return;  // whole warps
  create_track<Descriptor, Camera, detail::warp_workers>{tracks}.make(
      t, {reinterpret_cast<view_fit*>(fits + warp * of_warp)});
}

template <class Derived, class Descriptor, class Camera>
void launch_create_tracks(const thrust::cuda_cub::execution_policy<Derived>& policy,
                          const track_creation_view<Descriptor, Camera>& tracks) {
  constexpr int warps = create_tracks_tuning::warps;
  launch_kernel(policy, "launch of create_tracks", create_tracks_kernel<Descriptor, Camera>,
                (tracks.track_count + warps - 1) / warps, warp_size * warps, tracks);
}

TURBOMAP_END_NAMESPACE

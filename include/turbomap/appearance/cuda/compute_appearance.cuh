// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The appearance of points under a CUDA policy, in two kernels. Geometry: a warp per point, a lane per view; what the views
/// give is added up in their order, so that the bits are those of the host. Medoid: a block per point.

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../compute_appearance.hpp"
#include "medoid.cuh"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The keypoint of a point in its reference keyframe: camera 0's, else the first. The views come 32 at a time.
struct reference_keypoint {
  int keypoint = -1;
  bool is_left = false;

  __device__ void look_at(bool is_reference, bool is_camera_0, int keypoint_of_lane) {
    const unsigned any = __ballot_sync(whole_warp, is_reference);
    const unsigned left = __ballot_sync(whole_warp, is_reference && is_camera_0);
    if (is_left || (left == 0 && (any == 0 || keypoint >= 0))) return;
    keypoint = __shfl_sync(whole_warp, keypoint_of_lane, __ffs(static_cast<int>(left != 0 ? left : any)) - 1);
    is_left = left != 0;
  }
};

}  // namespace detail

/// \tparam Covariance  it is asked for
template <bool Covariance, class Descriptor, class Camera>
__global__ void __launch_bounds__(warp_size* appearance_tuning::warps)
    measure_appearance_kernel(detail::appearance_inputs<Descriptor, Camera> in, int count, point_appearance* points) {
  using geometry_type = detail::appearance_geometry<Descriptor, Camera>;
  using S = typename geometry_type::S;
  union shared_view {
    vec3<S> direction;
    std::conditional_t<Covariance, typename geometry_type::view, char> view;
  };
  __shared__ shared_view views[appearance_tuning::warps][warp_size];
  const int warp = static_cast<int>(threadIdx.x) / warp_size, lane = static_cast<int>(threadIdx.x) % warp_size;
  const int i = static_cast<int>(blockIdx.x) * appearance_tuning::warps + warp;
  if (i >= count) return;  // whole warps
  const point_observation* seen = in.observations + in.observation_offset[i];
  const int n = in.observation_offset[i + 1] - in.observation_offset[i];
  point_appearance p{};
  p.medoid = -1;
  const geometry_type geometry{in};
  if (in.centre != nullptr && n > 0) {
    const detail::chosen_views chosen(n, in.most_views);
    vec3<S> sum{S(0), S(0), S(0)};
    for (int begin = 0; begin < chosen.count; begin += warp_size) {
      const int size = chosen.count - begin < warp_size ? chosen.count - begin : warp_size;
      if (lane < size) views[warp][lane].direction = geometry.direction(i, seen[chosen(begin + lane)]);
      __syncwarp();
      for (int j = 0; j < size; ++j) sum = sum + views[warp][j].direction;
      __syncwarp();
    }
    detail::reference_keypoint reference;
    typename geometry_type::spread spread;
    for (int begin = 0; begin < n; begin += warp_size) {
      const int size = n - begin < warp_size ? n - begin : warp_size;
      const point_observation mine = seen[begin + (lane < size ? lane : 0)];
      reference.look_at(lane < size && mine.keyframe == in.reference[i], geometry.camera_of(mine) == 0, mine.keypoint);
      if constexpr (Covariance) {
        if (lane < size) views[warp][lane].view = geometry.look(i, mine);
        __syncwarp();
        for (int j = 0; j < size; ++j) geometry.add(views[warp][j].view, spread);
        __syncwarp();
      }
    }
    geometry.measure(i, chosen.count, sum, reference.keypoint, p);
    if constexpr (Covariance) geometry.invert(spread, p);
  }
  if (lane == 0) points[i] = p;
}

template <class Descriptor, class Camera>
__global__ void __launch_bounds__(warp_size* appearance_tuning::warps)
    represent_points_kernel(detail::appearance_inputs<Descriptor, Camera> in, point_appearance* points,
                            typename Descriptor::element* descriptors) {
  const int i = static_cast<int>(blockIdx.x), thread = static_cast<int>(threadIdx.x);
  const int first = in.observation_offset[i];
  const detail::chosen_views chosen(in.observation_offset[i + 1] - first, in.most_views);
  typename Descriptor::element* mine = descriptors + static_cast<std::size_t>(i) * Descriptor::elements;
  const detail::observed_descriptors<Descriptor, Camera> all{in.keyframes, in.observations + first, chosen};
  const int medoid = chosen.count == 0 ? -1 : medoid_of_block<Descriptor>(chosen.count, all);
  if (thread == 0) points[i].medoid = medoid < 0 ? -1 : chosen(medoid);
  const typename Descriptor::element* from = medoid < 0 ? nullptr : all(medoid);
  for (int e = thread; e < Descriptor::elements; e += static_cast<int>(blockDim.x))
    mine[e] = from == nullptr ? typename Descriptor::element{} : from[e];
}

template <class Derived, class Descriptor, class Camera>
void launch_compute_appearance(const thrust::cuda_cub::execution_policy<Derived>& policy,
                               const detail::appearance_inputs<Descriptor, Camera>& in, int count,
                               point_appearance* points, typename Descriptor::element* descriptors) {
  constexpr int warps = appearance_tuning::warps;
  const auto measure = in.T_camera_world != nullptr ? measure_appearance_kernel<true, Descriptor, Camera>
                                                    : measure_appearance_kernel<false, Descriptor, Camera>;
  launch_kernel(policy, "launch of measure_appearance", measure, (count + warps - 1) / warps, warp_size * warps, in,
                count, points);
  if (descriptors == nullptr) return;
  launch_kernel(policy, "launch of represent_points", represent_points_kernel<Descriptor, Camera>, count,
                warp_size * warps, in, points, descriptors);
}

TURBOMAP_END_NAMESPACE

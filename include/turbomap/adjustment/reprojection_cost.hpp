// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The robust cost of reprojections, and chi2 and depth of each of them.

#include "../config.hpp"
#include "../parallel.hpp"
#include "factor_sums.hpp"
#include "reprojection.hpp"
#include "reprojection_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Robust cost of observations that are defined, and number of the others.
template <class G, int N>
struct reprojection_cost_part {
  using P = pack<G, N>;  ///< numbers of residuals
  P total = P(G(0));     ///< robust cost
  P missing = P(G(0));   ///< observations that are not defined

  /// \param rho  of each, whether or not it is defined
  TURBOMAP_HD void add(const P& information, const P& rho, const P& defined) {
    const P one(G(1)), zero(G(0));
    total = total + rho * defined;
    missing = missing + select_greater(information, zero, one - defined, zero);  // padding has no information
  }
};

/// Writes the cost of a chunk, of all its observations.
template <class Camera, class Kernel, class G>
TURBOMAP_HD void write_cost(const reprojection_view<Camera, Kernel>& group, int chunk, G total, G missing,
                            const cost_sums& sums) {
  const Kernel& kernel = group.chunks[chunk].kind % 2 == 1 ? group.stereo : group.mono;
  double rho_undefined, unused;
  kernel(group.undefined_chi2, rho_undefined, unused);
  const double undefined_count = static_cast<double>(missing);
  sums.cost[group.first_chunk + chunk] = static_cast<double>(total) + undefined_count * rho_undefined;
  sums.undefined[group.first_chunk + chunk] = undefined_count;
}

/// Index = chunk: its robust cost, and how many of its observations are not defined.
template <class Camera, class Kernel, class G, int N>
struct cost_of_reprojections {
  reprojection_view<Camera, Kernel> group;  ///< the observations
  const isometry<double>* T_bw;             ///< [frame]
  const double* landmarks;                  ///< [landmark] landmark_stride numbers
  cost_sums sums;                           ///< where costs are written

  using P = pack<G, N>;                       ///< numbers of residuals
  using part = reprojection_cost_part<G, N>;  ///< cost of some observations

  /// One chunk.
  TURBOMAP_HD void operator()(int chunk) const {
    const observation_chunk& c = group.chunks[chunk];
    part p;
    add(c, 0, N, p);
    finish(chunk, sum(p.total), sum(p.missing));
  }
  /// Adds up the observations of a chunk from number `first`, every step-th N of them.
  TURBOMAP_HD void add(const observation_chunk& c, int first, int step, part& p) const {
    if (c.kind % 2 == 1)
      add<true>(c, group.stereo, first, step, p);
    else
      add<false>(c, group.mono, first, step, p);
  }
  /// Writes the cost of a chunk.
  TURBOMAP_HD void finish(int chunk, G total, G missing) const { write_cost(group, chunk, total, missing, sums); }

 private:
  template <bool Stereo>
  TURBOMAP_HD void add(const observation_chunk& c, const Kernel& kernel, int first, int step, part& p) const {
    part all = p;
    for (int i = c.begin + first; i < c.begin + c.count; i += step) {
      lane_reprojection<G, G, N> r;
      const auto body = transform(T_bw[c.frame], group.template points<G, N>(landmarks, i));
      r.template compute<false, Stereo>(group.cameras[c.kind / 2], body, group.template measurements<G, N>(i));
      const auto information = convert<G>(pack<double, N>::load(group.information + i));
      P chi2 = r.e[0] * r.e[0] + r.e[1] * r.e[1], rho, weight;
      if constexpr (Stereo) chi2 = chi2 + r.e[2] * r.e[2];
      apply_kernel(kernel, information * chi2, rho, weight);
      all.add(information, rho, r.defined);
    }
    p = all;
  }
};

/// Index = chunk: chi2 (not robust; undefined_chi2 where not defined) and depth in its camera of each entry.
template <class Camera, class Kernel, int N>
struct chi2_of_reprojections {
  reprojection_view<Camera, Kernel> group;  ///< the observations
  const isometry<double>* T_bw;             ///< [frame]
  const double* landmarks;                  ///< [landmark] landmark_stride numbers
  double* chi2;                             ///< [entry]
  double* depth;                            ///< [entry] m

  /// One chunk.
  TURBOMAP_HD void operator()(int chunk) const {
    const observation_chunk& c = group.chunks[chunk];
    if (c.kind % 2 == 1)
      chunk_of<true>(c);
    else
      chunk_of<false>(c);
  }

 private:
  template <bool Stereo>
  TURBOMAP_HD void chunk_of(const observation_chunk& c) const {
    using P = pack<double, N>;
    const auto& camera = group.cameras[c.kind / 2];
    for (int i = c.begin; i < c.begin + c.count; i += N) {  // padding is written too
      lane_reprojection<double, double, N> r{};
      const auto body = transform(T_bw[c.frame], group.template points<double, N>(landmarks, i));
      r.template compute<false, Stereo>(camera, body, group.template measurements<double, N>(i));
      P s = r.e[0] * r.e[0] + r.e[1] * r.e[1];
      if constexpr (Stereo) s = s + r.e[2] * r.e[2];
      const P information = P::load(group.information + i);
      select_greater(r.defined, P(0.0), s * information, P(group.undefined_chi2)).store(chi2 + i);
      (camera.is_body ? body : transform(camera.T_camera_body, body)).z.store(depth + i);
    }
  }
};

/// \tparam G  numbers of residuals
template <class G, class Derived, class Camera, class Kernel>
void launch_sum_reprojection_cost(const thrust::execution_policy<Derived>& policy,
                                  const reprojection_view<Camera, Kernel>& group, const isometry<double>* T_bw,
                                  const double* landmarks, const cost_sums& sums) {
  constexpr int lanes = observation_shape<memory_of_t<Derived>>::lanes;
  for_each_index(derived(policy), group.chunk_count,
                 cost_of_reprojections<Camera, Kernel, G, lanes>{group, T_bw, landmarks, sums});
}

/// chi2 and depth of each entry.
template <class Derived, class Camera, class Kernel>
void launch_measure_reprojections(const thrust::execution_policy<Derived>& policy,
                                  const reprojection_view<Camera, Kernel>& group, const isometry<double>* T_bw,
                                  const double* landmarks, double* chi2, double* depth) {
  constexpr int lanes = observation_shape<memory_of_t<Derived>>::lanes;
  for_each_index(derived(policy), group.chunk_count,
                 chi2_of_reprojections<Camera, Kernel, lanes>{group, T_bw, landmarks, chi2, depth});
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/sum_reprojection_cost.cuh"
#endif

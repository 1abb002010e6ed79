// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Linearises reprojections: residuals, their derivatives, and what the normal equations get of them. Frame and landmark
/// act through one thing, the point X in body coordinates, so each observation is reduced to the 3x3 matrix M = d^T w d of
/// its derivatives by X. The rest follows from M: the landmark moves X by R dx, the frame by omega x X + v.

#include "../config.hpp"
#include "../parallel.hpp"
#include "equal_shares.hpp"
#include "factor_sums.hpp"
#include "reprojection.hpp"
#include "reprojection_cost.hpp"
#include "reprojection_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = chunk.
/// \tparam G  numbers of residuals  \tparam A  numbers of the normal equations  \tparam N  lanes
template <class Camera, class Kernel, class G, class A, int N, int V>
struct linearise_reprojections {
  static_assert(V >= 6, "turbomap: a reprojection depends on the six unknowns of a pose");
  using block = landmark_block<V>;          ///< sizes of the sums
  reprojection_view<Camera, Kernel> group;  ///< the observations
  const isometry<double>* T_bw;             ///< [frame]
  const double* landmarks;                  ///< [landmark] landmark_stride numbers
  factor_sums<A> sums;                      ///< where sums are written
  cost_sums costs;                          ///< null: not asked for

  using part = reprojection_cost_part<G, N>;  ///< cost of a chunk

  /// One chunk.
  TURBOMAP_HD void operator()(int chunk) const {
    const observation_chunk& c = group.chunks[chunk];
    if (c.kind % 2 == 1)
      chunk_of<true>(c, group.stereo, chunk);
    else
      chunk_of<false>(c, group.mono, chunk);
  }

  using P = pack<A, N>;  ///< numbers of the normal equations

 private:
  template <bool Stereo>
  TURBOMAP_HD void chunk_of(const observation_chunk& c, const Kernel& kernel, int chunk) const {
    const isometry<double>& T = T_bw[c.frame];
    const auto& camera = group.cameras[c.kind / 2];
    P H[21], b[6], R[9];
    part cost;
    for (int i = 0; i < 21; ++i) H[i] = P(A(0));
    for (int i = 0; i < 6; ++i) b[i] = P(A(0));
    for (int i = 0; i < 9; ++i) R[i] = P(static_cast<A>(T.R.m[i]));
    for (int i = 0; i < c.count; i += N) {
      if constexpr (N > 1)
        for (int l = i + N; l < i + 2 * N && l < c.count; ++l) {  // where the next ones are written
          prefetch(sums.row + static_cast<std::ptrdiff_t>(group.row[c.begin + l]) * block::row, 64);
          if (c.free >= 0 && sums.coupling != nullptr)
            prefetch(sums.coupling + static_cast<std::ptrdiff_t>(group.coupling[c.begin + l]) * block::coupling,
                     block::coupling * static_cast<int>(sizeof(A)));
        }
      observe<Stereo>(c, c.begin + i, c.count - i < N ? c.count - i : N, kernel, camera, T, R, H, b, cost);
    }
    if (costs.cost != nullptr) write_cost(group, chunk, sum(cost.total), sum(cost.missing), costs);
    if (c.free < 0) return;
    double* out = sums.chunk_partial + static_cast<std::ptrdiff_t>(group.first_chunk + chunk) * block::partial;
    for (int i = 0; i < block::partial; ++i) out[i] = 0;
    for (int i = 0; i < 21; ++i) out[i] = static_cast<double>(sum(H[i]));
    for (int i = 0; i < 6; ++i) out[block::triangle + i] = static_cast<double>(sum(b[i]));
  }

 public:
  /// N observations from entry i, of which `count` are real: their rows and couplings, and what they add to H and b of the frame
  /// and to the cost.
  template <bool Stereo>
  TURBOMAP_HD void observe(const observation_chunk& c, int i, int count, const Kernel& kernel,
                           const adjustment_camera<Camera>& camera, const isometry<double>& T, const P (&R)[9],
                           P (&H)[21], P (&b)[6], part& cost) const {
    constexpr int size = Stereo ? 3 : 2;
    const auto body = transform(T, group.template points<G, N>(landmarks, i));
    const auto information = convert<G>(pack<double, N>::load(group.information + i));
    lane_reprojection<G, A, N> r;
    r.template compute<true, Stereo>(camera, body, group.template measurements<G, N>(i));
    pack<G, N> chi2 = r.e[0] * r.e[0] + r.e[1] * r.e[1], rho, weight;
    if constexpr (Stereo) chi2 = chi2 + r.e[2] * r.e[2];
    apply_kernel(kernel, information * chi2, rho, weight);
    cost.add(information, rho, r.defined);
    const P w = convert<A>(weight * information * r.defined);

    // M = d^T w d and g = d^T w e, by the point in body coordinates.
    P e[3], M[6], g[3];
    for (int k = 0; k < size; ++k) e[k] = convert<A>(r.e[k]);
    for (int row = 0; row < 3; ++row) {
      P wd[3];
      for (int k = 0; k < size; ++k) wd[k] = w * r.d[k][row];
      g[row] = wd[0] * e[0];
      for (int k = 1; k < size; ++k) g[row] = multiply_add(wd[k], e[k], g[row]);
      for (int column = 0; column <= row; ++column) {
        P m = wd[0] * r.d[0][column];
        for (int k = 1; k < size; ++k) m = multiply_add(wd[k], r.d[k][column], m);
        M[row * (row + 1) / 2 + column] = m;
      }
    }
    const P S[9] = {M[0], M[1], M[3], M[1], M[2], M[4], M[3], M[4], M[5]};

    // By the landmark: through the rotation. MR is also the lower half of the coupling.
    P MR[9], out[9];
    for (int k = 0; k < 3; ++k)
      for (int m = 0; m < 3; ++m)
        MR[3 * k + m] = multiply_add(S[3 * k], R[m], multiply_add(S[3 * k + 1], R[3 + m], S[3 * k + 2] * R[6 + m]));
    for (int k = 0; k < 3; ++k) {
      for (int m = 0; m <= k; ++m)
        out[k * (k + 1) / 2 + m] = multiply_add(R[k], MR[m], multiply_add(R[3 + k], MR[3 + m], R[6 + k] * MR[6 + m]));
      out[6 + k] = -multiply_add(R[k], g[0], multiply_add(R[3 + k], g[1], R[6 + k] * g[2]));
    }
    scatter(out, sums.row, group.row + i, block::row, count);
    if (c.free < 0) return;

    // By the frame's step: the point moves by omega x X + v.
    const vec3<P> X{convert<A>(body.x), convert<A>(body.y), convert<A>(body.z)};
    if (sums.coupling != nullptr) {
      P coupling[block::coupling];
      for (int k = 0; k < 3; ++k) {
        P* w_column = coupling + k * V;
        w_column[0] = X.y * MR[6 + k] - X.z * MR[3 + k];
        w_column[1] = X.z * MR[k] - X.x * MR[6 + k];
        w_column[2] = X.x * MR[3 + k] - X.y * MR[k];
        w_column[3] = MR[k], w_column[4] = MR[3 + k], w_column[5] = MR[6 + k];
        for (int m = 6; m < V; ++m) w_column[m] = P(A(0));
      }
      scatter(coupling, sums.coupling, group.coupling + i, block::coupling, count);
    }
    P F[9];  // [X]x M
    for (int k = 0; k < 3; ++k) {
      F[k] = X.y * S[6 + k] - X.z * S[3 + k];
      F[3 + k] = X.z * S[k] - X.x * S[6 + k];
      F[6 + k] = X.x * S[3 + k] - X.y * S[k];
    }
    for (int k = 0; k < 3; ++k) {  // rows omega: F [X]x^T = X x (row of F)
      const P* f = F + 3 * k;
      const P row[3] = {X.y * f[2] - X.z * f[1], X.z * f[0] - X.x * f[2], X.x * f[1] - X.y * f[0]};
      for (int m = 0; m <= k; ++m) H[k * (k + 1) / 2 + m] = H[k * (k + 1) / 2 + m] + row[m];
    }
    for (int k = 0; k < 3; ++k) {  // rows v
      P* row = H + (3 + k) * (4 + k) / 2;
      for (int m = 0; m < 3; ++m) row[m] = row[m] + F[3 * m + k];
      for (int m = 0; m <= k; ++m) row[3 + m] = row[3 + m] + S[3 * k + m];
      b[3 + k] = b[3 + k] - g[k];
    }
    b[0] = b[0] - (X.y * g[2] - X.z * g[1]);
    b[1] = b[1] - (X.z * g[0] - X.x * g[2]);
    b[2] = b[2] - (X.x * g[1] - X.y * g[0]);
  }
};

/// \tparam G     numbers of residuals  \tparam V  unknowns of a frame that its observations depend on
/// \param costs  as launch_sum_reprojection_cost() gives them; null pointers: not asked for
template <class G, int V, class Derived, class Camera, class Kernel, class A>
void launch_linearise_reprojections(const thrust::execution_policy<Derived>& policy,
                                    const reprojection_view<Camera, Kernel>& group, const isometry<double>* T_bw,
                                    const double* landmarks, const factor_sums<A>& sums, const cost_sums& costs) {
  constexpr int lanes = observation_shape<memory_of_t<Derived>>::lanes;
  for_each_in_shares(derived(policy), group.chunk_count, work_of_chunks{group.chunks, group.chunk_count},
                     linearise_reprojections<Camera, Kernel, G, A, lanes, V>{group, T_bw, landmarks, sums, costs});
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/linearise_reprojections.cuh"
#endif

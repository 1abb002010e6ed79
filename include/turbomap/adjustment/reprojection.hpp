// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Residuals of reprojections and their derivatives by the point in the coordinates of the body: what the built-in factor
/// group computes, several observations at once (lanes of packs). Pinhole and Kannala-Brandt cameras are computed in packs,
/// any other camera by its own functions, one lane after the other.

#include <cmath>
#include <cstdint>

#include "../camera/project_with_derivative.hpp"
#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/linear.hpp"
#include "../math/pack_convert.hpp"
#include "../math/pack_functions.hpp"
#include "adjustment_camera.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// N points moved by T_ab, lane by lane, computed in T.
template <class T, int N>
TURBOMAP_HD vec3<pack<T, N>> transform(const isometry<double>& T_ab, const vec3<pack<T, N>>& x) {
  using P = pack<T, N>;
  P c[9];
  for (int i = 0; i < 9; ++i) c[i] = P(static_cast<T>(T_ab.R.m[i]));
  return {multiply_add(c[0], x.x, multiply_add(c[1], x.y, multiply_add(c[2], x.z, P(static_cast<T>(T_ab.t.x))))),
          multiply_add(c[3], x.x, multiply_add(c[4], x.y, multiply_add(c[5], x.z, P(static_cast<T>(T_ab.t.y))))),
          multiply_add(c[6], x.x, multiply_add(c[7], x.y, multiply_add(c[8], x.z, P(static_cast<T>(T_ab.t.z)))))};
}

/// Rows (u, v and, where Stereo, u_right) of N observations. What the error of u says about that of u_right is taken out of
/// the third row, and what is left is scaled to sigma: rows are independent then.
/// \tparam G  numbers of residuals   \tparam A  numbers of derivatives
template <class G, class A, int N>
struct lane_reprojection {
  pack<G, N> e[3];     ///< projection minus measurement, px (the third whitened); where not defined: anything finite
  pack<G, N> defined;  ///< 1 or 0
  pack<A, N> d[3][3];  ///< derivatives of e by the point in body coordinates

  /// \param body  the points in body coordinates   \param measured  u, v, u_right
  template <bool Derivative, bool Stereo, class Camera>
  TURBOMAP_HD void compute(const adjustment_camera<Camera>& c, const vec3<pack<G, N>>& body,
                           const vec3<pack<G, N>>& measured) {
    const vec3<pack<G, N>> p = c.is_body ? body : transform(c.T_camera_body, body);
    pack<G, N> z = p.z;
    bool lost = false;
    // One branch is chosen by the type, one by data. NOLINTNEXTLINE(bugprone-branch-clone)
    if constexpr (is_pinhole_v<Camera>) {
      straight<Derivative>(c, p, measured, z);
    } else if (c.straight) {
      straight<Derivative>(c, p, measured, z);
    } else {
      bool done = false;
      if constexpr (N > 1 && may_be_kannala_brandt_v<Camera>)
        done = c.round && round<Derivative>(c.fisheye, static_cast<G>(c.nearest), p, measured);
      if (!done) lost = curved<Derivative>(c, p, measured);
      if constexpr (Stereo) away_from_plane(static_cast<G>(c.nearest), z);
    }
    if constexpr (Stereo) {  // u_right = u - bf / z
      const pack<G, N> iz = pack<G, N>(G(1)) / z, disparity = pack<G, N>(static_cast<G>(c.bf)) * iz;
      e[2] = e[0] + measured.x - disparity - measured.z;
      if constexpr (Derivative) {
        d[2][0] = d[0][0], d[2][1] = d[0][1];
        d[2][2] = d[0][2] + convert<A>(disparity * iz);
        const pack<A, N> rho(static_cast<A>(c.correlation)), scale(static_cast<A>(c.whitening));
        for (int k = 0; k < 3; ++k) d[2][k] = (d[2][k] - rho * d[0][k]) * scale;
      }
      e[2] = (e[2] - pack<G, N>(static_cast<G>(c.correlation)) * e[0]) * pack<G, N>(static_cast<G>(c.whitening));
    }
    if constexpr (Derivative) {
      if (Stereo && lost) {  // what the disparity alone gives is no derivative
        const pack<A, N> zero(A(0));
        pack<A, N> size = zero;
        for (int k = 0; k < 6; ++k) size = size + larger(d[k / 3][k % 3], -d[k / 3][k % 3]);
        for (int k = 0; k < 3; ++k) d[2][k] = select_greater(size, zero, d[2][k], zero);
      }
      if (!c.is_body)
        for (int r = 0; r < (Stereo ? 3 : 2); ++r) {
          const pack<A, N> x = d[r][0], y = d[r][1], w = d[r][2];
          for (int k = 0; k < 3; ++k) {
            const mat3<double>& R = c.T_camera_body.R;
            d[r][k] = x * pack<A, N>(static_cast<A>(R(0, k))) + y * pack<A, N>(static_cast<A>(R(1, k))) +
                      w * pack<A, N>(static_cast<A>(R(2, k)));
          }
        }
    }
  }

 private:
  /// Undefined within 1e-6 rad of the focal plane, and nearer to it than c.nearest: numbers would overflow there.
  template <bool Derivative, class Camera>
  TURBOMAP_HD void straight(const adjustment_camera<Camera>& c, const vec3<pack<G, N>>& p,
                            const vec3<pack<G, N>>& measured, pack<G, N>& z) {
    using P = pack<G, N>;
    const P one(G(1)), size = larger(p.x, -p.x) + larger(p.y, -p.y), depth = larger(z, -z);
    const P limit = multiply_add(P(G(1e-6)), size, P(static_cast<G>(c.nearest)));
    defined = select_greater(depth, limit, one, P(G(0)));
    z = select_greater(depth, limit, z, one);
    const P iz = one / z, x = select_greater(depth, limit, p.x * iz, P(G(0)));
    const P y = select_greater(depth, limit, p.y * iz, P(G(0)));
    const P fx(static_cast<G>(c.K.fx)), fy(static_cast<G>(c.K.fy));
    e[0] = multiply_add(fx, x, P(static_cast<G>(c.K.cx))) - measured.x;
    e[1] = multiply_add(fy, y, P(static_cast<G>(c.K.cy))) - measured.y;
    if constexpr (Derivative) {
      const pack<A, N> i = convert<A>(iz), a = pack<A, N>(static_cast<A>(c.K.fx)) * i,
                       b = pack<A, N>(static_cast<A>(c.K.fy)) * i, zero(A(0));
      d[0][0] = a, d[0][1] = zero, d[0][2] = -(a * convert<A>(x));
      d[1][0] = zero, d[1][1] = b, d[1][2] = -(b * convert<A>(y));
    }
  }

  /// A right image has no disparity in the plane z = 0.
  TURBOMAP_HD void away_from_plane(G nearest, pack<G, N>& z) {
    using P = pack<G, N>;
    const P limit(nearest), depth = larger(z, -z);
    defined = select_greater(depth, limit, defined, P(G(0)));
    z = select_greater(depth, limit, z, P(G(1)));
  }

  /// The formulas of kannala_brandt. False where a lane is on the optical axis, too near, or may be beyond a fold of the
  /// polynomial: then all are left to the functions of the camera.
  template <bool Derivative>
  TURBOMAP_HD bool round(const kannala_brandt<double>& c, G nearest, const vec3<pack<G, N>>& p,
                         const vec3<pack<G, N>>& measured) {
    using P = pack<G, N>;
    const G k[4] = {static_cast<G>(c.k1), static_cast<G>(c.k2), static_cast<G>(c.k3), static_cast<G>(c.k4)};
    const P one(G(1)), zero(G(0)), r2 = p.x * p.x + p.y * p.y, z2 = p.z * p.z;
    const P r = sqrt(r2), angle = polar_angle(r, p.z), q = angle * angle;
    P factor = P(k[3]), slope = P(G(9) * k[3]), least = P(G(9) * (k[3] < 0 ? k[3] : 0));
    for (int i = 2; i >= 0; --i) {
      factor = multiply_add(factor, q, P(k[i]));
      slope = multiply_add(slope, q, P(G(2 * i + 3) * k[i]));
      least = multiply_add(least, q, P(G(2 * i + 3) * (k[i] < 0 ? k[i] : 0)));
    }
    factor = multiply_add(factor, q, one), slope = multiply_add(slope, q, one), least = multiply_add(least, q, one);
    const P far = select_greater(r2 + z2, P(nearest * nearest), zero, one);
    const P doubtful = select_greater(least, zero, select_greater(r2, P(G(1e-6)) * z2, far, one), one);
    if (sum(doubtful) > 0) return false;
    const P scale = angle * factor / r;
    e[0] = multiply_add(P(static_cast<G>(c.fx)) * scale, p.x, P(static_cast<G>(c.cx))) - measured.x;
    e[1] = multiply_add(P(static_cast<G>(c.fy)) * scale, p.y, P(static_cast<G>(c.cy))) - measured.y;
    defined = one;
    if constexpr (Derivative) {
      using Q = pack<A, N>;
      const P along = slope / (r2 + z2), curve = (along * p.z - scale) / r2;
      const Q x = convert<A>(p.x), y = convert<A>(p.y), a = convert<A>(along), b = convert<A>(curve),
              s = convert<A>(scale);
      const Q fx(static_cast<A>(c.fx)), fy(static_cast<A>(c.fy)), xy = x * y * b;
      d[0][0] = fx * (s + x * x * b), d[0][1] = fx * xy, d[0][2] = -(fx * (x * a));
      d[1][0] = fy * xy, d[1][1] = fy * (s + y * y * b), d[1][2] = -(fy * (y * a));
    }
    return true;
  }

  /// Where a derivative is not finite, all are 0: whether a row is defined, and its cost, are no matter of its derivative.
  /// \return whether there was such a lane
  template <bool Derivative, class Camera>
  TURBOMAP_HD bool curved(const adjustment_camera<Camera>& c, const vec3<pack<G, N>>& p,
                          const vec3<pack<G, N>>& measured) {
    G x[N], y[N], depth[N], u[N], v[N], ok[N];
    A slope[6][N];
    bool lost = false;
    p.x.store(x), p.y.store(y), p.z.store(depth), measured.x.store(u), measured.y.store(v);
    for (int l = 0; l < N; ++l) {
      const vec3<double> q{static_cast<double>(x[l]), static_cast<double>(y[l]), static_cast<double>(depth[l])};
      vec2<double> pixel{static_cast<double>(u[l]), static_cast<double>(v[l])};
      mat23<double> D{};
      bool good;
      if constexpr (Derivative)
        good = project_with_derivative(c.camera, q, pixel, D);
      else
        good = c.camera.project(q, pixel);
      good = good && dot(q, q) > c.nearest * c.nearest;
      bool known = good;
      for (int k = 0; Derivative && k < 6; ++k) known = known && detail::is_finite(D.m[k]);
      good = good && detail::each_finite(pixel.x, pixel.y);
      ok[l] = good ? G(1) : G(0);
      u[l] = static_cast<G>(pixel.x - static_cast<double>(u[l])),
      v[l] = static_cast<G>(pixel.y - static_cast<double>(v[l]));
      if (!good) u[l] = v[l] = G(0);
      if (!known || !good) D = {}, lost = true;
      if constexpr (Derivative)
        for (int k = 0; k < 6; ++k) slope[k][l] = static_cast<A>(D.m[k]);
    }
    e[0] = pack<G, N>::load(u), e[1] = pack<G, N>::load(v);
    defined = pack<G, N>::load(ok);
    if constexpr (Derivative)
      for (int k = 0; k < 6; ++k) d[k / 3][k % 3] = pack<A, N>::load(slope[k]);
    return lost;
  }
};

/// rho and weight of each lane: in packs where the kernel can, else one by one.
template <class Kernel, class = void>
struct kernel_takes_packs : std::false_type {};
template <class Kernel>
struct kernel_takes_packs<Kernel, std::enable_if_t<Kernel::for_packs>> : std::true_type {};

/// rho and weight of N values of chi2, at once where the kernel can.
template <class Kernel, class G, int N>
TURBOMAP_HD void apply_kernel(const Kernel& kernel, const pack<G, N>& chi2, pack<G, N>& rho, pack<G, N>& weight) {
  if constexpr (kernel_takes_packs<Kernel>::value && N > 1) {
    kernel(chi2, rho, weight);
  } else {
    G s[N], r[N], w[N];
    chi2.store(s);
    for (int l = 0; l < N; ++l) {
      double rho_l, weight_l;
      kernel(static_cast<double>(s[l]), rho_l, weight_l);
      r[l] = static_cast<G>(rho_l), w[l] = static_cast<G>(weight_l);
    }
    rho = pack<G, N>::load(r), weight = pack<G, N>::load(w);
  }
}

TURBOMAP_END_NAMESPACE

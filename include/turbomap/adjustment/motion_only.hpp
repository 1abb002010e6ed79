// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Poses from points that are held fixed, one frame at a time: what tracking does with every image. Many frames a call.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../math/rotation.hpp"
#include "damping.hpp"
#include "factors.hpp"
#include "linearise_factors.hpp"
#include "reprojection.hpp"
#include "uploaded.hpp"

namespace turbomap {

/// Options of motion_only. Defaults are those of [ORB-SLAM3]'s tracking.
struct motion_only_options {
  int rounds = 4;                      ///< after each, outliers are told anew from all observations
  int iterations = 10;                 ///< Levenberg-Marquardt steps tried in a round
  int robust_rounds = 3;               ///< rounds with Huber's kernel; the last ones are plain least squares
  double mono_chi2 = 5.991;            ///< outlier beyond it, and Huber's delta^2: 95 %, 2 dof
  double stereo_chi2 = 7.815;          ///< 95 %, 3 dof
  double stereo_correlation = 0;       ///< of the errors of u and u_right: see reprojections
  int min_observations = 3;            ///< fewer (or fewer inliers after a round): the pose stays as it was
  double initial_lambda_scale = 1e-5;  ///< of the largest diagonal element
};

/// What became of one frame.
struct posed_frame {
  rigid_transform<double> T_cw;
  std::int32_t inliers;   ///< of the last round
  std::int32_t adjusted;  ///< 0: the pose is to the bit what was given (too few observations, or not finite)
  double cost;            ///< sum of rho(chi2) of the inliers of the last round
};

/// Observations of several frames, one frame after the other, with the points that they see.
template <class Camera>
struct motion_only_input {
  rig_view<Camera> rig;
  span<const rigid_transform<double>> T_cw;  ///< first guess of each frame
  span<const std::int32_t> begin;            ///< [frame + 1] its observations
  span<const vec3<double>> point;            ///< [observation] world, m
  span<const vec3<double>> pixel;            ///< u, v, u_right; negative or NaN u_right: none
  span<const double> information;            ///< 1 / sigma^2, px^-2
  span<const std::uint8_t> camera = {};      ///< of the rig; empty: the first
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Index = frame.
template <class Camera>
struct adjust_one_pose {
  const adjustment_camera<Camera>* cameras;
  const rigid_transform<double>* guess;
  const std::int32_t* begin;
  const vec3<double>* point;
  const vec3<double>* pixel;
  const double* information;
  const std::uint8_t* camera;  ///< null: the first
  motion_only_options options;
  posed_frame* result;
  std::uint8_t* outlier;  ///< [observation]

  TURBOMAP_HD void operator()(int f) const {
    const int first = begin[f], last = begin[f + 1];
    posed_frame& r = result[f];
    r = {guess[f], 0, 0, 0};
    for (int i = first; i < last; ++i) outlier[i] = 0;
    if (last - first < options.min_observations) return;
    rigid_transform<double> T = normalised(guess[f]);
    bool adjusted = false;
    for (int round = 0; round < options.rounds; ++round) {
      const bool robust = round < options.robust_rounds;
      // [ORB-SLAM3] starts every round at the first guess: a pose that outliers have dragged away does not matter then.
      rigid_transform<double> candidate = normalised(guess[f]);
      if (!optimise(first, last, robust, candidate, r.cost)) return give_up(f, first, last);
      T = candidate, adjusted = true;
      r.inliers = classify(first, last, T);
      if (r.inliers < options.min_observations) return give_up(f, first, last);
    }
    if (adjusted) r.T_cw = T, r.adjusted = 1;
  }

 private:
  TURBOMAP_HD void give_up(int f, int first, int last) const {
    result[f] = {guess[f], 0, 0, 0};
    for (int i = first; i < last; ++i) outlier[i] = 1;
  }

  /// chi2 of an observation, and, where asked for, its part of the normal equations. Negative: not defined.
  template <bool Derivative>
  TURBOMAP_HD double observe(int i, const isometry<double>& T, bool robust, double* H, double* b, double& rho) const {
    using P = pack<double, 1>;
    const auto& c = cameras[camera == nullptr ? 0 : camera[i]];
    const bool stereo = c.bf > 0 && pixel[i].z >= 0;
    const vec3<P> X = transform(T, vec3<P>{P(point[i].x), P(point[i].y), P(point[i].z)});
    const vec3<P> z{P(pixel[i].x), P(pixel[i].y), P(stereo ? pixel[i].z : 0.0)};
    lane_reprojection<double, double, 1> r{};
    if (stereo)
      r.template compute<Derivative, true>(c, X, z);
    else
      r.template compute<Derivative, false>(c, X, z);
    if (!(r.defined.v[0] > 0)) return -1;
    const int size = stereo ? 3 : 2;
    double e[3], chi2 = 0, weight = 1;
    for (int k = 0; k < size; ++k) e[k] = r.e[k].v[0], chi2 += information[i] * e[k] * e[k];
    rho = chi2;
    if (robust) huber{stereo ? options.stereo_chi2 : options.mono_chi2}(chi2, rho, weight);
    if constexpr (Derivative) {
      const double x = X.x.v[0], y = X.y.v[0], w = X.z.v[0];
      for (int k = 0; k < size; ++k) {
        const double d[3] = {r.d[k][0].v[0], r.d[k][1].v[0], r.d[k][2].v[0]};
        const double J[6] = {y * d[2] - w * d[1], w * d[0] - x * d[2], x * d[1] - y * d[0], d[0], d[1], d[2]};
        detail::add_normal_equations<1>(J, e + k, weight * information[i], 6, H, b);
      }
    }
    return chi2;
  }

  TURBOMAP_HD double cost(int first, int last, bool robust, const rigid_transform<double>& T_cw) const {
    const isometry<double> T = to_isometry<double>(T_cw);
    double total = 0;
    for (int i = first; i < last; ++i) {
      if (outlier[i] != 0) continue;
      double rho = 0;
      // What a step leaves undefined counts as 1000 px off.
      if (observe<false>(i, T, robust, nullptr, nullptr, rho) < 0) rho = 1e6 * information[i];
      total += rho;
    }
    return total;
  }

  /// Levenberg-Marquardt on the inliers. False: the cost at the start is not finite.
  TURBOMAP_HD bool optimise(int first, int last, bool robust, rigid_transform<double>& T_cw, double& best) const {
    best = cost(first, last, robust, T_cw);
    if (!detail::is_finite(best)) return false;
    damping_control control;
    double& lambda = control.lambda;
    for (int iteration = 0; iteration < options.iterations;) {
      const isometry<double> T = to_isometry<double>(T_cw);
      double H[21] = {}, b[6] = {}, rho;
      for (int i = first; i < last; ++i)
        if (outlier[i] == 0) observe<true>(i, T, robust, H, b, rho);
      if (iteration == 0)
        for (int i = 0; i < 6; ++i) lambda = larger(lambda, options.initial_lambda_scale * H[i * (i + 1) / 2 + i]);
      bool accepted = false;
      while (!accepted && iteration < options.iterations) {
        ++iteration;
        double x[6], predicted = 0;
        if (solve(H, b, lambda, x)) {
          for (int i = 0; i < 6; ++i) predicted += x[i] * (lambda * x[i] + b[i]);
          if (!(predicted > 1e-14 * best)) return true;
          const rigid_transform<double> moved = left_exp(x, T_cw);
          const double after = cost(first, last, robust, moved);
          accepted = control.accepts(best, after, predicted);
          if (accepted) best = after, T_cw = moved;
        } else {
          control.refuse();
        }
      }
    }
    return true;
  }

  /// (H + lambda I) x = b by Cholesky.
  TURBOMAP_HD static bool solve(const double (&H)[21], const double (&b)[6], double lambda, double (&x)[6]) {
    double l[6][6];
    for (int j = 0; j < 6; ++j)
      for (int i = j; i < 6; ++i) {
        double s = H[i * (i + 1) / 2 + j] + (i == j ? lambda : 0);
        for (int m = 0; m < j; ++m) s -= l[i][m] * l[j][m];
        if (i == j && !(s > 0)) return false;
        l[i][j] = i == j ? ::sqrt(s) : s / l[j][j];
      }
    for (int i = 0; i < 6; ++i) {
      x[i] = b[i];
      for (int j = 0; j < i; ++j) x[i] -= l[i][j] * x[j];
      x[i] /= l[i][i];
    }
    for (int i = 5; i >= 0; --i) {
      for (int j = i + 1; j < 6; ++j) x[i] -= l[j][i] * x[j];
      x[i] /= l[i][i];
    }
    return true;
  }

  /// Tells outliers from all observations: beyond the gate, behind the camera, not defined. Returns how many are none.
  TURBOMAP_HD int classify(int first, int last, const rigid_transform<double>& T_cw) const {
    const isometry<double> T = to_isometry<double>(T_cw);
    int inliers = 0;
    for (int i = first; i < last; ++i) {
      const auto& c = cameras[camera == nullptr ? 0 : camera[i]];
      const bool stereo = c.bf > 0 && pixel[i].z >= 0;
      double rho;
      const double chi2 = observe<false>(i, T, false, nullptr, nullptr, rho);
      const double depth = (c.T_camera_body * (T * point[i])).z;
      const bool good =
          chi2 >= 0 && chi2 <= (stereo ? options.stereo_chi2 : options.mono_chi2) && (depth > 0 || !c.straight);
      outlier[i] = good ? 0 : 1;
      inliers += good ? 1 : 0;
    }
    return inliers;
  }
};

/// Keep one and use it again: it owns what a call uploads.
template <class Camera, class Policy>
class motion_only {
 public:
  using memory = memory_of_t<Policy>;
  explicit motion_only(const context<Policy>& ctx) : cameras_(ctx.resource()) {}

  /// Adjusts the pose of every frame to its points: `rounds` times Levenberg-Marquardt on the inliers, after each of
  /// which
  /// outliers are told anew [ORB-SLAM3]. Frames are independent: an index of the policy is a frame.
  /// \param result   one a frame   \param outlier  one an observation: 1 where it does not fit the final pose
  /// \throws std::invalid_argument  a size, an index or an option is wrong
  void operator()(context<Policy>& ctx, const motion_only_input<Camera>& in, const motion_only_options& options,
                  std::vector<posed_frame>& result, std::vector<std::uint8_t>& outlier) {
    check(in, options);
    const std::size_t frames = in.T_cw.size(), n = in.point.size();
    cameras_.host().clear();
    for (int c = 0; c < in.rig.count; ++c) cameras_.host().emplace_back(in.rig[c], options.stereo_correlation);
    ctx.synchronize();
    ctx.begin_call();
    const Policy& policy = ctx.policy();
    cameras_.send(policy);
    auto* to = ctx.template scratch<posed_frame>(frames);
    auto* flags = ctx.template scratch<std::uint8_t>(n);
    const adjust_one_pose<Camera> one{cameras_.data(),
                                      resident(ctx, in.T_cw),
                                      resident(ctx, in.begin),
                                      resident(ctx, in.point),
                                      resident(ctx, in.pixel),
                                      resident(ctx, in.information),
                                      resident(ctx, in.camera),
                                      options,
                                      to,
                                      flags};
    for_each_index(policy, static_cast<int>(frames), one);
    result.resize(frames), outlier.resize(n);
    copy_out(policy, result.data(), to, frames * sizeof(posed_frame));
    copy_out(policy, outlier.data(), flags, n);
    ctx.synchronize();
  }

 private:
  template <class T>
  static const T* resident(context<Policy>& ctx, span<const T> view) {
    if (view.empty()) return nullptr;
    if constexpr (std::is_same_v<memory, host_memory>) {
      return view.data();
    } else {
      T* to = ctx.template scratch<T>(view.size());
      copy_in(ctx.policy(), to, view.data(), view.size() * sizeof(T));
      return to;
    }
  }

  static void check(const motion_only_input<Camera>& in, const motion_only_options& options) {
    validate_rig(in.rig);
    const std::size_t n = in.point.size();
    require(in.begin.size() == in.T_cw.size() + 1, "begin.size()", in.begin.size(), "must be the number of frames + 1");
    require(in.begin[0] == 0 && static_cast<std::size_t>(in.begin[in.begin.size() - 1]) == n, "begin",
            in.begin[in.begin.size() - 1], "must go from 0 to the number of observations");
    for (std::size_t f = 0; f + 1 < in.begin.size(); ++f)
      require(in.begin[f] <= in.begin[f + 1], "begin", in.begin[f + 1], "must not fall");
    require(in.pixel.size() == n, "pixel.size()", in.pixel.size(), "must be that of point");
    require(in.information.size() == n, "information.size()", in.information.size(), "must be that of point");
    for (const double x : in.information) require(!(x < 0), "information", x, "must not be negative");
    require(in.camera.empty() || in.camera.size() == n, "camera.size()", in.camera.size(),
            "must be that of point, or 0");
    for (const auto c : in.camera) require(c < in.rig.count, "camera", static_cast<int>(c), "is not in the rig");
    require(options.rounds >= 1, "options.rounds", options.rounds, "must be positive");
    require(options.iterations >= 1, "options.iterations", options.iterations, "must be positive");
    require(options.mono_chi2 > 0, "options.mono_chi2", options.mono_chi2, "must be positive");
    require(options.stereo_chi2 > 0, "options.stereo_chi2", options.stereo_chi2, "must be positive");
    require_correlation(options.stereo_correlation, "options.stereo_correlation");
    require(options.min_observations >= 1, "options.min_observations", options.min_observations, "must be positive");
  }

  uploaded<adjustment_camera<Camera>, memory> cameras_;
};

TURBOMAP_END_NAMESPACE

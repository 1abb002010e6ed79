// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Poses from points that are held fixed: what tracking does with every image, for many frames in one call.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "../array.hpp"
#include "../camera/rig.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../math/number_checks.hpp"
#include "../named_range.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "adjust_pose.hpp"
#include "adjustment_camera.hpp"
#include "motion_only_options.hpp"
#include "uploaded.hpp"

namespace turbomap {

/// Observations of several frames, one frame after the other, with the points that they see.
template <class Camera>
struct motion_only_input {
  /// The same of all frames.
  rig_view<Camera> rig;
  span<const rigid_transform<double>> T_cw;  ///< first guess of each frame
  span<const std::int32_t> begin;            ///< [frame + 1] its observations
  span<const vec3<double>> point;            ///< [observation] world, m
  span<const vec3<double>> pixel;            ///< u, v, u_right; negative or NaN u_right: none
  span<const double> information;            ///< 1 / sigma^2, px^-2; 0: no observation, no inlier and no outlier
  span<const std::uint8_t> camera = {};      ///< of the rig; empty: the first
  /// [observation] how well its point is known, world, m^2. Points are unknowns too then (uncertain_point.hpp), and chi2, for
  /// kernel and gates, is that of the pixel's error and of the point's together. Empty: all points are exact.
  span<const point_covariance> covariance = {};
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Keep one and use it again: it owns what a call uploads.
template <class Camera, class Policy>
class motion_only {
 public:
  /// Where it computes.
  using memory = memory_of_t<Policy>;
  /// Takes its memory from the context.
  explicit motion_only(const context<Policy>& ctx) : inputs_(ctx.resource()), results_(ctx.staging_resource()) {}

  /// Adjusts the pose of every frame to its points: `rounds` times Levenberg-Marquardt on the inliers, after each of which
  /// outliers are told anew [ORB-SLAM3]. Frames are independent: an index of the policy is a frame.
  /// \param result   [frame]   \param outlier  [observation] 1 where it does not fit the final pose
  /// \throws std::invalid_argument  a size, an index or an option is wrong
  template <class Frames, class Flags>
  void operator()(context<Policy>& ctx, const motion_only_input<Camera>& in, const motion_only_options& options,
                  Frames& result, Flags& outlier) {
    check(in, options);
    const std::size_t frames = in.T_cw.size(), n = in.point.size();
    cameras_.clear();
    for (int c = 0; c < in.rig.count; ++c)
      cameras_.push_back(adjustment_camera<Camera>(in.rig[c], options.stereo_correlation));
    const named_range range("adjust_poses");
    ctx.begin_call();
    const auto& policy = ctx.policy();
    const std::size_t frame_bytes = frames * sizeof(posed_frame);
    auto* const results = ctx.template scratch<std::byte>(frame_bytes + n);
    const auto launch = [&](auto exact, const auto* cameras, const auto* guess, const auto* begin, const auto* point,
                            const auto* pixel, const auto* information, const auto* camera, const auto* covariance) {
      launch_adjust_poses(
          policy, static_cast<int>(frames),
          adjust_one_pose<Camera, exact.value>{{cameras, point, pixel, information, camera, covariance, options},
                                               guess,
                                               begin,
                                               reinterpret_cast<posed_frame*>(results),
                                               reinterpret_cast<std::uint8_t*>(results) + frame_bytes});
    };
    const std::byte* found = nullptr;
    try {
      with_resident(
          ctx, inputs_,
          [&](const auto*... inputs) {
            if (in.covariance.empty())
              launch(std::true_type{}, inputs...);
            else
              launch(std::false_type{}, inputs...);
          },
          span<const adjustment_camera<Camera>>(cameras_), in.T_cw, in.begin, in.point, in.pixel, in.information,
          in.camera, in.covariance);
      found = ctx.on_host(results, frame_bytes + n, results_);
      ctx.synchronize();
    } catch (...) {
      ctx.settle();  // the caller may free what is being copied
      throw;
    }
    result.resize(frames), outlier.resize(n);
    if (frames > 0) std::memcpy(result.data(), found, frame_bytes);
    if (n > 0) std::memcpy(outlier.data(), found + frame_bytes, n);
  }

 private:
  static void check(const motion_only_input<Camera>& in, const motion_only_options& options) {
    validate_rig(in.rig);
    const std::size_t n = in.point.size();
    require(in.begin.size() == in.T_cw.size() + 1, "begin.size()", in.begin.size(), "must be the number of frames + 1");
    require(in.begin[0] == 0, "begin[0]", in.begin[0], "must be 0");
    for (std::size_t f = 0; f + 1 < in.begin.size(); ++f)
      require(in.begin[f] <= in.begin[f + 1], "begin", in.begin[f + 1], "must not fall");
    require(static_cast<std::size_t>(in.begin[in.begin.size() - 1]) == n, "the last of begin",
            in.begin[in.begin.size() - 1], "must be the number of observations");
    require(in.pixel.size() == n, "pixel.size()", in.pixel.size(), "must be that of point");
    require(in.information.size() == n, "information.size()", in.information.size(), "must be that of point");
    for (const double x : in.information) require(x >= 0, "information", x, "must not be negative");
    require(in.camera.empty() || in.camera.size() == n, "camera.size()", in.camera.size(),
            "must be that of point, or 0");
    for (const auto c : in.camera) require(c < in.rig.count, "camera", static_cast<int>(c), "is not in the rig");
    require(in.covariance.empty() || in.covariance.size() == n, "covariance.size()", in.covariance.size(),
            "must be that of point, or 0");
    for (const point_covariance& c : in.covariance)
      require(detail::is_finite(c.xx + c.yx + c.yy + c.zx + c.zy + c.zz) && c.xx >= 0 && c.yy >= 0 && c.zz >= 0,
              "covariance", c.xx + c.yy + c.zz, "must be finite, and variances not negative");
    require(options.rounds >= 1, "options.rounds", options.rounds, "must be positive");
    require(options.iterations >= 1, "options.iterations", options.iterations, "must be positive");
    require(options.mono_chi2 > 0, "options.mono_chi2", options.mono_chi2, "must be positive");
    require(options.stereo_chi2 > 0, "options.stereo_chi2", options.stereo_chi2, "must be positive");
    check_not_negative("options.initial_lambda_scale", options.initial_lambda_scale);
    require(options.min_predicted_decrease >= 0 && options.min_predicted_decrease <= 1e-6,
            "options.min_predicted_decrease", options.min_predicted_decrease, "must be within 0 and 1e-6");
    check_correlation("options.stereo_correlation", options.stereo_correlation);
    require(options.point_steps >= 0, "options.point_steps", options.point_steps, "must not be negative");
    require(options.point_sigmas > 0, "options.point_sigmas", options.point_sigmas, "must be positive");
    require(options.min_observations >= 1, "options.min_observations", options.min_observations, "must be positive");
  }

  plain_vector<adjustment_camera<Camera>> cameras_;
  array<std::byte, memory> inputs_;
  array<std::byte, host_memory> results_;
};

TURBOMAP_END_NAMESPACE

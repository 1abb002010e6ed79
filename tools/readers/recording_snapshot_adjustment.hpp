// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The recorded local bundle adjustment of one iteration (`lba_*`): its problem, its result and what it cost.

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include <turbomap/config.hpp>
#include <turbomap/io/reprojection_data.hpp>
#include <turbomap/math/linear.hpp>
#include "recording_snapshot.hpp"

namespace turbomap {

/// What kind of residual an observation is.
enum class recorded_residual : std::uint8_t { mono = 0, stereo = 1, second_camera = 2 };

template <>
struct npy_row<recorded_residual> {
  using scalar = std::uint8_t;
  static constexpr std::size_t columns = 1;
};

/// Poses and points as the peer's map holds them (float) before and after, and as its solver left them (double). The
/// velocities, biases and preintegrations of an inertial one are not read here.
struct adjustment_snapshot {
  bool inertial = false;          ///< robust costs then contain the inertial residuals
  std::int32_t iterations = 0;    ///< of the peer's solver
  double initial_lambda = 0;      ///< as the peer set it; 0: from the largest diagonal element
  double robust_cost_before = 0;  ///< sum of Huber's rho(chi2), by the peer
  double robust_cost_after = 0;

  std::vector<std::int32_t> keyframe;  ///< first the optimised ones, then the fixed ones
  std::vector<std::uint8_t> fixed;     ///< 1: it does not move (an optimised one may be fixed)
  std::size_t optimised = 0;
  std::vector<rigid_transform<float>> T_cw_before, T_cw_after;
  std::vector<std::array<double, 12>> pose_after;  ///< optimised ones: rotation, row-major, and translation

  std::vector<std::int32_t> point;  ///< the peer's id
  std::vector<vec3<float>> position_before, position_after;
  std::vector<vec3<double>> position_after_exact;

  // One row per observation.
  std::vector<std::int32_t> frame, landmark;  ///< rows of `keyframe` and `point`
  std::vector<std::int32_t> keypoint;         ///< of the keyframe
  std::vector<recorded_residual> kind;
  std::vector<vec3<float>> pixel;               ///< u, v, u_right in px; the last one means something when stereo
  std::vector<float> information;               ///< 1 / sigma^2, px^-2
  std::vector<double> chi2_before, chi2_after;  ///< not robust
  std::vector<std::uint8_t> outlier;            ///< 1: removed afterwards
  std::vector<std::uint8_t> depth_positive;     ///< afterwards
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

inline void read_adjusted_frames(const snapshot_source& from, const json_reader& meta, adjustment_snapshot& out) {
  const auto& lba = meta.json()["lba"];
  const auto number = [&](const char* name) { return meta.member<double>("lba", lba, name); };
  out.inertial = number("inertial") != 0, out.iterations = meta.member<std::int32_t>("lba", lba, "iterations");
  out.initial_lambda = number("user_lambda_init"), out.robust_cost_before = number("robust_chi2_before");
  out.robust_cost_after = number("robust_chi2_after");
  const double optimised = number("n_opt");

  from.read("lba_kf", out.keyframe);
  const std::size_t n = out.keyframe.size();
  if (!(optimised >= 0 && optimised <= static_cast<double>(n)))
    meta.fail("lba", "has an n_opt above the size of lba_kf");
  out.optimised = static_cast<std::size_t>(optimised);
  from.read("lba_kf_fixed", out.fixed, n);
  from.read_finite("lba_Tcw_before", out.T_cw_before, n);
  from.read_finite("lba_Tcw_after", out.T_cw_after, n);
  from.read_finite("lba_pose_after_d", out.pose_after, out.optimised);
  from.check.in_range("lba_kf", out.keyframe, 0, from.keyframe_count());
  from.check.in_range("lba_kf_fixed", out.fixed, 0, 2);
  for (std::size_t i = out.optimised; i < n; ++i)
    if (out.fixed[i] == 0) from.check.fail_row("lba_kf_fixed", i, "is 0, but the keyframe is not an optimised one");
  from.check.rotations("lba_Tcw_before", out.T_cw_before);
  from.check.rotations("lba_Tcw_after", out.T_cw_after);
}

inline void read_adjusted_points(const snapshot_source& from, adjustment_snapshot& out) {
  from.read("lba_pt_id", out.point);
  from.read_finite("lba_pt_before", out.position_before, out.point.size());
  from.read_finite("lba_pt_after", out.position_after, out.point.size());
  from.read_finite("lba_pt_after_d", out.position_after_exact, out.point.size());
}

inline void read_adjusted_observations(const snapshot_source& from, adjustment_snapshot& out) {
  from.read("lba_e_kf", out.frame);
  const std::size_t n = out.frame.size();
  from.read("lba_e_pt", out.landmark, n);
  from.read("lba_e_kp", out.keypoint, n);
  from.read("lba_e_type", out.kind, n);
  from.read_finite("lba_e_obs", out.pixel, n);
  from.read_finite("lba_e_invsigma2", out.information, n);
  from.read_finite("lba_e_chi2_before", out.chi2_before, n);
  from.read_finite("lba_e_chi2_after", out.chi2_after, n);
  from.read("lba_e_outlier", out.outlier, n);
  from.read("lba_e_depthpos", out.depth_positive, n);
  from.check.in_range("lba_e_kf", out.frame, 0, static_cast<std::int64_t>(out.keyframe.size()));
  from.check.in_range("lba_e_pt", out.landmark, 0, static_cast<std::int64_t>(out.point.size()));
  from.check.in_range("lba_e_outlier", out.outlier, 0, 2);
  from.check.in_range("lba_e_depthpos", out.depth_positive, 0, 2);
  const bool two_cameras = !from.recording.meta.camera2.empty();
  for (std::size_t i = 0; i < n; ++i) {
    const std::int32_t keyframe = out.keyframe[static_cast<std::size_t>(out.frame[i])];
    const std::int64_t count = from.keypoint_count(keyframe);
    if (out.keypoint[i] < 0 || out.keypoint[i] >= count)
      from.check.fail_row("lba_e_kp", i,
                          "is " + std::to_string(out.keypoint[i]) + ", but keyframe " + std::to_string(keyframe) +
                              " has " + std::to_string(count) + " keypoints");
    if (out.kind[i] > recorded_residual::second_camera)
      from.check.fail_row("lba_e_type", i, "is " + std::to_string(static_cast<int>(out.kind[i])) + ", not 0 to 2");
    if (out.kind[i] == recorded_residual::second_camera && !two_cameras)
      from.check.fail_row("lba_e_type", i, "is 2, but there is no second camera");
    if (!(out.information[i] > 0)) from.check.fail_row("lba_e_invsigma2", i, "is not positive");
  }
}

}  // namespace detail

/// Reads and validates the adjustment of an iteration of the recording in `directory`; nothing when there was none.
/// Throws bad_file naming file, array and reason.
inline std::optional<adjustment_snapshot> read_adjustment_snapshot(const recording& r,
                                                                   const std::filesystem::path& directory,
                                                                   std::int32_t iteration) {
  const auto where = snapshot_directory(directory, iteration);
  const detail::snapshot_source from{r, where, detail::array_checks(where)};
  const detail::json_reader meta(where / "meta.json");
  std::error_code ignored;
  const bool arrays = std::filesystem::exists(where / "lba_kf.npy", ignored);
  if (arrays != (meta.has("lba") && meta.json()["lba"].is_object()))
    meta.fail("lba", arrays ? "is missing, but lba_kf is there" : "is there, but lba_kf is missing");
  if (!arrays) return std::nullopt;
  std::optional<adjustment_snapshot> out(std::in_place);
  detail::read_adjusted_frames(from, meta, *out);
  detail::read_adjusted_points(from, *out);
  detail::read_adjusted_observations(from, *out);
  return out;
}

/// The visual problem of a recorded adjustment as it was before; camera 1 is the second one.
inline reprojection_data problem_of(const adjustment_snapshot& s) {
  reprojection_data d;
  for (const auto& T : s.T_cw_before) d.T_cw.push_back(cast<double>(T));
  d.fixed = s.fixed;
  for (const auto& x : s.position_before) d.points.push_back(cast<double>(x));
  d.frame = s.frame, d.landmark = s.landmark;
  for (std::size_t i = 0; i < s.frame.size(); ++i) {
    d.camera.push_back(s.kind[i] == recorded_residual::second_camera ? 1 : 0);
    d.stereo.push_back(s.kind[i] == recorded_residual::stereo ? 1 : 0);
    d.pixel.push_back(cast<double>(s.pixel[i]));
    d.information.push_back(s.information[i]);
  }
  return d;
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What is seen from a frame says where it stands: the normal equations of its pose alone, landmarks taken as exact. For
/// priors of frames that leave a window, whose landmarks stay.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/linear.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "../types.hpp"
#include "adjustment_camera.hpp"
#include "factors.hpp"
#include "pose_observations.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// H step = b of a pose: a step as of pose_frame, rad and m.
struct pose_information {
  double H[21] = {};  ///< lower triangle, row by row; 1 / (unit of the step)^2
  double b[6] = {};   ///< the negative gradient; 1 / unit of the step
};

/// Sums the rows of the first frames, with the weights of their Huber kernels. Rows that are not defined are left out;
/// `stereo` must be empty.
/// \param left_out   numbers of rows that do not count, ascending
/// \param T_cw       by frame, world to camera, at which rows are linearised
/// \param landmarks  by landmark, world, m
/// \param sums       as many as frames are asked for
/// \throws std::invalid_argument  rows.stereo is given
/// On the host, whatever the policy. O(rows)
template <class Camera>
void sum_pose_information(const reprojections<Camera, huber>& rows, span<const std::size_t> left_out,
                          span<const rigid_transform<double>> T_cw, span<const vec3<double>> landmarks,
                          plain_vector<pose_information>& sums) {
  require(rows.stereo.empty(), "rows.stereo.size()", rows.stereo.size(), "must be 0");
  plain_vector<adjustment_camera<Camera>> cameras;
  for (int c = 0; c < rows.rig.size(); ++c)
    cameras.push_back(adjustment_camera<Camera>(rows.rig[c], rows.stereo_correlation));
  plain_vector<isometry<double>> poses;
  for (std::size_t f = 0; f < sums.size(); ++f) poses.push_back(to_isometry<double>(T_cw[f]));
  motion_only_options gates;
  gates.mono_chi2 = rows.mono_kernel.delta2, gates.stereo_chi2 = rows.stereo_kernel.delta2;
  pose_observations<Camera, true> row{cameras.data(), nullptr, nullptr, nullptr, nullptr, nullptr, gates};
  std::size_t skipped = 0;
  for (std::size_t i = 0; i < rows.frame.size(); ++i) {
    if (skipped < left_out.size() && left_out[skipped] == i) {
      ++skipped;
      continue;
    }
    const auto f = static_cast<std::size_t>(rows.frame[i]);
    if (f >= sums.size()) continue;
    row.point = &landmarks[static_cast<std::size_t>(rows.landmark[i])];
    row.pixel = &rows.pixel[i], row.information = &rows.information[i];
    if (!rows.camera.empty()) row.camera = &rows.camera[i];
    double rho;
    row.template observe<true>(0, poses[f], {}, true, sums[f].H, sums[f].b, rho);
  }
}

TURBOMAP_END_NAMESPACE

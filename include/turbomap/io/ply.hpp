// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A map as a PLY file, which MeshLab, CloudCompare, Open3D and rerun show: points, and the trajectory as a line.

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <string>

#include "../config.hpp"
#include "../error.hpp"
#include "../span.hpp"
#include "../types.hpp"
#include "trajectory.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Writes points (grey) and the positions of the cameras in the order in which they were taken (red, joined by edges), in the
/// frame of the world, m. Points that are not finite are left out. ASCII, nine decimals, in every locale.
/// \throws std::invalid_argument  a camera whose position is not finite
/// \throws bad_file               it cannot be written; the file is as before then
inline void write_ply(const std::filesystem::path& file, span<const vec3<double>> points,
                      span<const vec3<double>> cameras = {}) {
  const auto finite = [](const vec3<double>& x) {
    return std::isfinite(x.x) && std::isfinite(x.y) && std::isfinite(x.z);
  };
  std::string vertices;
  std::size_t count = 0;
  const auto append = [&](const vec3<double>& x, const char* colour) {
    std::string line;
    for (const double c : {x.x, x.y, x.z}) detail::append_decimals(line, c);
    vertices.append(line, 1).append(colour);
    ++count;
  };
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const vec3<double>& x = cameras[i];
    if (!finite(x))
      reject("cameras[" + std::to_string(i) + "]",
             !std::isfinite(x.x)   ? x.x
             : !std::isfinite(x.y) ? x.y
                                   : x.z,
             "must be finite");
    append(cameras[i], " 220 40 40\n");
  }
  for (const vec3<double>& x : points)
    if (finite(x)) append(x, " 130 130 130\n");
  const std::size_t edges = cameras.empty() ? 0 : cameras.size() - 1;
  std::string text = "ply\nformat ascii 1.0\ncomment metres, world frame; cameras first\nelement vertex ";
  text += std::to_string(count);
  text += "\nproperty double x\nproperty double y\nproperty double z\n";
  text += "property uchar red\nproperty uchar green\nproperty uchar blue\nelement edge ";
  text += std::to_string(edges);
  text += "\nproperty int vertex1\nproperty int vertex2\nend_header\n";
  text += vertices;
  for (std::size_t e = 0; e < edges; ++e) text += std::to_string(e) + ' ' + std::to_string(e + 1) + '\n';
  if (!detail::replace_text_file(file, text)) throw bad_file("turbomap: " + file.string() + ": could not be written");
}

TURBOMAP_END_NAMESPACE

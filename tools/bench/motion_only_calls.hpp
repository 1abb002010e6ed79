// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Single calls of motion-only adjustment, timed by themselves as the number of frames grows: poses that start 2 cm and a hundredth of a
/// radian off, exact points, pixels off by up to one.

#include <cmath>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <turbomap/adjustment/motion_only.hpp>
#include <turbomap/camera/pinhole.hpp>

#include "measure.hpp"

namespace turbomap_bench {

template <class Policy>
nlohmann::json run_motion_only_calls(const Policy& policy, int repetitions) {
  using camera = turbomap::pinhole<double>;
  const camera model{435.2, 435.2, 367.4, 252.2};
  const std::vector<turbomap::rig_camera<camera>> cameras{{model, {}, 47.9, {}}};
  turbomap::context<Policy> ctx(policy);
  turbomap::motion_only<camera, Policy> adjust(ctx);
  std::vector<turbomap::posed_frame> poses;
  std::vector<std::uint8_t> outlier;
  nlohmann::json stages;
  struct {
    int frames, observations;  // of each
  } sizes[] = {{1, 300}, {1, 600}, {16, 300}, {256, 300}};
  for (const auto size : sizes) {
    std::mt19937 random(7);
    const auto uniform = [&](double low, double high) { return low + (high - low) * (random() / 4294967296.0); };
    std::vector<turbomap::rigid_transform<double>> T_cw(static_cast<std::size_t>(size.frames));
    std::vector<std::int32_t> begin{0};
    std::vector<turbomap::vec3<double>> point, pixel;
    for (auto& T : T_cw) {
      T.qx = 0.005, T.qw = 1, T.tx = 0.02;
      for (int i = 0; i < size.observations; ++i) {
        point.push_back({uniform(-4, 4), uniform(-3, 3), uniform(4, 12)});
        turbomap::vec2<double> seen{};
        model.project(point.back(), seen);
        pixel.push_back({seen.x + uniform(-1, 1), seen.y + uniform(-1, 1),
                         i % 2 == 0 ? seen.x - 47.9 / point.back().z + uniform(-1, 1) : -1});
      }
      begin.push_back(static_cast<std::int32_t>(point.size()));
    }
    const std::vector<double> information(point.size(), 1);
    turbomap::motion_only_input<camera> in;
    in.rig = {cameras.data(), static_cast<int>(cameras.size())};
    in.T_cw = turbomap::span<const turbomap::rigid_transform<double>>(T_cw);
    in.begin = turbomap::span<const std::int32_t>(begin);
    in.point = turbomap::span<const turbomap::vec3<double>>(point);
    in.pixel = turbomap::span<const turbomap::vec3<double>>(pixel);
    in.information = turbomap::span<const double>(information);
    const auto call = [&] { adjust(ctx, in, {}, poses, outlier); };
    call();
    for (const auto& pose : poses)
      if (pose.adjusted == 0 || std::abs(pose.T_cw.tx) > 0.01)
        throw std::runtime_error("motion_only: a pose is a centimetre and more off");
    stages["motion_only_" + std::to_string(size.frames) + "_frames_" + std::to_string(size.observations)] =
        interleave(repetitions, call, {}, 0);
  }
  return stages;
}

}  // namespace turbomap_bench

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What an inertial adjustment of a map has to be, by its definition: the window in places of the scene, and the states that a
/// problem gives that is put together here.

#include <turbomap/adjustment/levenberg_marquardt.hpp>
#include <turbomap/inertial/inertial_edges.hpp>

#include <thrust/detail/seq.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <type_traits>
#include <vector>

#include "inertial_adjustment_cases.hpp"

namespace turbomap_test {

using sequential_policy = std::decay_t<decltype(thrust::seq)>;

/// The window by its definition, in places of the scene.
struct defined_window {
  int first = 0;        ///< the end of the chain
  bool begins = false;  ///< it is the first keyframe of the map: its pose is held; else it is fixed
  std::set<std::size_t> points, observers;
  std::size_t rows = 0;
};
inline defined_window window_by_definition(const inertial_map_scene& s, int current, int keyframes, int most) {
  defined_window w;
  w.first = std::max(0, current - keyframes), w.begins = current < keyframes;
  const auto place = [&](const turbomap::map_keyframe_id& k) {
    return static_cast<std::size_t>(std::find(s.keyframes.begin(), s.keyframes.end(), k) - s.keyframes.begin());
  };
  std::vector<std::size_t> order;  // of points: as they are met
  for (int f = current; f > (w.begins ? -1 : w.first); --f) {
    const auto k = s.keyframes[static_cast<std::size_t>(f)];
    for (std::size_t i = 0; i < s.map.keypoints(k).size(); ++i) {
      const auto p = s.map.point_at(k, i);
      if (p == turbomap::map_point_id{}) continue;
      const auto l = static_cast<std::size_t>(std::find(s.points.begin(), s.points.end(), p) - s.points.begin());
      if (w.points.insert(l).second) order.push_back(l);
    }
  }
  const auto in = [&](std::size_t k) {
    return (static_cast<int>(k) >= w.first && static_cast<int>(k) <= current) || w.observers.count(k) != 0;
  };
  for (const std::size_t l : order) {
    if (static_cast<int>(w.observers.size()) == most) break;
    for (const auto& o : s.map.observations(s.points[l])) {
      const std::size_t k = place(s.map.keyframe_at(o.keyframe));
      if (in(k)) continue;
      w.observers.insert(k);
      break;
    }
  }
  for (const std::size_t l : order)
    for (const auto& o : s.map.observations(s.points[l])) w.rows += in(place(s.map.keyframe_at(o.keyframe))) ? 1 : 0;
  return w;
}

/// The adjusted states of the window, by a problem that is put together here, in the order of time.
inline std::vector<turbomap::inertial_state<double>> adjusted_by_definition(
    const inertial_map_scene& s, const defined_window& w, int current,
    const turbomap::local_adjustment_options& options, const turbomap::inertial_window_options& window) {
  using edges_type = turbomap::inertial_edges;
  turbomap::context<sequential_policy> ctx;
  std::vector<std::size_t> frames;
  for (int f = w.first; f <= current; ++f) frames.push_back(static_cast<std::size_t>(f));
  for (const std::size_t k : w.observers) frames.push_back(k);
  const std::size_t chain = static_cast<std::size_t>(current - w.first) + 1;
  std::vector<turbomap::inertial_state<double>> states;
  std::vector<std::uint8_t> fixed;
  std::vector<std::uint32_t> held(frames.size(), 0);
  using turbomap::inertial_frame;
  if (w.begins) held[0] = inertial_frame::hold_pose | (current < 10 ? inertial_frame::hold_biases : 0U);
  edges_type edges;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const auto k = s.keyframes[frames[f]];
    states.push_back({s.map.T_cw(k), s.map.velocity(k), s.map.bias(k)});
    fixed.push_back((f == 0 && !w.begins) || f >= chain ? 1 : 0);
    if (f > 0 && f < chain)
      edges.add(static_cast<std::int32_t>(f - 1), static_cast<std::int32_t>(f), *s.map.motion(k), f == 1 && !w.begins,
                window);
  }
  std::vector<turbomap::rig_camera<turbomap::pinhole<double>>> rig{{{435, 436, 367, 252}, {}, 47.9, {}}};
  auto seen = turbomap::huber_reprojections(turbomap::rig_view<turbomap::pinhole<double>>{rig.data(), 1});
  seen.mono_kernel.delta2 = options.mono_chi2, seen.stereo_kernel.delta2 = options.stereo_chi2;
  std::vector<std::int32_t> frame, landmark;
  std::vector<vec3<double>> pixel, points;
  for (const std::size_t l : w.points) {
    for (std::size_t f = 0; f < frames.size(); ++f)
      for (std::size_t i = 0; i < s.map.keypoints(s.keyframes[frames[f]]).size(); ++i) {
        if (!(s.map.point_at(s.keyframes[frames[f]], i) == s.points[l])) continue;
        const turbomap::keypoint k = s.map.keypoints(s.keyframes[frames[f]])[i];
        frame.push_back(static_cast<std::int32_t>(f)), landmark.push_back(static_cast<std::int32_t>(points.size()));
        pixel.push_back({static_cast<double>(k.x), static_cast<double>(k.y), static_cast<double>(k.u_right)});
      }
    points.push_back(s.map.position(s.points[l]));
  }
  const std::vector<double> information(frame.size(), 1);
  seen.frame = frame, seen.landmark = landmark, seen.pixel = pixel, seen.information = information;
  turbomap::inertial_factor factor;
  factor.T_bc = turbomap::to_isometry<double>(s.map.T_bc()), factor.gravity = s.map.gravity();
  turbomap::bundle_problem<sequential_policy, turbomap::inertial_frame,
                           turbomap::reprojections<turbomap::pinhole<double>>, edges_type::factors,
                           edges_type::robust_factors, edges_type::walk_factors>
      problem(ctx);
  problem.assign(ctx, {states, fixed, held}, {points, {}}, seen, edges.plain(factor), edges.robust(factor, window),
                 edges.walks());
  turbomap::adjustment_options solve = options.solve;
  solve.max_iterations = window.iterations;
  solve.damping = window.damping, solve.initial_lambda = window.initial_lambda;
  using float64 = turbomap::adjustment_methods<turbomap::adjustment_methods<>::solvers,
                                               turbomap::precision_list<turbomap::precision::float64>>;
  turbomap::adjust<float64>(ctx, problem, solve);
  turbomap::plain_vector<turbomap::inertial_state<double>> result;
  problem.frames(ctx, result);
  return {result.begin(), result.begin() + static_cast<std::ptrdiff_t>(chain)};
}

/// Of a state and that of a keyframe of the map: the largest part.
inline double difference(const turbomap::inertial_state<double>& a, const inertial_map& map,
                         turbomap::map_keyframe_id k) {
  using turbomap::norm;
  const auto& T = map.T_cw(k);
  return std::max({norm(vec3<double>{a.T_cw.tx - T.tx, a.T_cw.ty - T.ty, a.T_cw.tz - T.tz}),
                   norm(vec3<double>{a.T_cw.qx - T.qx, a.T_cw.qy - T.qy, a.T_cw.qz - T.qz}),
                   norm(a.velocity - map.velocity(k)), norm(a.bias.gyro - map.bias(k).gyro),
                   norm(a.bias.acceleration - map.bias(k).acceleration)});
}
}  // namespace turbomap_test

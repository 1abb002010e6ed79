// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// bundle_problem::assign() where the host makes all lists of observations and sends them: under host policies, and under others
/// for problems that assign_resident.hpp does not take. Landmarks are put in an order in which those of the same frames are near
/// each other.

#include <cstddef>
#include <cstdint>
#include <tuple>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../span.hpp"
#include "factors.hpp"
#include "median_distance.hpp"
#include "move_frames.hpp"
#include "structure_builder.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The first estimate of a problem whose structure is known. \param transfer  memory on the way, until the policy has waited
template <class Policy, class Data>
void upload_estimate(context<Policy>& ctx, Data& data, const frame_input<typename Data::frame>& frames,
                     const landmark_input& landmarks, array<double, host_memory>& transfer) {
  using state = typename Data::frame::template state<double>;
  const std::size_t n = frames.states.size(), m = landmarks.positions.size();
  data.estimate.resize(n, m);
  transfer.resize_discard(landmark_stride * m);
  for (std::size_t l = 0; l < m; ++l) {
    const vec3<double>& p = landmarks.positions[static_cast<std::size_t>(data.order.source()[l])];
    double* to = transfer.data() + l * landmark_stride;
    to[0] = p.x, to[1] = p.y, to[2] = p.z, to[3] = 0;
  }
  const auto x = data.estimate.current();
  copy_in(ctx.policy(), x.states, frames.states.data(), n * sizeof(state));
  copy_in(ctx.policy(), x.landmarks, transfer.data(), transfer.size() * sizeof(double));
  auto& fixed = data.landmark_fixed.host();
  fixed.clear();
  if (!landmarks.fixed.empty())
    for (const auto l : data.order.source()) fixed.push_back(landmarks.fixed[static_cast<std::size_t>(l)]);
  data.landmark_fixed.send(ctx.policy());
  data.hold(frames.held);
  data.held.send(ctx.policy());
  launch_prepare_poses(ctx.policy(), static_cast<int>(n), x);
}

/// Puts a problem where the policy computes: the host orders the landmarks, makes all lists, and sends them with the numbers.
/// \param data      a problem_data of these groups; all were checked
/// \param in        what was given, described
/// \param transfer  memory on the way
template <class Policy, class Data, class... Groups>
void assign_by_host(context<Policy>& ctx, Data& data, structure_builder& builder, structure_input in,
                    const frame_input<typename Data::frame>& frames, const landmark_input& landmarks,
                    array<double, host_memory>& transfer, const Groups&... groups) {
  data.order.find(in);
  in.landmark_place = span<const std::int32_t>(data.order.place());
  builder.build(in, data.structure);
  group_place place;
  place.first_cost = data.structure.partials;
  place.distance = median_distance(in.landmark_groups, frames, landmarks);
  std::apply([&](auto&... kept) { (kept.assign(ctx.policy(), groups, data.structure, place), ...); }, data.groups);
  upload_estimate(ctx, data, frames, landmarks, transfer);
  data.lists.send_sums(ctx.policy(), data.structure);
  ctx.synchronize();
}

TURBOMAP_END_NAMESPACE

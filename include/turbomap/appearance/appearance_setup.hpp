// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From the caller's points and keyframes to the inputs of a call in the memory of the policy: packed into one block and sent
/// in one copy.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "../math/scale_table.hpp"
#include "../store/posed_keyframe.hpp"
#include "appearances.hpp"
#include "compute_appearance.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Packs and sends the arguments of a call, and makes room for its results.
template <class Descriptor, class Camera, class Policy>
detail::appearance_inputs<Descriptor, Camera> set_up_appearance(
    context<Policy>& ctx, const appearance_view& view, span<const posed_keyframe<Descriptor, Camera>> keyframes,
    const appearance_options& options, appearance_buffers<Descriptor, memory_of_t<Policy>>& buffers) {
  const auto count = static_cast<std::size_t>(view.count);
  const std::size_t seen = count == 0 ? 0 : static_cast<std::size_t>(view.observation_offset[count]);
  const std::size_t measured = options.geometry ? count : 0;
  packed_inputs inputs;
  const auto views = inputs.place<keyframe_view<Descriptor, Camera>>(keyframes.size());
  const auto poses = inputs.place<rigid_transform<double>>(keyframes.size());
  const auto positions = inputs.place<vec3<double>>(measured);
  const auto references = inputs.place<std::int32_t>(measured);
  const auto offsets = inputs.place<std::int32_t>(count == 0 ? 0 : count + 1);
  const auto observations = inputs.place<point_observation>(seen);
  const auto scale = inputs.place<float>(scale_table_size);

  detail::appearance_inputs<Descriptor, Camera> in{};
  in.cameras = 1;
  for (const auto& k : keyframes) in.cameras = k.view.camera_count > in.cameras ? k.view.camera_count : in.cameras;
  in.most_views = options.most_views;
  in.last_level = options.scales.levels - 1;
  buffers.points.resize_discard(count);
  buffers.descriptors.resize_discard(options.descriptors ? count * Descriptor::elements : 0);
  const std::size_t cameras = keyframes.size() * static_cast<std::size_t>(in.cameras);
  if (options.geometry) in.centre = ctx.template scratch<vec3<double>>(cameras);
  if (options.covariance) in.T_camera_world = ctx.template scratch<isometry<double>>(cameras);
  in.stereo_correlation = options.stereo_correlation;
  const upload_block block = ctx.begin_upload(buffers.inputs, inputs.bytes());
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    views.host(block)[k] = keyframes[k].view;
    poses.host(block)[k] = keyframes[k].T_cw;
  }
  positions.copy(block, view.position);
  references.copy(block, view.reference);
  offsets.copy(block, view.observation_offset);
  observations.copy(block, view.observations);
  fill_scales(options.scales, scale.host(block), nullptr);
  ctx.send(block, inputs.bytes());

  in.keyframes = views.resident(block);
  in.T_cw = poses.resident(block);
  in.position = positions.resident(block);
  in.reference = references.resident(block);
  in.observation_offset = offsets.resident(block);
  in.observations = observations.resident(block);
  in.scale = scale.resident(block);
  return in;
}

TURBOMAP_END_NAMESPACE

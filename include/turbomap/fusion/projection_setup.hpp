// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From the caller's points and keyframes to a search in the memory of the policy: everything is checked first, then packed
/// into one block and sent in one copy. What the policy can read where it is, is not copied.

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "../config.hpp"
#include "../context.hpp"
#include "../math/scale_table.hpp"
#include "../plain_vector.hpp"
#include "projection_check.hpp"
#include "projections.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Where the arguments of a search by projection lie in their block. Points and flags are in it only if `Copies`: else the
/// policy reads the caller's.
template <class Descriptor, class Camera, bool Copies>
struct projection_inputs : packed_inputs {
  using element = typename Descriptor::element;
  using target_type = projection_target<Descriptor, Camera>;

  input_slot<keyframe_view<Descriptor, Camera>> keyframes;
  input_slot<rigid_transform<double>> T_cw;
  input_slot<projection_request> requests;
  input_slot<float> scale, sigma2;
  input_slot<vec3<double>> position;
  input_slot<vec3<float>> normal;
  input_slot<float> min_distance, max_distance;
  input_slot<element> descriptor;
  input_slot<std::uint8_t> flags;  ///< skip and taken of one target after the other
  input_slot<point_covariance> covariance;

  projection_inputs(const map_point_view<Descriptor>& points, span<const target_type> targets,
                    std::size_t request_count)
      : keyframes(place<keyframe_view<Descriptor, Camera>>(targets.size())),
        T_cw(place<rigid_transform<double>>(targets.size())),
        requests(place<projection_request>(request_count)),
        scale(place<float>(scale_table_size)),
        sigma2(place<float>(scale_table_size)) {
    if constexpr (!Copies) return;
    const auto n = static_cast<std::size_t>(points.count);
    const auto size = [n](const void* array) { return array == nullptr ? 0 : n; };
    position = place<vec3<double>>(size(points.position));
    normal = place<vec3<float>>(size(points.normal));
    min_distance = place<float>(size(points.min_distance));
    max_distance = place<float>(size(points.max_distance));
    descriptor = place<element>(size(points.descriptor) * Descriptor::elements);
    covariance = place<point_covariance>(size(points.covariance));
    std::size_t count = 0;
    for (const target_type& t : targets) count += t.skip.size() + t.taken.size();
    flags = place<std::uint8_t>(count);
  }

  /// The points as the policy reads them.
  map_point_view<Descriptor> send_points(const upload_block& block, const map_point_view<Descriptor>& p) const {
    if constexpr (!Copies) return p;
    const auto send = [&block](const auto& slot, const auto* source) {
      slot.copy(block, source);
      return slot.size == 0 ? nullptr : slot.resident(block);
    };
    return {p.count,
            send(position, p.position),
            send(normal, p.normal),
            send(min_distance, p.min_distance),
            send(max_distance, p.max_distance),
            send(descriptor, p.descriptor),
            send(covariance, p.covariance)};
  }
  /// Writes the targets, and lists their cameras. \param claims  on the keypoints of all targets, or null
  void fill_targets(const upload_block& block, span<const target_type> targets, int point_count, std::uint64_t* claims,
                    plain_vector<projection_request>& list) const {
    std::size_t sent = 0;
    const auto send = [&](span<const std::uint8_t> source) {
      if (source.empty() || !Copies) return source.empty() ? nullptr : source.data();
      std::memcpy(flags.host(block) + sent, source.data(), source.size());
      sent += source.size();
      return static_cast<const std::uint8_t*>(flags.resident(block) + sent - source.size());
    };
    for (std::size_t i = 0; i < targets.size(); ++i) {
      const target_type& t = targets[i];
      keyframes.host(block)[i] = t.view;
      T_cw.host(block)[i] = t.T_cw;
      const std::uint8_t *skip = send(t.skip), *taken = send(t.taken);
      for (int c = 0; c < t.view.camera_count; ++c) {
        const std::size_t before = static_cast<std::size_t>(c) * static_cast<std::size_t>(point_count);
        list.push_back({static_cast<std::int32_t>(i), c, skip == nullptr ? nullptr : skip + before, taken, claims});
      }
      if (claims != nullptr) claims += t.view.keypoint_count;
    }
    requests.copy(block, list.data());
  }
};

}  // namespace detail

/// Checks, packs and sends the arguments of a search by projection, and makes room for its results. Throws before anything of the
/// previous result is touched.
template <class Descriptor, class Camera, class Policy>
projection_view<Descriptor, Camera> set_up_projection_search(
    context<Policy>& ctx, const map_point_view<Descriptor>& points,
    span<const projection_target<Descriptor, Camera>> targets, const projection_options& options,
    projection_buffers<Descriptor, memory_of_t<Policy>>& buffers) {
  check_projection_options<Descriptor>(options);
  check_map_points(points, options);
  const std::size_t requests = check_projection_targets(targets, points.count);
  const auto count = static_cast<std::size_t>(points.count);
  const detail::projection_inputs<Descriptor, Camera, !is_host_accessible_v<memory_of_t<Policy>>> inputs(
      points, targets, requests);

  buffers.clear();  // from here on memory may run out, and the arrays of the last result are replaced
  buffers.has_trials = false;
  buffers.requests.reserve(requests);
  buffers.cameras.resize_discard(requests);
  buffers.hits.resize_discard(requests * count);
  if (options.keep_trials) buffers.trials.resize_discard(requests * count);
  std::size_t keypoints = 0;
  if (options.one_to_one)
    for (const auto& t : targets) keypoints += static_cast<std::size_t>(t.view.keypoint_count);
  buffers.claims.resize_discard(keypoints);
  const upload_block block = ctx.begin_upload(buffers.inputs, inputs.bytes());
  projection_view<Descriptor, Camera> v;
  v.points = inputs.send_points(block, points);
  inputs.fill_targets(block, targets, points.count, options.one_to_one ? buffers.claims.data() : nullptr,
                      buffers.requests);
  fill_scales(options.scales, inputs.scale.host(block), inputs.sigma2.host(block));
  ctx.send(block, inputs.bytes());

  v.keyframes = inputs.keyframes.resident(block);
  v.T_cw = inputs.T_cw.resident(block);
  v.requests = buffers.resident_requests = inputs.requests.resident(block);
  v.scale = inputs.scale.resident(block);
  v.sigma2 = inputs.sigma2.resident(block);
  v.cameras = buffers.cameras.data();
  v.hits = buffers.hits.data();
  v.trials = options.keep_trials ? buffers.trials.data() : nullptr;
  v.claims = buffers.claims.data();
  v.claim_count = keypoints;
  v.request_count = static_cast<int>(requests);
  v.max_distance = static_cast<typename Descriptor::distance_type>(options.max_distance);
  v.min_range_factor = static_cast<float>(options.min_range_factor);
  v.max_range_factor = static_cast<float>(options.max_range_factor);
  v.options = options;
  buffers.point_count = points.count;
  buffers.has_trials = options.keep_trials;
  return v;
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Representative descriptor, mean viewing direction and distance range of map points whose observations have changed:
/// all touched points in one call, plain arrays in, a plan out.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "../array.hpp"
#include "../camera/camera_concept.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../descriptor/descriptor_concept.hpp"
#include "../math/scale_table.hpp"
#include "../store/posed_keyframe.hpp"
#include "appearance_check.hpp"
#include "appearance_view.hpp"
#include "compute_appearance.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The update of one call, where it was computed. Make one and use it for every call: its memory is reused. Move-only;
/// not shared between threads.
template <class Descriptor, class Camera, class Policy>
class appearances {
 public:
  using memory_type = memory_of_t<Policy>;
  using element = typename Descriptor::element;

  explicit appearances(const context<Policy>& ctx)
      : inputs_(ctx.resource()), points_(ctx.resource()), descriptors_(ctx.resource()) {}
  appearances(appearances&&) = default;
  appearances& operator=(appearances&&) = default;

  /// No points: what is left where a call ran out of memory.
  void clear() {
    points_.resize_discard(0);
    descriptors_.resize_discard(0);
  }
  /// The points in the order of the call, on the host, equal to the last bit on every policy. Waits. O(points).
  /// \param descriptors  overwritten by [point][element], 0 for a point without observations; empty when the call did
  /// not
  ///                     ask for descriptors
  void plan(context<Policy>& ctx, std::vector<point_appearance>& points, std::vector<element>& descriptors) const {
    points.resize(points_.size());
    descriptors.resize(descriptors_.size());
    copy_out(ctx.policy(), points.data(), points_.data(), points.size() * sizeof(point_appearance));
    copy_out(ctx.policy(), descriptors.data(), descriptors_.data(), descriptors.size() * sizeof(element));
    ctx.synchronize();
  }

 private:
  template <class D, class C, class P>
  friend void update_appearance(context<P>&, const appearance_view&, span<const posed_keyframe<D, C>>,
                                const appearance_options&, appearances<D, C, P>&);

  /// Packs the call into one block, sends it, and makes room for the result.
  detail::appearance_inputs<Descriptor, Camera> send(context<Policy>& ctx, const appearance_view& view,
                                                     span<const posed_keyframe<Descriptor, Camera>> keyframes,
                                                     const appearance_options& options) {
    const auto count = static_cast<std::size_t>(view.count);
    const std::size_t seen = count == 0 ? 0 : static_cast<std::size_t>(view.observation_offset[count]);
    const std::size_t measured = options.geometry ? count : 0;
    std::size_t bytes = 0;
    const auto place = [&bytes](std::size_t size) { return std::exchange(bytes, align_up(bytes + size)); };
    const std::size_t keyframes_at = place(sizeof(keyframe_view<Descriptor, Camera>) * keyframes.size());
    const std::size_t poses_at = place(sizeof(rigid_transform<double>) * keyframes.size());
    const std::size_t positions_at = place(sizeof(vec3<double>) * measured);
    const std::size_t references_at = place(sizeof(std::int32_t) * measured);
    const std::size_t offsets_at = place(sizeof(std::int32_t) * (count + 1));
    const std::size_t observations_at = place(sizeof(point_observation) * seen);
    const std::size_t scale_at = place(sizeof(float) * scale_table_size);

    detail::appearance_inputs<Descriptor, Camera> in{};
    in.cameras = 1;
    for (const auto& k : keyframes) in.cameras = k.view.camera_count > in.cameras ? k.view.camera_count : in.cameras;
    in.last_level = options.scales.levels - 1;
    points_.resize_discard(count);
    descriptors_.resize_discard(options.descriptors ? count * Descriptor::elements : 0);
    if (options.geometry)
      in.centre = ctx.template scratch<vec3<double>>(keyframes.size() * static_cast<std::size_t>(in.cameras));
    const upload_block block = ctx.begin_upload(inputs_, bytes);

    for (std::size_t k = 0; k < keyframes.size(); ++k) {
      reinterpret_cast<keyframe_view<Descriptor, Camera>*>(block.host + keyframes_at)[k] = keyframes[k].view;
      reinterpret_cast<rigid_transform<double>*>(block.host + poses_at)[k] = keyframes[k].T_cw;
    }
    const auto put = [&block](std::size_t at, const void* source, std::size_t size) {
      if (size != 0) std::memcpy(block.host + at, source, size);
    };
    put(positions_at, view.position, sizeof(vec3<double>) * measured);
    put(references_at, view.reference, sizeof(std::int32_t) * measured);
    put(offsets_at, view.observation_offset, count == 0 ? 0 : sizeof(std::int32_t) * (count + 1));
    put(observations_at, view.observations, sizeof(point_observation) * seen);
    fill_scales(options.scales, reinterpret_cast<float*>(block.host + scale_at), nullptr);
    ctx.send(block, bytes);

    in.keyframes = reinterpret_cast<const keyframe_view<Descriptor, Camera>*>(block.resident + keyframes_at);
    in.T_cw = reinterpret_cast<const rigid_transform<double>*>(block.resident + poses_at);
    in.position = reinterpret_cast<const vec3<double>*>(block.resident + positions_at);
    in.reference = reinterpret_cast<const std::int32_t*>(block.resident + references_at);
    in.observation_offset = reinterpret_cast<const std::int32_t*>(block.resident + offsets_at);
    in.observations = reinterpret_cast<const point_observation*>(block.resident + observations_at);
    in.scale = reinterpret_cast<const float*>(block.resident + scale_at);
    return in;
  }

  array<std::byte, memory_type> inputs_;
  array<point_appearance, memory_type> points_;
  array<element, memory_type> descriptors_;
};

/// Computes representative descriptor, normal and distance range of points anew from all their observations
/// [ORB-SLAM3]. The descriptor is the medoid: the one with the least median distance to all of the point's, itself
/// included with distance 0; the median of n sorted distances is element floor((n - 1) / 2); of equals the first
/// observation. Every camera's view counts. The range starts from the distance between the point and camera 0 of its
/// reference keyframe, and the octave of its keypoint there: camera 0's if that sees the point, else the first.
/// \param keyframes  all that observe a point; their arrays in the memory of the policy. has_point is not read
/// \param result     overwritten. Under CUDA the work may still be running on return
/// \throws std::invalid_argument  an index, offset, pose, position or option that cannot be; a reference keyframe that
///                                does not observe its point. The previous result stays
/// Cost: n^2 / 2 descriptor distances for a point with n observations, n^2 on a device or above medoid_table_size.
template <class Descriptor, class Camera, class Policy>
void update_appearance(context<Policy>& ctx, const appearance_view& view,
                       span<const posed_keyframe<Descriptor, Camera>> keyframes, const appearance_options& options,
                       appearances<Descriptor, Camera, Policy>& result) {
  static_assert(require_descriptor<Descriptor>());
  static_assert(require_camera<Camera>());
  detail::check_appearance_arguments(view, keyframes, options);
  ctx.begin_call();
  try {
    const auto in = result.send(ctx, view, keyframes, options);
    if (view.count == 0) return;
    if (options.geometry)
      for_each_index(ctx.policy(), static_cast<int>(keyframes.size()) * in.cameras,
                     detail::find_camera_centre<Descriptor, Camera>{in});
    for_each_index(ctx.policy(), view.count,
                   detail::compute_appearance<Descriptor, Camera, memory_of_t<Policy>>{
                       in, result.points_.data(), options.descriptors ? result.descriptors_.data() : nullptr});
  } catch (...) {  // out of memory
    result.clear();
    throw;
  }
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From the caller's keyframes to a search in the memory of the policy: everything is checked first, then packed into one
/// block and sent in one copy.

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../math/scale_table.hpp"
#include "correspondences.hpp"
#include "prepare_search.hpp"
#include "search_check.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// How many keypoints hold no map point.
template <class Descriptor, class Camera>
std::int64_t count_unmapped(const posed_keyframe<Descriptor, Camera>& k) {
  if (k.has_point.empty()) return k.view.keypoint_count;
  std::int32_t count = 0;
  for (const std::uint8_t m : k.has_point) count += m == 0;
  return count;
}
/// The neighbours of a call: those that were given and, last, the query itself where its cameras are matched.
template <class Descriptor, class Camera>
struct searched_neighbours {
  using posed = posed_keyframe<Descriptor, Camera>;
  const posed& query;
  span<const posed> given;
  bool across_rig;

  searched_neighbours(const posed& q, span<const posed> neighbours, const search_options& options)
      : query(q), given(neighbours), across_rig(options.across_rig && q.view.camera_count > 1) {}
  std::size_t size() const { return given.size() + (across_rig ? 1 : 0); }
  const posed& operator[](std::size_t n) const { return n < given.size() ? given[n] : query; }
};
/// Room for the candidates of a neighbour, and for what list_unmapped() writes beyond. Where the policy computes elsewhere, there is
/// room for all keypoints, so that the host need not count them.
template <class Memory, class Descriptor, class Camera>
std::int32_t candidate_room(const posed_keyframe<Descriptor, Camera>& k) {
  if constexpr (is_host_accessible_v<Memory>) return static_cast<std::int32_t>(count_unmapped(k)) + 1;
  return k.view.keypoint_count + 1;
}
inline void check_size(const char* name, std::int64_t size, std::int64_t factor = 1) {
  require(size * factor < (std::int64_t{1} << 31), name, size, "must be below 2^31 in one call");
}

/// Whether a keyframe came with the angles of its keypoints: where it has none, there is nothing to come with.
template <class Descriptor, class Camera>
bool has_angles(const posed_keyframe<Descriptor, Camera>& k) {
  return k.view.keypoint_count == 0 || k.view.angle != nullptr;
}

/// Where the arguments of a search lie in their block.
template <class Descriptor, class Camera, class Memory>
struct search_inputs : packed_inputs {
  input_slot<keyframe_view<Descriptor, Camera>> keyframes;
  input_slot<rigid_transform<double>> T_cw;
  input_slot<std::int32_t> has_point_offset, candidate_begin, queries;
  input_slot<float> scale, sigma2;
  input_slot<std::uint8_t> has_point;

  search_inputs(std::size_t neighbours, std::int64_t slot_count, std::int64_t keypoints)
      : keyframes(place<keyframe_view<Descriptor, Camera>>(1 + neighbours)),
        T_cw(place<rigid_transform<double>>(1 + neighbours)),
        has_point_offset(place<std::int32_t>(neighbours)),
        candidate_begin(place<std::int32_t>(neighbours)),
        queries(place<std::int32_t>(static_cast<std::size_t>(slot_count))),
        scale(place<float>(scale_table_size)),
        sigma2(place<float>(scale_table_size)),
        has_point(place<std::uint8_t>(static_cast<std::size_t>(keypoints))) {}

  void fill(const upload_block& block, const searched_neighbours<Descriptor, Camera>& neighbours,
            const std::int32_t* query_list, const pyramid& scales) const {
    keyframes.host(block)[0] = neighbours.query.view;
    T_cw.host(block)[0] = neighbours.query.T_cw;
    queries.copy(block, query_list);
    std::int32_t masks = 0, room = 0;
    for (std::size_t n = 0; n < neighbours.size(); ++n) {
      const posed_keyframe<Descriptor, Camera>& k = neighbours[n];
      keyframes.host(block)[1 + n] = k.view;
      T_cw.host(block)[1 + n] = k.T_cw;
      has_point_offset.host(block)[n] = masks;
      candidate_begin.host(block)[n] = room;
      std::uint8_t* mask = has_point.host(block) + masks;
      if (k.has_point.empty())
        std::memset(mask, 0, static_cast<std::size_t>(k.view.keypoint_count));
      else
        std::memcpy(mask, k.has_point.data(), k.has_point.size());
      masks += k.view.keypoint_count;
      room += candidate_room<Memory>(k);
    }
    fill_scales(scales, scale.host(block), sigma2.host(block));
  }
  void view(const upload_block& block, search_view<Descriptor, Camera>& v) const {
    v.keyframes = keyframes.resident(block);
    v.T_cw = T_cw.resident(block);
    v.has_point = has_point.resident(block);
    v.has_point_offset = has_point_offset.resident(block);
    v.candidate_begin = candidate_begin.resident(block);
    v.queries = queries.resident(block);
    v.scale = scale.resident(block);
    v.sigma2 = sigma2.resident(block);
  }
};

}  // namespace detail

/// Checks, packs and sends the arguments of a search, and makes room for its results. Throws before anything of the previous
/// result is touched.
template <class Descriptor, class Camera, class Policy>
void set_up_search(context<Policy>& ctx, const posed_keyframe<Descriptor, Camera>& query,
                   span<const posed_keyframe<Descriptor, Camera>> given, const search_options& options,
                   search_buffers<Descriptor, Camera, memory_of_t<Policy>>& buffers) {
  using memory = memory_of_t<Policy>;
  check_search(ctx, query, given, options);
  const detail::searched_neighbours<Descriptor, Camera> neighbours(query, given, options);
  const int neighbour_count = static_cast<int>(neighbours.size()), query_cameras = query.view.camera_count;
  int cameras = 1;
  std::int64_t keypoints = 0, candidate_count = 0;
  bool has_angles = detail::has_angles(query);
  for (std::size_t i = 0; i < neighbours.size(); ++i) {
    const posed_keyframe<Descriptor, Camera>& n = neighbours[i];
    cameras = n.view.camera_count > cameras ? n.view.camera_count : cameras;
    keypoints += n.view.keypoint_count;
    candidate_count += detail::candidate_room<memory>(n);
    has_angles = has_angles && detail::has_angles(n);
  }
  const std::int64_t slots = detail::count_unmapped(query), results = slots * neighbour_count;
  const std::int64_t pairs = std::int64_t{neighbour_count} * cameras * query_cameras;
  detail::check_size("candidates of all neighbours", candidate_count, std::int64_t{cameras} * query_cameras);
  detail::check_size("pairs of cameras", pairs);
  detail::check_size("query groups x neighbours", std::int64_t{neighbour_count} * query.view.groups.group_count);
  detail::check_size("keypoints of all neighbours", keypoints);
  detail::check_size("query keypoints x neighbours", results);
  const detail::search_inputs<Descriptor, Camera, memory> inputs(neighbours.size(), slots, keypoints);

  auto& v = buffers.view;
  // From here on memory may run out, and the arrays of the last result are replaced.
  v.neighbour_count = v.slot_count = 0, v.own_neighbour = -1;
  buffers.keypoint_counts.clear(), buffers.queries.clear();
  buffers.keypoint_counts.reserve(1 + neighbours.size());
  buffers.queries.reserve(static_cast<std::size_t>(slots) + 1);
  buffers.candidates.resize_discard(neighbours.size() + static_cast<std::size_t>(candidate_count));
  buffers.pairs.resize_discard(static_cast<std::size_t>(pairs));
  buffers.match.resize_discard(static_cast<std::size_t>(results));
  buffers.distance.resize_discard(static_cast<std::size_t>(results));
  const upload_block block = ctx.begin_upload(buffers.inputs, inputs.bytes());
  buffers.keypoint_counts.push_back(query.view.keypoint_count);
  for (std::size_t i = 0; i < neighbours.size(); ++i)
    buffers.keypoint_counts.push_back(neighbours[i].view.keypoint_count);
  buffers.queries.resize(static_cast<std::size_t>(slots) + 1);
  detail::list_unmapped(query.has_point.empty() ? nullptr : query.has_point.data(), query.view.keypoint_count,
                        buffers.queries.data());
  buffers.queries.resize(static_cast<std::size_t>(slots));
  inputs.fill(block, neighbours, buffers.queries.data(), options.scales);
  ctx.send(block, inputs.bytes());

  inputs.view(block, v);
  v.candidate_end = buffers.candidates.data();
  v.candidates = v.candidate_end + neighbours.size();
  v.pairs = buffers.pairs.data();
  v.match = buffers.match.data();
  v.distance = buffers.distance.data();
  v.neighbour_count = neighbour_count;
  v.slot_count = static_cast<int>(slots);
  v.query_cameras = query_cameras;
  v.neighbour_cameras = cameras;
  v.own_neighbour = neighbours.across_rig ? neighbour_count - 1 : -1;
  v.max_distance = static_cast<typename Descriptor::distance_type>(options.max_distance);
  v.options = options;
  buffers.has_angles = has_angles;
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Makes the packed form of a keyframe on the host: the user's arrays in order, bearings, cell index and group index.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/strict.hpp"
#include "../plain_vector.hpp"
#include "cell_index.hpp"
#include "keyframe_layout.hpp"
#include "keyframe_validation.hpp"
#include "keyframe_view.hpp"
#include "measured_cameras.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// What one packing hands to the next: memory, and the measures of the cameras.
struct keyframe_packing_scratch {
  plain_vector<std::uint64_t> by_group;  ///< group << 32 | keypoint, ascending
  plain_vector<std::uint64_t> sorting;   ///< of by_group
  plain_vector<std::int32_t> cell;       ///< of each keypoint
  image_bounds image;                    ///< the bounds, widened to all keypoints
  measured_cameras cameras;              ///< resolutions of the rig's cameras, once measured
};

namespace detail {

/// Sorts by the upper half, of which only the bytes that differ cost a pass; ascending lower halves stay in order.
/// O(N).
inline void sort_by_group(plain_vector<std::uint64_t>& values, plain_vector<std::uint64_t>& other) {
  constexpr int digits = 4, radix = 256;
  std::uint32_t starts[digits][radix] = {};
  for (const std::uint64_t v : values)
    for (int d = 0; d < digits; ++d) ++starts[d][v >> (32 + 8 * d) & (radix - 1)];
  for (int d = 0; d < digits && !values.empty(); ++d) {
    const int shift = 32 + 8 * d;
    if (starts[d][values[0] >> shift & (radix - 1)] == values.size()) continue;  // all the same
    std::uint32_t start = 0;
    for (std::uint32_t& s : starts[d]) {
      const std::uint32_t count = s;
      s = start;
      start += count;
    }
    other.resize(values.size());
    for (const std::uint64_t v : values) other[starts[d][v >> shift & (radix - 1)]++] = v;
    values.swap(other);
  }
}

}  // namespace detail

/// Validates a keyframe and lays it out. `scratch` is needed by pack_keyframe(). Throws std::invalid_argument (see validate()).
/// O(N + G log G) for G keypoints with a group.
template <class Descriptor, class Camera>
keyframe_layout plan_packing(const keyframe_data<Descriptor, Camera>& data, const keyframe_packing_options& options,
                             keyframe_packing_scratch& scratch) {
  static_assert(std::is_trivially_copyable_v<Camera> && std::is_trivially_copyable_v<typename Descriptor::element>);
  validate(data, options);
  keyframe_layout layout;
  layout.keypoint_count = data.keypoint_count;
  layout.camera_count = data.camera_count;
  if (data.keypoint_count > 0) {  // without keypoints there is nothing to index
    layout.columns = options.grid_columns;
    layout.rows = options.grid_rows;
    layout.bounds = data.bounds;
    if (layout.columns > 0) {
      layout.inverse_width = inverse_cell_size(layout.columns, data.bounds.min_x, data.bounds.max_x);
      layout.inverse_height = inverse_cell_size(layout.rows, data.bounds.min_y, data.bounds.max_y);
    }
  }
  bool any_u_right = false, any_depth = false;
  auto& by_group = scratch.by_group;
  by_group.clear();
  image_bounds& image = scratch.image = data.bounds;
  for (int i = 0; i < data.keypoint_count; ++i) {
    const keypoint& k = data.keypoints[i];
    any_u_right = any_u_right || k.u_right >= 0;
    any_depth = any_depth || k.depth >= 0;
    image = {std::min(image.min_x, k.x), std::min(image.min_y, k.y), std::max(image.max_x, k.x),
             std::max(image.max_y, k.y)};
    if (k.group != keypoint::no_group)
      by_group.push_back(static_cast<std::uint64_t>(k.group) << 32 | static_cast<std::uint32_t>(i));
  }
  detail::sort_by_group(by_group, scratch.sorting);
  layout.grouped_count = static_cast<int>(by_group.size());
  for (std::size_t i = 0; i < by_group.size(); ++i)
    layout.group_count += i == 0 || by_group[i] >> 32 != by_group[i - 1] >> 32 ? 1 : 0;
  place_arrays<Descriptor, Camera>(layout, data.camera_count > 1, any_u_right, any_depth);
  return layout;
}

namespace detail {

/// An index list while it is being made.
struct index_writer {
  std::byte* data;
  bool wide;
  std::uint32_t get(std::size_t i) const { return index_list{data, wide}[i]; }
  void set(std::size_t i, std::uint32_t value) const {
    if (wide)
      reinterpret_cast<std::uint32_t*>(data)[i] = value;
    else
      reinterpret_cast<std::uint16_t*>(data)[i] = static_cast<std::uint16_t>(value);
  }
};

/// Counting sort within the block itself: counts, then starts of cells, then each keypoint moves its cell's start on,
/// which leaves the ends, which are the starts shifted by one.
template <class Index>
void pack_cells(const keyframe_layout& layout, const keypoint* keypoints, plain_vector<std::int32_t>& cell,
                std::byte* block) {
  Index* offsets = array_at<Index>(block, layout.cell_offsets);
  Index* members = array_at<Index>(block, layout.cell_keypoints);
  const int cells = layout.cell_count();
  std::memset(offsets, 0, (static_cast<std::size_t>(cells) + 1) * sizeof(Index));
  cell.resize(static_cast<std::size_t>(layout.keypoint_count));
  std::int32_t* cell_of_keypoint = cell.data();
  for (int i = 0; i < layout.keypoint_count; ++i) {
    const std::int32_t c = cell_of(layout, keypoints[i].x, keypoints[i].y, int{keypoints[i].camera});
    cell_of_keypoint[i] = c;
    if (c >= 0) ++offsets[c];
  }
  std::uint32_t start = 0;
  for (int c = 0; c <= cells; ++c) {
    const std::uint32_t count = offsets[c];
    offsets[c] = static_cast<Index>(start);
    start += count;
  }
  for (int i = 0; i < layout.keypoint_count; ++i)
    if (const std::int32_t c = cell_of_keypoint[i]; c >= 0) members[offsets[c]++] = static_cast<Index>(i);
  std::memmove(offsets + 1, offsets, static_cast<std::size_t>(cells) * sizeof(Index));
  offsets[0] = 0;
}

inline void pack_groups(const keyframe_layout& layout, const plain_vector<std::uint64_t>& by_group, std::byte* block) {
  auto* ids = array_at<std::uint32_t>(block, layout.group_ids);
  const index_writer offsets{block + layout.group_offsets, layout.wide};
  const index_writer members{block + layout.group_keypoints, layout.wide};
  std::size_t group = 0;
  for (std::size_t i = 0; i < by_group.size(); ++i) {
    const auto id = static_cast<std::uint32_t>(by_group[i] >> 32);
    if (i == 0 || id != ids[group - 1]) {
      ids[group] = id;
      offsets.set(group++, static_cast<std::uint32_t>(i));
    }
    members.set(i, static_cast<std::uint32_t>(by_group[i]));
  }
  offsets.set(group, static_cast<std::uint32_t>(by_group.size()));
}

/// The ray of a pixel, computed in strict<double> and rounded once: the same float on every machine.
template <class Camera>
vec3<float> bearing_of(const Camera& camera, float x, float y) {
  vec3<strict<double>> ray{0, 0, 0};
  if (!camera.unproject(vec2<strict<double>>{x, y}, ray)) return {0, 0, 0};
  return {static_cast<float>(ray.x.value), static_cast<float>(ray.y.value), static_cast<float>(ray.z.value)};
}

/// One field of every keypoint as an array; nothing where the array is left out.
template <class T, class Field>
void pack_field(const keyframe_layout& layout, std::size_t offset, std::byte* block, Field field) {
  if (offset == keyframe_layout::absent) return;
  T* out = array_at<T>(block, offset);
  for (int i = 0; i < layout.keypoint_count; ++i) out[i] = field(i);
}

}  // namespace detail

/// Writes the packed form of `data` to host memory, `layout.bytes` long and aligned to block_alignment. `layout` and
/// `scratch` come from plan_packing() of the same data. The bearing of a pixel that no ray reaches is (0, 0, 0).
/// Cameras whose resolution is unknown are measured, once for images of about one size (measured_cameras). Bytes
/// between arrays are zero, so equal keyframes packed after the same ones are equal blocks.
template <class Descriptor, class Camera>
void pack_keyframe(const keyframe_data<Descriptor, Camera>& data, const keyframe_layout& layout,
                   keyframe_packing_scratch& scratch, std::byte* block) {
  using detail::pack_field;
  const keypoint* k = data.keypoints;
  std::memset(block, 0, layout.bytes);
  pack_field<vec2<float>>(layout, layout.pixel, block, [k](int i) { return vec2<float>{k[i].x, k[i].y}; });
  pack_field<vec3<float>>(layout, layout.bearing, block, [k, &data](int i) {
    return detail::bearing_of(data.cameras[k[i].camera].camera, k[i].x, k[i].y);
  });
  pack_field<std::uint8_t>(layout, layout.octave, block, [k](int i) { return k[i].octave; });
  pack_field<std::uint8_t>(layout, layout.camera, block, [k](int i) { return k[i].camera; });
  pack_field<float>(layout, layout.angle, block, [k](int i) { return k[i].angle; });
  pack_field<float>(layout, layout.u_right, block, [k](int i) { return k[i].u_right; });
  pack_field<float>(layout, layout.depth, block, [k](int i) { return k[i].depth; });
  if (layout.keypoint_count > 0)
    std::memcpy(
        block + layout.descriptor, data.descriptors,
        static_cast<std::size_t>(layout.keypoint_count) * Descriptor::elements * sizeof(typename Descriptor::element));
  if (layout.cell_count() > 0) {
    if (layout.wide)
      detail::pack_cells<std::uint32_t>(layout, k, scratch.cell, block);
    else
      detail::pack_cells<std::uint16_t>(layout, k, scratch.cell, block);
  }
  if (layout.group_count > 0) detail::pack_groups(layout, scratch.by_group, block);
  auto* cameras = detail::array_at<rig_camera<Camera>>(block, layout.cameras);
  for (std::size_t c = 0; c < static_cast<std::size_t>(layout.camera_count); ++c) {
    std::memcpy(cameras + c, data.cameras + c, sizeof *cameras);
    if (layout.keypoint_count > 0 && !data.cameras[c].resolution.known())
      cameras[c].resolution = scratch.cameras.of(c, data.cameras[c].camera, scratch.image);
  }
}

TURBOMAP_END_NAMESPACE

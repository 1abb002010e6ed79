// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Where the arrays of a packed keyframe lie: one block of bytes, the same in the memory of every policy and paged out,
/// so that it moves as a whole.

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "../config.hpp"
#include "../memory.hpp"
#include "../types.hpp"
#include "keyframe_view.hpp"

namespace turbomap {

/// Offsets in bytes from the start of the block, each a multiple of block_alignment; `absent` for an array that is left
/// out.
struct keyframe_layout {
  static constexpr std::size_t absent = static_cast<std::size_t>(-1);  ///< offset of an array that is left out

  int keypoint_count = 0;    ///< keypoints
  int camera_count = 0;      ///< cameras of the rig
  int group_count = 0;       ///< visual-word groups that have a keypoint
  int grouped_count = 0;     ///< keypoints that have a group
  int columns = 0;           ///< cells of the grid in x, per camera; 0: no grid
  int rows = 0;              ///< cells in y
  image_bounds bounds;       ///< of the grid, px
  float inverse_width = 0;   ///< cells per px, in x
  float inverse_height = 0;  ///< cells per px, in y
  bool wide = false;         ///< 32-bit index lists: from 65,536 keypoints on

  /// @{
  /// Offset of the array of this name of a keyframe_view, bytes.
  std::size_t pixel = absent, bearing = absent, octave = absent, camera = absent, angle = absent, u_right = absent,
              depth = absent, descriptor = absent, cell_offsets = absent, cell_keypoints = absent, group_ids = absent,
              group_offsets = absent, group_keypoints = absent, cameras = absent;
  /// @}
  std::size_t bytes = 0;  ///< of the block

  /// Cells of all cameras together.
  int cell_count() const { return camera_count * columns * rows; }
  /// Size of an element of an index list.
  std::size_t index_bytes() const { return wide ? 4 : 2; }
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Sets the offsets and the size from the counts. `with_*`: which optional arrays there are.
template <class Descriptor, class Camera>
void place_arrays(keyframe_layout& layout, bool with_camera, bool with_u_right, bool with_depth) {
  std::size_t bytes = 0;
  const auto place = [&bytes](std::size_t elements, std::size_t element_bytes) {
    const std::size_t offset = bytes;
    bytes = align_up(bytes + elements * element_bytes);
    return offset;
  };
  const auto n = static_cast<std::size_t>(layout.keypoint_count);
  const auto groups = static_cast<std::size_t>(layout.group_count);
  layout.wide = layout.keypoint_count > 0xFFFF;
  layout.pixel = place(n, sizeof(vec2<float>));
  layout.bearing = place(n, sizeof(vec3<float>));
  layout.octave = place(n, 1);
  layout.camera = with_camera ? place(n, 1) : keyframe_layout::absent;
  layout.angle = place(n, sizeof(float));
  layout.u_right = with_u_right ? place(n, sizeof(float)) : keyframe_layout::absent;
  layout.depth = with_depth ? place(n, sizeof(float)) : keyframe_layout::absent;
  layout.descriptor = place(n * static_cast<std::size_t>(Descriptor::elements), sizeof(typename Descriptor::element));
  if (layout.cell_count() > 0) {
    layout.cell_offsets = place(static_cast<std::size_t>(layout.cell_count()) + 1, layout.index_bytes());
    layout.cell_keypoints = place(n, layout.index_bytes());
  }
  if (groups > 0) {
    layout.group_ids = place(groups, sizeof(std::uint32_t));
    layout.group_offsets = place(groups + 1, layout.index_bytes());
    layout.group_keypoints = place(static_cast<std::size_t>(layout.grouped_count), layout.index_bytes());
  }
  layout.cameras = place(static_cast<std::size_t>(layout.camera_count), sizeof(rig_camera<Camera>));
  layout.bytes = bytes;
}

namespace detail {
template <class T>
T* array_at(std::byte* base, std::size_t offset) {
  return offset == keyframe_layout::absent ? nullptr : reinterpret_cast<T*>(base + offset);
}
}  // namespace detail

/// The view of a packed keyframe whose block starts at `base`, in whatever memory; `base` is not read.
template <class Descriptor, class Camera>
keyframe_view<Descriptor, Camera> view_at(const keyframe_layout& layout, std::byte* base) {
  using detail::array_at;
  keyframe_view<Descriptor, Camera> view;
  view.keypoint_count = layout.keypoint_count;
  view.pixel = array_at<vec2<float>>(base, layout.pixel);
  view.bearing = array_at<vec3<float>>(base, layout.bearing);
  view.octave = array_at<std::uint8_t>(base, layout.octave);
  view.camera = array_at<std::uint8_t>(base, layout.camera);
  view.angle = array_at<float>(base, layout.angle);
  view.u_right = array_at<float>(base, layout.u_right);
  view.depth = array_at<float>(base, layout.depth);
  view.descriptor = array_at<typename Descriptor::element>(base, layout.descriptor);
  view.cells.offsets = {array_at<void>(base, layout.cell_offsets), layout.wide};
  view.cells.keypoints = {array_at<void>(base, layout.cell_keypoints), layout.wide};
  view.cells.bounds = layout.bounds;
  view.cells.inverse_width = layout.inverse_width;
  view.cells.inverse_height = layout.inverse_height;
  view.cells.columns = layout.columns;
  view.cells.rows = layout.rows;
  view.groups.ids = array_at<std::uint32_t>(base, layout.group_ids);
  view.groups.offsets = {array_at<void>(base, layout.group_offsets), layout.wide};
  view.groups.keypoints = {array_at<void>(base, layout.group_keypoints), layout.wide};
  view.groups.group_count = layout.group_count;
  view.cameras = array_at<rig_camera<Camera>>(base, layout.cameras);
  view.camera_count = layout.camera_count;
  return view;
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Everything that can be wrong with a keyframe is found here, before any memory is asked for.

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>

#include "../camera/rig.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "../math/number_checks.hpp"
#include "keyframe_store_options.hpp"
#include "keyframe_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Throws std::invalid_argument naming the option when the packing options make no sense.
inline void validate(const keyframe_packing_options& options) {
  require(options.grid_columns >= 0 && options.grid_columns <= 0xFFFF, "grid_columns", options.grid_columns,
          "must be in [0, 65535]");
  require(options.grid_rows >= 0 && options.grid_rows <= 0x7FFF, "grid_rows", options.grid_rows,
          "must be in [0, 32767]");
  require((options.grid_columns == 0) == (options.grid_rows == 0), "grid_rows", options.grid_rows,
          "a grid has columns and rows, or neither");
  require(options.pyramid.levels >= 1, "pyramid.levels", options.pyramid.levels, "must be at least 1");
  check_factor("pyramid.scale_factor", static_cast<double>(options.pyramid.scale_factor));
}

/// Throws std::invalid_argument naming the option when one makes no sense.
inline void validate(const keyframe_store_options& options) {
  validate(options.packing);
  require(options.chunk_bytes > 0, "chunk_bytes", options.chunk_bytes, "must not be 0");
}

namespace detail {
template <class Value>
void require_keypoint(bool holds, int index, const char* field, const Value& value, const char* rule) {
  if (!holds) reject(std::string("keypoints[").append(printed(index)).append("].").append(field), value, rule);
}

/// All of it in one branch: this runs over every keypoint.
inline bool is_valid(const keypoint& k, int levels, int cameras) {
  int wrong = k.octave < levels ? 0 : 1;
  wrong += k.camera < cameras ? 0 : 1;
  for (const float value : {k.x, k.y, k.angle, k.u_right, k.depth}) wrong += is_finite(value) ? 0 : 1;
  return wrong == 0;
}
/// Throws naming the first thing that is wrong with keypoint `i`.
inline void validate_keypoint(const keypoint& k, int i, int levels, int cameras) {
  require_keypoint(is_finite(k.x), i, "x", k.x, "must be finite");
  require_keypoint(is_finite(k.y), i, "y", k.y, "must be finite");
  require_keypoint(is_finite(k.angle), i, "angle", k.angle, "must be finite");
  require_keypoint(is_finite(k.u_right), i, "u_right", k.u_right, "must be finite; negative: none");
  require_keypoint(is_finite(k.depth), i, "depth", k.depth, "must be finite; negative: unknown");
  require_keypoint(k.octave < levels, i, "octave", int{k.octave},
                   "must be below the levels of the pyramid (keyframe_store_options::packing)");
  require_keypoint(k.camera < cameras, i, "camera", int{k.camera}, "must be below the number of cameras");
}
}  // namespace detail

namespace detail {
/// The size of an image, and of the cells that it is divided into, as searches compute it.
inline void validate_extent(const char* name, float extent, int cells) {
  require(is_finite(extent) && is_finite(static_cast<float>(cells > 0 ? cells : 1) / extent), name, extent,
          "must be finite, and not so small that cells have no size");
}

template <class Descriptor, class Camera>
std::uint8_t most_camera(const keyframe_view<Descriptor, Camera>& view) {
  std::uint8_t most = 0;
  for (int i = 0; i < view.keypoint_count; ++i) most = view.camera[i] > most ? view.camera[i] : most;
  return most;
}
}  // namespace detail

/// Whether every keypoint's camera is one of the rig; the view is in host memory. O(N), a byte each.
template <class Descriptor, class Camera>
bool has_cameras(const keyframe_view<Descriptor, Camera>& view) {
  return view.camera == nullptr || view.keypoint_count <= 0 || detail::most_camera(view) < view.camera_count;
}

/// Throws std::invalid_argument when a keypoint of a view in host memory names a camera that the rig does not have: a
/// view of the store cannot, one that a user filled may. A view in device memory cannot be looked at here; there
/// such a camera is read out of bounds. O(N), a byte each.
/// \param argument  what the view is called in the message
template <class Descriptor, class Camera>
void require_cameras(const keyframe_view<Descriptor, Camera>& view, const char* argument) {
  if (!has_cameras(view))
    reject(std::string(argument).append(".camera"), int{detail::most_camera(view)},
           "must be below the number of cameras");
}

/// Throws std::invalid_argument naming argument, index and value when the keyframe cannot be stored: missing arrays, no
/// or impossible cameras, keypoints that are not finite, octaves or cameras out of range, empty image bounds. No
/// keypoints at all is fine. O(N).
template <class Descriptor, class Camera>
void validate(const keyframe_data<Descriptor, Camera>& data, const keyframe_packing_options& options) {
  require(data.keypoint_count >= 0, "keypoint_count", data.keypoint_count, "must not be negative");
  require(data.keypoint_count == 0 || data.keypoints != nullptr, "keypoints", "null", "there are keypoints to read");
  require(data.keypoint_count == 0 || data.descriptors != nullptr, "descriptors", "null",
          "there are descriptors to read");
  require(data.camera_count >= 1, "camera_count", data.camera_count, "a rig has at least one camera");
  require(data.cameras != nullptr, "cameras", "null", "there are cameras to read");
  validate_rig(rig_view<Camera>{data.cameras, data.camera_count});
  for (int i = 0; i < data.keypoint_count; ++i)
    if (!detail::is_valid(data.keypoints[i], options.pyramid.levels, data.camera_count))
      detail::validate_keypoint(data.keypoints[i], i, options.pyramid.levels, data.camera_count);
  const image_bounds& b = data.bounds;
  using detail::is_finite;
  if (data.keypoint_count > 0) {
    require(is_finite(b.min_x), "bounds.min_x", b.min_x, "must be finite");
    require(is_finite(b.min_y), "bounds.min_y", b.min_y, "must be finite");
    require(is_finite(b.max_x) && b.max_x > b.min_x, "bounds.max_x", b.max_x, "must be finite and above min_x");
    require(is_finite(b.max_y) && b.max_y > b.min_y, "bounds.max_y", b.max_y, "must be finite and above min_y");
    detail::validate_extent("bounds.max_x - bounds.min_x", b.max_x - b.min_x, options.grid_columns);
    detail::validate_extent("bounds.max_y - bounds.min_y", b.max_y - b.min_y, options.grid_rows);
  }
  const long long cells = static_cast<long long>(options.grid_columns) * options.grid_rows * data.camera_count;
  require(cells < 0x7FFFFFFF, "grid_columns * grid_rows * camera_count", cells, "must be below 2^31 - 1");
}

TURBOMAP_END_NAMESPACE

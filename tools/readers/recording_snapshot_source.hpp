// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How the arrays of one snapshot of a recording are read: rows or shapes, checked as they come in. Every stage's
/// reader (recording_snapshot_*.hpp) is written in terms of this.

#include <array>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <system_error>
#include <vector>

#include <turbomap/config.hpp>
#include <turbomap/error.hpp>
#include <turbomap/io/recording.hpp>
#include <turbomap/span.hpp>

namespace turbomap {

/// Two keypoint indices: of the current keyframe and a neighbour, or of the left and right view of one keyframe.
using index_pair = std::array<std::int32_t, 2>;

/// Rows [offsets[i], offsets[i + 1]) (not checked: i + 1 < offsets.size()).
inline row_range offset_rows(const std::vector<std::int64_t>& offsets, std::size_t i) {
  return {static_cast<std::size_t>(offsets[i]), static_cast<std::size_t>(offsets[i + 1])};
}

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Reads arrays of one snapshot and holds what their checks need.
struct snapshot_source {
  const turbomap::recording& recording;
  std::filesystem::path directory;
  array_checks check;
  std::vector<std::uint8_t> has_pose = {};  ///< a keyframe: 1: it is in the map at the start

  template <class Row>
  void read(const char* name, std::vector<Row>& rows) const {
    rows = read_npy_rows<Row>(file(name));
  }
  template <class Row>
  void read(const char* name, std::vector<Row>& rows, std::size_t expected) const {
    read(name, rows);
    check.size(name, rows.size(), expected);
  }
  /// All of its numbers are finite.
  template <class Row, class... Expected>
  void read_finite(const char* name, std::vector<Row>& rows, Expected... expected) const {
    read(name, rows, expected...);
    check.finite(name, rows);
  }
  /// An array of several dimensions, row-major.
  template <class T>
  void read_shape(const char* name, std::vector<T>& values, const std::vector<std::size_t>& expected) const {
    auto array = read_npy<T>(file(name));
    if (array.shape != expected)
      check.fail(name, "has shape " + shape_text(array.shape) + ", not " + shape_text(expected));
    values = std::move(array.values);
  }
  /// Offsets of `count` lists in `rows` rows.
  void read_offsets(const char* name, std::vector<std::int64_t>& values, std::size_t count, std::size_t rows) const {
    read(name, values, count + 1);
    check.offsets(name, values, rows);
  }

  /// Whether a group of arrays is there: whole or not at all, by its first one and some of the others.
  bool has_group(std::initializer_list<const char*> names) const {
    const char* first = *names.begin();
    std::error_code ignored;
    if (std::filesystem::exists(file(first), ignored)) return true;
    for (const char* name : names)
      if (std::filesystem::exists(file(name), ignored))
        check.fail(first, std::string("is missing, but ") + name + " is there");
    return false;
  }

  std::int64_t keypoint_count(std::int32_t keyframe) const {
    return static_cast<std::int64_t>(recording.keypoints(static_cast<std::size_t>(keyframe)).size());
  }
  std::int64_t keyframe_count() const { return static_cast<std::int64_t>(recording.keyframe_count()); }
  std::size_t camera_count() const { return recording.meta.camera2.empty() ? 1 : 2; }

  /// All of them are keyframes that are in the map at the start.
  void posed(const char* name, const std::vector<std::int32_t>& keyframes) const {
    check.in_range(name, keyframes, 0, keyframe_count());
    for (std::size_t i = 0; i < keyframes.size(); ++i)
      if (has_pose[static_cast<std::size_t>(keyframes[i])] == 0)
        check.fail_row(name, i, "is " + std::to_string(keyframes[i]) + ", which is not in kf_alive");
  }
  /// `index`, or -1 for none where that is allowed, is a keypoint of a keyframe.
  void keypoint(const char* name, std::size_t row, std::int32_t index, std::int32_t keyframe, bool or_none) const {
    if (index < (or_none ? -1 : 0) || index >= keypoint_count(keyframe))
      check.fail_row(name, row,
                     "is " + std::to_string(index) + ", but keyframe " + std::to_string(keyframe) + " has " +
                         std::to_string(keypoint_count(keyframe)) + " keypoints");
  }
  /// views[i] are the left and the right keypoint, -1 none, by which keyframe[i] sees a point: at least one of them.
  void views(const char* name, const std::vector<index_pair>& views, const std::vector<std::int32_t>& keyframe) const {
    for (std::size_t i = 0; i < views.size(); ++i) {
      const std::int32_t nleft = recording.nleft[static_cast<std::size_t>(keyframe[i])];
      const std::int64_t count = keypoint_count(keyframe[i]), left = nleft < 0 ? count : nleft;
      const std::int32_t l = views[i][0], r = views[i][1];
      if (l < -1 || l >= left || (r != -1 && (r < left || r >= count)) || (l == -1 && r == -1))
        check.fail_row(name, i,
                       "is (" + std::to_string(l) + ", " + std::to_string(r) + "), but keyframe " +
                           std::to_string(keyframe[i]) + " has " + std::to_string(left) + " left and " +
                           std::to_string(count - left) + " right keypoints");
    }
  }

 private:
  std::filesystem::path file(const char* name) const { return directory / (std::string(name) + ".npy"); }
};

}  // namespace detail

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What makes a recording a recording: every offset monotone and ending at its array's size, every index inside its
/// array, every number finite. Afterwards nothing that replays it has to check again.
/// Longer than other headers, so that the rules of the format stand in one place.

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <type_traits>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "npy.hpp"
#include "recording_arrays.hpp"
#include "recording_data.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Checks that name file, array, row and rule in what they throw. `directory` may be empty for data not from a file.
class array_checks {
 public:
  explicit array_checks(std::filesystem::path directory) : directory_(std::move(directory)) {}

  [[noreturn]] void fail(const std::string& array, const std::string& reason) const {
    reject_array(directory_ / (array + ".npy"), array, reason);
  }
  [[noreturn]] void fail_row(const std::string& array, std::size_t row, const std::string& reason) const {
    fail(array, "row " + std::to_string(row) + " " + reason);
  }
  void size(const char* array, std::size_t have, std::size_t expected) const {
    if (have != expected) fail(array, "has " + std::to_string(have) + " rows, not " + std::to_string(expected));
  }
  /// Offsets start at 0, never fall, and end at `rows`, the size of what they index.
  void offsets(const char* array, const std::vector<std::int64_t>& values, std::size_t rows) const {
    if (values.empty() || values.front() != 0) fail(array, "does not begin with 0");
    for (std::size_t i = 1; i < values.size(); ++i)
      if (values[i] < values[i - 1])
        fail_row(array, i, "is " + std::to_string(values[i]) + ", less than the one before");
    if (values.back() < 0 || static_cast<std::uint64_t>(values.back()) != rows)
      fail(array, "ends at " + std::to_string(values.back()) + ", but there are " + std::to_string(rows) + " rows");
  }
  /// lowest <= every value < end.
  template <class T>
  void in_range(const char* array, const std::vector<T>& values, std::int64_t lowest, std::int64_t end) const {
    for (std::size_t i = 0; i < values.size(); ++i)
      if (static_cast<std::int64_t>(values[i]) < lowest || static_cast<std::int64_t>(values[i]) >= end)
        fail_row(array, i,
                 "is " + std::to_string(values[i]) + ", outside [" + std::to_string(lowest) + ", " +
                     std::to_string(end) + ")");
  }
  template <class T>
  void never_falls(const char* array, const std::vector<T>& values) const {
    for (std::size_t i = 1; i < values.size(); ++i)
      if (values[i] < values[i - 1]) fail_row(array, i, "is earlier than the one before");
  }
  /// All numbers of all rows are finite; integers always are. `counts(row)` false: that row means nothing.
  template <class Row, class Counts>
  void finite(const char* array, const std::vector<Row>& rows, Counts counts) const {
    using scalar = typename npy_row<Row>::scalar;
    if constexpr (std::is_floating_point_v<scalar>) {
      const auto* values = reinterpret_cast<const scalar*>(rows.data());
      constexpr std::size_t columns = npy_row<Row>::columns;
      for (std::size_t i = 0; i < rows.size() * columns; ++i)
        if (!std::isfinite(values[i]) && counts(i / columns))
          fail_row(array, i / columns, "holds a number that is not finite");
    }
  }
  template <class Row>
  void finite(const char* array, const std::vector<Row>& rows) const {
    finite(array, rows, [](std::size_t) { return true; });
  }
  /// Rotations are unit quaternions to float's precision; they are used as stored.
  template <class Pose, class Counts>
  void rotations(const char* array, const std::vector<Pose>& poses, Counts counts) const {
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const auto& q = poses[i];
      if (counts(i) && !(std::abs(q.qx * q.qx + q.qy * q.qy + q.qz * q.qz + q.qw * q.qw - 1) < 1e-3F))
        fail_row(array, i, "has no unit quaternion");
    }
  }
  template <class Pose>
  void rotations(const char* array, const std::vector<Pose>& poses) const {
    rotations(array, poses, [](std::size_t) { return true; });
  }
  void unit_vectors(const char* array, const std::vector<vec3<float>>& vectors) const {
    for (std::size_t i = 0; i < vectors.size(); ++i) {
      const auto& v = vectors[i];
      if (!(std::abs(v.x * v.x + v.y * v.y + v.z * v.z - 1) < 1e-3F)) fail_row(array, i, "is no unit vector");
    }
  }

 private:
  std::filesystem::path directory_;
};

/// How many rows an array of this kind has, by the other arrays.
inline std::size_t row_count(const recording& r, recording_rows what) {
  switch (what) {
    case recording_rows::keyframes:
      return r.t_ns.size();
    case recording_rows::keyframe_offsets:
      return r.t_ns.size() + 1;
    case recording_rows::keypoints:
      return r.kp_xy.size();
    case recording_rows::associations:
      return r.assoc_kp.size();
    case recording_rows::recent:
      return r.recent_ref.size();
    case recording_rows::imu:
      return r.imu_t_ns.size();
    case recording_rows::ground_truth:
      return r.gt_t_ns.size();
    case recording_rows::frames:
      return r.frame_t_ns.size();
    case recording_rows::scene_points:
      return r.sim_point_xyz.size();
  }
  return 0;
}

inline void check_row_counts(const recording& r, const array_checks& check) {
  if (r.t_ns.empty()) check.fail("log_t_ns", "is empty: a recording has a keyframe at least");
  visit_arrays(r, [&](const char* name, const auto& rows, recording_rows what, presence must) {
    if (must == presence::required || !rows.empty()) check.size(name, rows.size(), row_count(r, what));
  });
  const auto together = [&](const char* name, bool there, bool first) {
    if (there != first) check.fail(name, first ? "is missing" : "is there without the arrays it belongs to");
  };
  together("log_bias", !r.bias.empty(), r.has_velocity());
  together("log_bimu", !r.bimu.empty(), r.has_velocity());
  together("imu_gyro_acc", !r.imu.empty(), !r.imu_t_ns.empty());
  together("gt_Twb", !r.gt_T_wb.empty(), !r.gt_t_ns.empty());
  together("frame_Tcw", !r.frame_T_cw.empty(), !r.frame_t_ns.empty());
  together("frame_state", !r.frame_state.empty(), !r.frame_t_ns.empty());
  together("final_alive", !r.final_alive.empty(), r.has_final());
  together("sim_track_id", !r.sim_track_id.empty(), r.is_simulated());
  together("sim_point_normal", !r.sim_point_normal.empty(), !r.sim_point_xyz.empty());
  together("sim_Tcw_true", !r.sim_T_cw_true.empty(), r.is_simulated());
  together("sim_bias_true", !r.sim_bias_true.empty(), !r.sim_velocity_true.empty());
  check.offsets("log_kp_off", r.kp_off, r.kp_xy.size());
  check.offsets("log_assoc_off", r.assoc_off, r.assoc_kp.size());
  check.offsets("log_recent_off", r.recent_off, r.recent_ref.size());
}

/// The keyframe with index `at` in `rows`, which is keyframe `index` of the whole recording; `all` has those before it.
/// `rows` is `all`, or a recording of this keyframe alone.
struct checked_keyframe {
  const recording& all;
  std::size_t index;
  const recording& rows;
  std::size_t at;

  std::size_t keypoint_count(std::int32_t keyframe) const {
    const auto i = static_cast<std::size_t>(keyframe);
    return i == index ? rows.keypoints(at).size() : all.keypoints(i).size();
  }
};

/// A reference is a keypoint of this or an earlier keyframe, or {-1, -1}.
inline void check_reference(const checked_keyframe& k, const array_checks& check, const char* array, std::size_t row,
                            keypoint_reference ref) {
  if (ref.keyframe == -1 && ref.keypoint == -1) return;
  if (ref.keyframe < 0 || static_cast<std::size_t>(ref.keyframe) > k.index)
    check.fail_row(array, row,
                   "refers to keyframe " + std::to_string(ref.keyframe) + ", from keyframe " + std::to_string(k.index));
  const std::size_t count = k.keypoint_count(ref.keyframe);
  if (ref.keypoint < 0 || static_cast<std::size_t>(ref.keypoint) >= count)
    check.fail_row(array, row,
                   "refers to keypoint " + std::to_string(ref.keypoint) + " of keyframe " +
                       std::to_string(ref.keyframe) + ", which has " + std::to_string(count));
}

inline void check_keyframe_indices(const checked_keyframe& k, const array_checks& check) {
  const recording& r = k.rows;
  const auto count = static_cast<std::int64_t>(r.keypoints(k.at).size());
  const auto has = [&] {
    return ", but keyframe " + std::to_string(k.index) + " has " + std::to_string(count) + " keypoints";
  };
  const std::int32_t nleft = r.nleft[k.at], previous = r.prev_kf[k.at];
  if (nleft < -1 || nleft > count) check.fail_row("log_nleft", k.at, "is " + std::to_string(nleft) + has());
  if (nleft >= 0 && k.all.meta.camera2.empty())
    check.fail_row("log_nleft", k.at, "is " + std::to_string(nleft) + ", but there is no second camera");
  if (previous < -1 || previous >= static_cast<std::int64_t>(k.index))
    check.fail_row("log_prev_kf", k.at, "is " + std::to_string(previous) + ", not an earlier keyframe or -1");
  for (std::size_t i = r.keypoints(k.at).begin; i < r.keypoints(k.at).end; ++i)
    if (r.kp_lrmatch[i] < -1 || r.kp_lrmatch[i] >= count)
      check.fail_row("log_kp_lrmatch", i, "is " + std::to_string(r.kp_lrmatch[i]) + has());
  for (std::size_t a = r.associations(k.at).begin; a < r.associations(k.at).end; ++a) {
    if (r.assoc_kp[a] < 0 || r.assoc_kp[a] >= count)
      check.fail_row("log_assoc_kp", a, "is " + std::to_string(r.assoc_kp[a]) + has());
    check_reference(k, check, "log_assoc_ref", a, r.assoc_ref[a]);
    check_reference(k, check, "log_assoc_ref2", a, r.assoc_ref2[a]);
    if (r.assoc_new[a] > 1) check.fail_row("log_assoc_new", a, "is neither 0 nor 1");
    if (r.assoc_new[a] == 1 && r.assoc_ref[a].keyframe != static_cast<std::int64_t>(k.index))
      check.fail_row("log_assoc_ref", a, "of a new point does not refer to its own keyframe");
  }
  for (std::size_t i = r.recent(k.at).begin; i < r.recent(k.at).end; ++i)
    check_reference(k, check, "log_recent_ref", i, r.recent_ref[i]);
}

/// Rules of arrays with any number of rows, as they hold for every row.
inline void check_rows(const recording& r, const array_checks& check, int levels) {
  const auto tracked = [&](std::size_t i) { return r.frame_state[i] == 2; };
  visit_arrays(r, [&](const char* name, const auto& rows, recording_rows what, presence) {
    if (what == recording_rows::frames) {
      check.finite(name, rows, tracked);
    } else {
      check.finite(name, rows);
    }
  });
  check.rotations("log_Tcw", r.T_cw);
  check.rotations("frame_Tcw", r.frame_T_cw, tracked);
  check.rotations("final_Tcw", r.final_T_cw);
  check.rotations("sim_Tcw_true", r.sim_T_cw_true);
  check.rotations("gt_Twb", r.gt_T_wb);
  check.unit_vectors("sim_point_normal", r.sim_point_normal);
  check.never_falls("log_t_ns", r.t_ns);
  check.never_falls("imu_t_ns", r.imu_t_ns);
  check.never_falls("gt_t_ns", r.gt_t_ns);
  check.never_falls("frame_t_ns", r.frame_t_ns);
  check.in_range("log_kp_octave", r.kp_octave, 0, levels);
  check.in_range("final_alive", r.final_alive, 0, 2);
  check.in_range("sim_point_id", r.sim_point_id, -1, static_cast<std::int64_t>(r.sim_point_xyz.size()));
}

}  // namespace detail

/// Checks a whole recording, meta.json apart; throws bad_file naming `directory`'s file, array, row and rule at the first
/// thing that is wrong. Linear in the size of the recording.
inline void validate(const recording& r, const std::filesystem::path& directory = {}) {
  const detail::array_checks check(directory);
  detail::check_row_counts(r, check);
  detail::check_rows(r, check, r.meta.levels);
  for (std::size_t i = 0; i < r.keyframe_count(); ++i) detail::check_keyframe_indices({r, i, r, i}, check);
}

TURBOMAP_END_NAMESPACE

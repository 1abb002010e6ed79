// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Writing a recording: whole, or built keyframe by keyframe by a SLAM system that wants its own runs replayed.

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../span.hpp"
#include "recording.hpp"

namespace turbomap {

/// Tracking's association of a keypoint with a map point.
struct point_association {
  std::int32_t keypoint = 0;    ///< keypoint index, within the keyframe
  keypoint_reference latest;    ///< the point's most recent observation in an earlier keyframe
  keypoint_reference earliest;  ///< its earliest one
  vec3<float> position{};       ///< of the point, in the world, at that moment
  bool is_new = false;          ///< created by this keyframe; latest and earliest are then its own (left) keypoint
};

/// A map point still on probation.
struct recorded_recent_point {
  keypoint_reference reference;        ///< an observation that names it
  std::int32_t first_keyframe_id = 0;  ///< the system's id of the keyframe that made it
  std::int32_t visible = 1;            ///< frames in whose view it was
  std::int32_t found = 1;              ///< frames that matched it
};

/// One keyframe as tracking hands it over. The spans are copied from; they need not outlive the call.
struct keyframe_record {
  std::int64_t t_ns = 0;                       ///< time, ns; never before that of the last keyframe
  std::int32_t id = -1;                        ///< the system's own id; -1: the keyframe index
  std::int32_t frame_id = -1;                  ///< the system's own id of the frame; -1: the keyframe index
  std::int32_t previous = -1;                  ///< keyframe index of the predecessor in time
  rigid_transform<float> T_cw;                 ///< tracking's estimate, world to (left) camera, m
  span<const keypoint> keypoints;              ///< camera 0 first, then camera 1
  span<const descriptor_bytes> descriptors;    ///< one per keypoint
  span<const std::int32_t> stereo_partner;     ///< fisheye: see recording::kp_lrmatch; may be empty
  span<const point_association> associations;  ///< of keypoints with map points
  span<const recorded_recent_point> recent;    ///< points on probation, before recent points are culled
  vec3<float> velocity{};        ///< of the body in the world, m/s; inertial systems only, as what follows
  std::array<float, 6> bias{};   ///< gyro xyz (rad/s), acceleration xyz (m/s^2)
  bool imu_initialized = false;  ///< velocity and bias are estimated
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Writes meta.json and every array that is not empty or must be there; makes the directory. A recording that was there
/// is replaced in one step (recording_files.hpp says how): whatever happens, a killed process included, read_recording
/// finds the old one or the new one. Its snapshots and times are left alone. What read_recording would refuse is not
/// written: throws bad_file naming the array or the key; also when a file cannot be written. The old recording stays then.
inline void write_recording(const std::filesystem::path& directory, const recording& r) {
  validate(r, directory);
  const std::string meta = detail::meta_text(r.meta, directory / "meta.json");
  detail::incoming_recording incoming(directory);
  visit_arrays(r, [&](const char* name, const auto& rows, recording_rows, presence must) {
    const std::string file = std::string(name) + ".npy";
    if (rows.empty() && must == presence::optional) {
      incoming.leave_out(file);
    } else {
      write_npy_rows(incoming.file(file), rows);
    }
  });
  if (!detail::replace_text_file(incoming.file("meta.json"), meta))
    throw bad_file("turbomap: " + (directory / "meta.json").string() + ": could not be written");
  incoming.commit();
}

/// Collects a recording. Hand it every keyframe in the order of insertion into local mapping, then write().
class recorder {
 public:
  /// Throws std::invalid_argument for what could not be written as meta.json.
  explicit recorder(recording_meta meta) {
    refuse([&] { detail::meta_text(meta, "recording_meta"); });
    recording_.meta = std::move(meta);
    recording_.kp_off = recording_.assoc_off = recording_.recent_off = {0};
  }

  /// Appends a keyframe and returns its index. Throws std::invalid_argument naming what is wrong: everything that write()
  /// would refuse about this keyframe (the message names the array, the row counts within the keyframe). Nothing has been
  /// appended then.
  std::int32_t add(const keyframe_record& k) {
    const std::size_t count = k.keypoints.size();
    require(k.descriptors.size() == count, "descriptors", k.descriptors.size(), "must be as many as keypoints");
    require(k.stereo_partner.empty() || k.stereo_partner.size() == count, "stereo_partner", k.stereo_partner.size(),
            "must be as many as keypoints, or none");
    const bool pair = !recording_.meta.camera2.empty();
    std::size_t left = count;
    for (std::size_t i = 0; i < count; ++i) {
      require(k.keypoints[i].camera <= (pair ? 1 : 0), "keypoint camera", int(k.keypoints[i].camera),
              "must be a camera of the recording");
      if (k.keypoints[i].camera == 1 && left == count) left = i;
      require(k.keypoints[i].camera == (i < left ? 0 : 1), "keypoint camera", int(k.keypoints[i].camera),
              "keypoints of camera 0 come before those of camera 1");
    }
    const auto index = static_cast<std::int32_t>(recording_.keyframe_count());
    if (index > 0) require(k.t_ns >= recording_.t_ns.back(), "t_ns", k.t_ns, "must not be before the last keyframe's");
    const recording next = single(k, index, pair ? static_cast<std::int32_t>(left) : -1);
    refuse([&] {
      const detail::array_checks check("keyframe " + std::to_string(index));
      detail::check_rows(next, check, recording_.meta.levels);
      detail::check_keyframe_indices({recording_, static_cast<std::size_t>(index), next, 0}, check);
    });
    append(next);
    return index;
  }

  /// One IMU sample, finite; times must not fall. Throws std::invalid_argument otherwise.
  void add_imu(std::int64_t t_ns, const imu_sample& sample) {
    recording next;
    next.imu_t_ns = {t_ns}, next.imu = {sample};
    add_timed(recording_.imu_t_ns, t_ns, "add_imu", next);
  }
  /// One ground truth pose of the body, finite with a unit quaternion; times must not fall. Throws std::invalid_argument
  /// otherwise.
  void add_ground_truth(std::int64_t t_ns, const stamped_body_pose& T_wb) {
    recording next;
    next.gt_t_ns = {t_ns}, next.gt_T_wb = {T_wb};
    add_timed(recording_.gt_t_ns, t_ns, "add_ground_truth", next);
  }

  /// What has been collected, to add to (final poses, events, truth) or to take: the next keyframe begins a new recording then.
  recording& data() { return recording_; }

  /// Sets the counts in meta, validates and writes (see write_recording).
  void write(const std::filesystem::path& directory) {
    recording_.meta.keyframes_inserted = static_cast<int>(recording_.keyframe_count());
    write_recording(directory, recording_);
  }

 private:
  /// What a reader would throw about a file is what the caller's argument is refused for.
  template <class Check>
  static void refuse(const Check& check) {
    try {
      check();
    } catch (const bad_file& error) {
      throw std::invalid_argument(error.what());
    }
  }
  void add_timed(const std::vector<std::int64_t>& times, std::int64_t t_ns, const char* what, const recording& next) {
    require(times.empty() || t_ns >= times.back(), "t_ns", t_ns, "must not be before the last one's");
    refuse([&] { detail::check_rows(next, detail::array_checks(what), recording_.meta.levels); });
    append(next);
  }

  /// A recording of this keyframe alone.
  recording single(const keyframe_record& k, std::int32_t index, std::int32_t nleft) const {
    recording n;
    n.kf_mnid = {k.id < 0 ? index : k.id}, n.frame_id = {k.frame_id < 0 ? index : k.frame_id};
    n.prev_kf = {k.previous}, n.t_ns = {k.t_ns}, n.T_cw = {k.T_cw}, n.nleft = {nleft};
    for (const keypoint& p : k.keypoints) {
      n.kp_xy.push_back({p.x, p.y}), n.kp_octave.push_back(p.octave), n.kp_angle.push_back(p.angle);
      n.kp_uright.push_back(p.u_right), n.kp_depth.push_back(p.depth), n.kp_node.push_back(p.group);
    }
    n.kp_desc.assign(k.descriptors.begin(), k.descriptors.end());
    n.kp_lrmatch.assign(k.stereo_partner.begin(), k.stereo_partner.end());
    n.kp_lrmatch.resize(k.keypoints.size(), -1);
    for (const point_association& a : k.associations) {
      n.assoc_kp.push_back(a.keypoint), n.assoc_ref.push_back(a.latest), n.assoc_ref2.push_back(a.earliest);
      n.assoc_new.push_back(a.is_new), n.assoc_pos.push_back(a.position);
    }
    for (const recorded_recent_point& p : k.recent) {
      n.recent_ref.push_back(p.reference), n.recent_firstkf_mnid.push_back(p.first_keyframe_id);
      n.recent_visible.push_back(p.visible), n.recent_found.push_back(p.found);
    }
    n.kp_off = {0, static_cast<std::int64_t>(n.kp_xy.size())};
    n.assoc_off = {0, static_cast<std::int64_t>(n.assoc_kp.size())};
    n.recent_off = {0, static_cast<std::int64_t>(n.recent_ref.size())};
    if (recording_.meta.sensor == "inertial")
      n.velocity = {k.velocity}, n.bias = {k.bias}, n.bimu = {k.imu_initialized};
    return n;
  }

  /// Appends every array of `more`: first room for all of them, so that running out of memory changes nothing.
  void append(const recording& more) {
    std::vector<const void*> sources;
    visit_arrays(more, [&](const char*, const auto& rows, recording_rows, presence) { sources.push_back(&rows); });
    for (const bool room_only : {true, false}) {
      std::size_t at = 0;
      visit_arrays(recording_, [&](const char*, auto& rows, recording_rows what, presence) {
        const auto& source = *static_cast<const std::remove_reference_t<decltype(rows)>*>(sources[at++]);
        if (room_only) {
          // One more: of offsets that were taken, the first one is missing.
          if (rows.capacity() < rows.size() + source.size() + 1) rows.reserve(2 * rows.size() + source.size() + 1);
        } else if (what != recording_rows::keyframe_offsets) {
          rows.insert(rows.end(), source.begin(), source.end());
        } else if constexpr (std::is_same_v<decltype(rows), std::vector<std::int64_t>&>) {
          if (rows.empty()) rows.push_back(0);
          if (!source.empty()) rows.push_back(rows.back() + source.back());
        }
      });
    }
  }

  recording recording_;
};

TURBOMAP_END_NAMESPACE

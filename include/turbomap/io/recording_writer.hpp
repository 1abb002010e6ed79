// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Writing a recording: whole, or built keyframe by keyframe by a SLAM system that wants its own runs replayed.

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../span.hpp"
#include "recording.hpp"

namespace turbomap {

/// Tracking's association of a keypoint with a map point.
struct point_association {
  std::int32_t keypoint = 0;
  keypoint_reference latest, earliest;  ///< observations of the point in earlier keyframes
  vec3<float> position{};               ///< of the point, in the world, at that moment
  bool is_new = false;  ///< created by this keyframe; latest and earliest are then its own (left) keypoint
};

/// A map point still on probation.
struct recorded_recent_point {
  keypoint_reference reference;
  std::int32_t first_keyframe_id = 0, visible = 1, found = 1;
};

/// One keyframe as tracking hands it over. The spans are copied from; they need not outlive the call.
struct keyframe_record {
  std::int64_t t_ns = 0;
  std::int32_t id = -1, frame_id = -1;  ///< the system's own ids; -1: the keyframe index
  std::int32_t previous = -1;           ///< keyframe index of the predecessor in time
  rigid_transform<float> T_cw;
  span<const keypoint> keypoints;  ///< camera 0 first, then camera 1
  span<const descriptor_bytes> descriptors;
  span<const std::int32_t> stereo_partner;  ///< fisheye: see recording::kp_lrmatch; may be empty
  span<const point_association> associations;
  span<const recorded_recent_point> recent;
  vec3<float> velocity{};  ///< inertial systems only, as what follows
  std::array<float, 6> bias{};
  bool imu_initialized = false;
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Writes meta.json and every array that is not empty or must be there; makes the directory. Files of a recording that
/// was there before and that this one does not have are removed, its snapshots and times are left alone. Validates
/// first: throws bad_file naming the array and nothing is written; also when a file cannot be written.
inline void write_recording(const std::filesystem::path& directory, const recording& r) {
  validate(r, directory);
  std::error_code failed;
  std::filesystem::create_directories(directory, failed);
  if (failed) throw bad_file("turbomap: " + directory.string() + ": cannot be made: " + failed.message());
  visit_arrays(r, [&](const char* name, const auto& rows, recording_rows, presence must) {
    const auto file = directory / (std::string(name) + ".npy");
    if (rows.empty() && must == presence::optional) {
      std::filesystem::remove(file, failed);
    } else {
      write_npy_rows(file, rows);
    }
  });
  write_recording_meta(directory / "meta.json", r.meta);
}

/// Collects a recording. Hand it every keyframe in the order of insertion into local mapping, then write().
class recorder {
 public:
  explicit recorder(recording_meta meta) {
    recording_.meta = std::move(meta);
    recording_.kp_off = recording_.assoc_off = recording_.recent_off = {0};
  }

  /// Appends a keyframe and returns its index. Throws std::invalid_argument naming what is wrong; then nothing has been
  /// appended. References are checked in write().
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
    for (const auto& a : k.associations)
      require(a.keypoint >= 0 && static_cast<std::size_t>(a.keypoint) < count, "association keypoint", a.keypoint,
              "must be a keypoint of the keyframe");
    const auto index = static_cast<std::int32_t>(recording_.keyframe_count());
    recording next = tail(k, index, pair ? static_cast<std::int32_t>(left) : -1);
    append(next);
    return index;
  }

  /// One IMU sample; times must not fall.
  void add_imu(std::int64_t t_ns, const imu_sample& sample) {
    recording_.imu_t_ns.push_back(t_ns);
    recording_.imu.push_back(sample);
  }
  /// One ground truth pose of the body; times must not fall.
  void add_ground_truth(std::int64_t t_ns, const stamped_body_pose& T_wb) {
    recording_.gt_t_ns.push_back(t_ns);
    recording_.gt_T_wb.push_back(T_wb);
  }

  /// What has been collected, to add to (final poses, events, truth) or to take.
  recording& data() { return recording_; }

  /// Sets the counts in meta, validates and writes (see write_recording).
  void write(const std::filesystem::path& directory) {
    recording_.meta.keyframes_inserted = static_cast<int>(recording_.keyframe_count());
    write_recording(directory, recording_);
  }

 private:
  recording tail(const keyframe_record& k, std::int32_t index, std::int32_t nleft) const {
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
    n.kp_off = {recording_.kp_off.back() + static_cast<std::int64_t>(n.kp_xy.size())};
    n.assoc_off = {recording_.assoc_off.back() + static_cast<std::int64_t>(n.assoc_kp.size())};
    n.recent_off = {recording_.recent_off.back() + static_cast<std::int64_t>(n.recent_ref.size())};
    if (recording_.meta.sensor == "inertial")
      n.velocity = {k.velocity}, n.bias = {k.bias}, n.bimu = {k.imu_initialized};
    return n;
  }

  /// Appends every array of `more`: first room for all of them, so that running out of memory changes nothing.
  void append(recording& more) {
    std::vector<const void*> sources;
    visit_arrays(more, [&](const char*, auto& rows, recording_rows, presence) { sources.push_back(&rows); });
    for (const bool room_only : {true, false}) {
      std::size_t at = 0;
      visit_arrays(recording_, [&](const char*, auto& rows, recording_rows, presence) {
        const auto& source = *static_cast<const std::remove_reference_t<decltype(rows)>*>(sources[at++]);
        if (room_only) {
          if (rows.capacity() < rows.size() + source.size()) rows.reserve(2 * rows.size() + source.size());
        } else {
          rows.insert(rows.end(), source.begin(), source.end());
        }
      });
    }
  }

  recording recording_;
};

TURBOMAP_END_NAMESPACE

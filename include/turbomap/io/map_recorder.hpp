// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Records a running system: from its own map, through the map_traits that it has already. One call per keyframe, before
/// local_mapper::process(), in the unit that maps; turbomap-replay then replays what local mapping was given.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "../map/map_traits.hpp"
#include "../math/linear.hpp"
#include "../store/gather.hpp"
#include "recording_writer.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Collects a recording of a map with 256-bit descriptors. Memory: that of the recording. Not synchronised. States of an IMU and the
/// stereo partners of fisheye keypoints are not among what it reads: for those fill a keyframe_record and a recorder.
template <class Map>
class map_recorder {
 public:
  using traits = map_traits<Map>;                       ///< how the map is read
  using keyframe = typename traits::keyframe;           ///< the name of a keyframe
  using point = typename traits::point;                 ///< the name of a map point
  using descriptor = typename traits::descriptor;       ///< of keypoints
  using camera = typename traits::camera;               ///< of the rig
  using data_type = keyframe_data<descriptor, camera>;  ///< a keyframe as flat arrays

  /// Throws std::invalid_argument for what could not be written as meta.json, and for the sensor `inertial`.
  explicit map_recorder(recording_meta meta) : recorder_(std::move(meta)) {
    static_assert(require_map_traits<Map>());
    static_assert(std::is_same_v<typename descriptor::element, std::uint8_t> && descriptor::elements == 32,
                  "turbomap: recordings hold descriptors of 256 bits");
    require(recorder_.data().meta.sensor != "inertial", "meta.sensor", "inertial",
            "map_recorder does not read velocities and biases: use a recorder");
  }

  /// Appends a keyframe that is in the map with the associations that tracking made, and not processed yet. The caller holds the
  /// map's guard. A point that no keyframe before saw counts as made by this one.
  /// \param data  the keyframe as it goes to local_mapper::insert(): arrays, or an object with keyframe_traits; keypoints of
  ///              the first camera come first
  /// \param recent  points on probation, if the recording is to tell what tracking counted of them. Their keyframes are named by the
  ///                 index in the recording, first_keyframe_id too: the id of a recorded keyframe is its index
  /// \return its index. Throws what recorder::add() throws; nothing has been appended then. O(observations of its points)
  template <class Data>
  std::int32_t add(const Map& map, const keyframe& k, const Data& data, std::int64_t t_ns,
                   span<const recorded_recent_point> recent = {}) {
    const data_type flat = flat_data(data);
    const auto count = static_cast<std::size_t>(flat.keypoint_count);
    require(count == keypoint_count_of(map, k), "data", count, "must have the keypoints of the keyframe in the map");
    require(count == 0 || flat.keypoints != nullptr, "data.keypoints", "null", "there are keypoints to read");
    require(count == 0 || flat.descriptors != nullptr, "data.descriptors", "null", "there are descriptors to read");
    descriptors_.resize(count);
    for (std::size_t i = 0; i < count; ++i) std::copy_n(flat.descriptors + i * 32, 32, descriptors_[i].begin());
    associations_.clear();
    const auto self = static_cast<std::int32_t>(recorder_.data().keyframe_count());
    if (self == 0) indices_.clear();  // what was recorded may have been taken
    for (std::size_t i = 0; i < count; ++i) {
      const point p = traits::point_at(map, k, i);
      if (!(p == point{}) && traits::alive(map, p)) associations_.push_back(association(map, k, p, i, self));
    }
    keyframe_record record;
    record.t_ns = t_ns, record.previous = self - 1;
    record.T_cw = cast<float>(pose_of(map, k));
    record.keypoints = {flat.keypoints, count};
    record.descriptors = descriptors_;
    record.associations = associations_, record.recent = recent;
    const std::uint64_t id = traits::id(map, k);
    require(indices_.emplace(id, self).second, "keyframe id", id, "has been recorded already");
    try {
      return recorder_.add(record);
    } catch (...) {
      indices_.erase(id);
      throw;
    }
  }

  /// To add IMU samples and ground truth, and what has been collected, to take too: the next keyframe begins a new recording then,
  /// which names none of those taken.
  recorder& get() { return recorder_; }
  /// Validates and writes: write_recording().
  void write(const std::filesystem::path& directory) { recorder_.write(directory); }

 private:
  data_type flat_data(const data_type& data) { return data; }
  template <class KeyFrame>
  data_type flat_data(const KeyFrame& object) {
    return gather(object, buffer_);
  }
  point_association association(const Map& map, const keyframe& k, const point& p, std::size_t keypoint,
                                std::int32_t self) const {
    point_association a;
    a.keypoint = static_cast<std::int32_t>(keypoint);
    const auto& x = traits::position(map, p);
    a.position = {static_cast<float>(x.x), static_cast<float>(x.y), static_cast<float>(x.z)};
    keypoint_reference latest{-1, -1}, earliest{-1, -1};
    std::int32_t first = a.keypoint;  // of this keyframe
    traits::for_each_observation(map, p, [&](const keyframe& observer, std::size_t i) {
      const auto at = static_cast<std::int32_t>(i);
      if (observer == k) {
        first = std::min(first, at);
        return;
      }
      const auto known = indices_.find(traits::id(map, observer));
      if (known == indices_.end()) return;  // not recorded
      const keypoint_reference seen{known->second, at};
      if (latest.keyframe < seen.keyframe || (latest.keyframe == seen.keyframe && at < latest.keypoint)) latest = seen;
      if (earliest.keyframe < 0 || seen.keyframe < earliest.keyframe ||
          (seen.keyframe == earliest.keyframe && at < earliest.keypoint))
        earliest = seen;
    });
    a.is_new = latest.keyframe < 0;
    a.latest = a.is_new ? keypoint_reference{self, first} : latest;
    a.earliest = a.is_new ? a.latest : earliest;
    return a;
  }

  recorder recorder_;
  std::unordered_map<std::uint64_t, std::int32_t> indices_;  ///< by id of the keyframe
  keyframe_buffer<descriptor, camera> buffer_;
  std::vector<descriptor_bytes> descriptors_;
  std::vector<point_association> associations_;
};

TURBOMAP_END_NAMESPACE

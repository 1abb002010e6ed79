// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Keyframes and points as systems in the field have them: objects behind shared_ptr, each with its own mutex, whose getters
/// lock and return copies. The observations of a point are a tree of weak_ptr. A dead object is flagged; whoever holds it may
/// still ask it.

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include <turbomap/types.hpp>

#include "object_imu.hpp"

namespace turbomap_program {

class object_keyframe;
class object_point;
using keyframe_ptr = std::shared_ptr<object_keyframe>;
using point_ptr = std::shared_ptr<object_point>;
using object_lock = std::lock_guard<std::mutex>;

class object_keyframe {
 public:
  object_keyframe(std::uint64_t id, std::vector<turbomap::keypoint> keypoints,
                  const turbomap::rigid_transform<double>& T_cw, double time_s)
      : id(id), time_s(time_s), keypoints(std::move(keypoints)), T_cw_(T_cw), points_(this->keypoints.size()) {}

  const std::uint64_t id;
  const double time_s;
  const std::vector<turbomap::keypoint> keypoints;
  object_imu imu;  ///< stays empty where the map is visual

  bool bad() const { return object_lock{mutex_}, bad_; }
  turbomap::rigid_transform<double> pose() const { return object_lock{mutex_}, T_cw_; }
  point_ptr point(std::size_t keypoint) const { return object_lock{mutex_}, points_.at(keypoint); }
  keyframe_ptr previous() const { return object_lock{mutex_}, previous_.lock(); }
  keyframe_ptr next() const { return object_lock{mutex_}, next_.lock(); }

  void set_bad() { object_lock{mutex_}, bad_ = true; }
  void set_pose(const turbomap::rigid_transform<double>& T_cw) { object_lock{mutex_}, T_cw_ = T_cw; }
  void set_point(std::size_t keypoint, const point_ptr& p) { object_lock{mutex_}, points_.at(keypoint) = p; }
  void set_previous(const keyframe_ptr& k) { object_lock{mutex_}, previous_ = k; }
  void set_next(const keyframe_ptr& k) { object_lock{mutex_}, next_ = k; }

 private:
  mutable std::mutex mutex_;
  bool bad_ = false;
  turbomap::rigid_transform<double> T_cw_;
  std::vector<point_ptr> points_;  ///< by keypoint
  std::weak_ptr<object_keyframe> previous_, next_;
};

class object_point {
 public:
  using descriptor_type = std::array<std::uint8_t, 32>;
  struct appearance_type {
    turbomap::vec3<float> normal{};
    float min_distance = 0, max_distance = 0;
  };
  /// By which keypoints of a keyframe, one per camera of a rig of two, and as how many-th observation of the point.
  struct views {
    std::array<std::int64_t, 2> keypoint{-1, -1};
    std::array<std::uint64_t, 2> number{};
  };
  using observations_type =
      std::map<std::weak_ptr<object_keyframe>, views, std::owner_less<std::weak_ptr<object_keyframe>>>;

  object_point(std::uint64_t id, const turbomap::vec3<double>& position, const keyframe_ptr& reference)
      : id(id), position_(position), reference_(reference) {}

  const std::uint64_t id;

  bool bad() const { return object_lock{mutex_}, bad_; }
  point_ptr replacement() const { return object_lock{mutex_}, replacement_; }
  turbomap::vec3<double> position() const { return object_lock{mutex_}, position_; }
  turbomap::point_covariance covariance() const { return object_lock{mutex_}, covariance_; }
  appearance_type appearance() const { return object_lock{mutex_}, appearance_; }
  /// Not a copy, as the library wants an address: it is valid while the map's guard is held.
  const std::uint8_t* descriptor() const { return descriptor_.data(); }
  keyframe_ptr reference() const { return object_lock{mutex_}, reference_.lock(); }
  observations_type observations() const { return object_lock{mutex_}, observations_; }
  bool seen_by(const keyframe_ptr& k) const { return object_lock{mutex_}, observations_.count(k) != 0; }
  /// A keypoint with u_right is two.
  int measurements() const { return object_lock{mutex_}, measurements_; }
  float found_ratio() const { return object_lock{mutex_}, static_cast<float>(found_) / static_cast<float>(visible_); }

  void set_position(const turbomap::vec3<double>& x) { object_lock{mutex_}, position_ = x; }
  void set_covariance(const turbomap::point_covariance& c) { object_lock{mutex_}, covariance_ = c; }
  void set_appearance(const appearance_type& a, const std::uint8_t* descriptor) {
    const object_lock lock(mutex_);
    appearance_ = a;
    for (std::uint8_t& byte : descriptor_) byte = *descriptor++;
  }
  void set_reference(const keyframe_ptr& k) { object_lock{mutex_}, reference_ = k; }
  void set_tracked(std::uint32_t visible, std::uint32_t found) {
    object_lock{mutex_}, visible_ = visible, found_ = found;
  }
  void add_observation(const keyframe_ptr& k, std::size_t keypoint) {
    const object_lock lock(mutex_);
    views& v = observations_[k];
    const std::size_t camera = v.keypoint[0] < 0 ? 0 : 1;
    v.keypoint[camera] = static_cast<std::int64_t>(keypoint);
    v.number[camera] = next_number_++;
    measurements_ += k->keypoints[keypoint].u_right >= 0 ? 2 : 1;
  }
  void erase_observation(const keyframe_ptr& k, std::size_t keypoint) {
    const object_lock lock(mutex_);
    const auto at = observations_.find(k);
    if (at == observations_.end()) return;
    for (std::int64_t& view : at->second.keypoint)
      if (view == static_cast<std::int64_t>(keypoint)) {
        view = -1;
        measurements_ -= k->keypoints[keypoint].u_right >= 0 ? 2 : 1;
      }
    if (at->second.keypoint[0] < 0 && at->second.keypoint[1] < 0) observations_.erase(at);
  }
  /// The counts of tracking go to the replacement.
  void retire(const point_ptr& replacement) {
    std::uint32_t visible, found;
    {
      const object_lock lock(mutex_);
      bad_ = true, replacement_ = replacement;
      visible = visible_, found = found_;
    }
    if (replacement) replacement->add_tracked(visible, found);
  }

 private:
  void add_tracked(std::uint32_t visible, std::uint32_t found) {
    object_lock{mutex_}, visible_ += visible, found_ += found;
  }

  mutable std::mutex mutex_;
  bool bad_ = false;
  point_ptr replacement_;
  turbomap::vec3<double> position_;
  turbomap::point_covariance covariance_{};
  appearance_type appearance_;
  descriptor_type descriptor_{};
  std::weak_ptr<object_keyframe> reference_;
  observations_type observations_;
  std::uint64_t next_number_ = 0;
  int measurements_ = 0;
  std::uint32_t visible_ = 1, found_ = 1;
};

}  // namespace turbomap_program

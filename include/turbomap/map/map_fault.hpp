// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What can be wrong with a map, as data and as an exception; and what becomes of a fault that a stage meets: it ends the work,
/// or is noted and passed over.

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "../error.hpp"
#include "../plain_vector.hpp"

namespace turbomap {

/// What is wrong with a map.
enum class map_fault : std::uint8_t {
  slot_of_dead_point,        ///< a slot holds a point that is not alive
  slot_without_observation,  ///< a slot holds a point that does not list this keypoint
  observation_without_slot,  ///< an observation whose slot is empty or holds another point
  observer_not_alive,        ///< an observation by a keyframe that is not in the map
  keypoint_out_of_range,     ///< an observation by a keypoint that the keyframe does not have
  seen_twice_by_camera,      ///< two keypoints of one camera of a keyframe see the point
  octave_out_of_range,       ///< a keypoint's octave is beyond the counts of the point
  wrong_octave_counts,       ///< the counts differ from recount()
  bad_pose,                  ///< a pose that is not finite, or whose quaternion is not of unit length: see is_pose()
  position_not_finite,       ///< a position that is not finite
  bad_inertial_state,        ///< a velocity or a bias of the IMU that is not finite
  bad_motion,                ///< a preintegration that is not finite, or of other keyframes: its duration is not theirs
  no_descriptor              ///< a point without descriptor, or with one of too few elements
};

/// The words of a fault, e.g. for a log.
inline const char* to_string(map_fault fault) {
  switch (fault) {
    case map_fault::slot_of_dead_point:
      return "a slot holds a point that is not alive";
    case map_fault::slot_without_observation:
      return "a slot holds a point that does not list the keypoint";
    case map_fault::observation_without_slot:
      return "an observation whose slot does not hold the point";
    case map_fault::observer_not_alive:
      return "an observation by a keyframe that is not alive";
    case map_fault::keypoint_out_of_range:
      return "an observation by a keypoint that the keyframe does not have";
    case map_fault::seen_twice_by_camera:
      return "a camera sees the point by two keypoints";
    case map_fault::octave_out_of_range:
      return "an octave beyond the counts of the point";
    case map_fault::wrong_octave_counts:
      return "the counts by octave differ from the observations";
    case map_fault::bad_pose:
      return "a pose that is not finite or not of unit length";
    case map_fault::position_not_finite:
      return "a position that is not finite";
    case map_fault::bad_inertial_state:
      return "a velocity or a bias of the IMU that is not finite";
    case map_fault::bad_motion:
      return "a preintegration that is not finite, asks for more force than there is, or does not last as long as its "
             "keyframes are apart";
    case map_fault::no_descriptor:
      return "a point without descriptor, or with one of too few elements";
  }
  return "";
}

/// One fault, with the ids of keyframe and point and the keypoint; 0 what it is not about.
struct map_violation {
  map_fault fault;         ///< what is wrong
  std::uint64_t keyframe;  ///< id
  std::uint64_t point;     ///< id
  std::size_t keypoint;    ///< of the keyframe
};

/// The fault in words, with keyframe, keypoint and point.
inline std::string to_string(const map_violation& v) {
  std::string text = to_string(v.fault);
  text.append(": keyframe ").append(printed(v.keyframe)).append(", keypoint ").append(printed(v.keypoint));
  return text.append(", point ").append(printed(v.point));
}

/// A commit was refused because the part of the map that it concerns contradicts itself, or a stage because it cannot use what
/// it read; the map is unchanged.
struct inconsistent_map : std::invalid_argument {
  /// What it says is to_string() of the violation.
  explicit inconsistent_map(const map_violation& v)
      : std::invalid_argument(std::string("turbomap: map: ").append(to_string(v))), violation(v) {}
  map_violation violation;  ///< why it was refused
};

/// Faults, each once, in the order in which they were noted first. One keyframe that died unreported may make thousands.
class fault_list {
 public:
  /// True when nothing was noted.
  bool empty() const { return faults_.empty(); }
  /// Faults that differ.
  std::size_t size() const { return faults_.size(); }
  /// The first one.
  const map_violation* begin() const { return faults_.begin(); }
  /// Behind the last one.
  const map_violation* end() const { return faults_.end(); }
  /// \param i  below size(); not checked
  const map_violation& operator[](std::size_t i) const { return faults_[i]; }

  /// Appends it unless it is there. Amortised O(1). Throws std::bad_alloc.
  [[gnu::cold]] void note(const map_violation& v) {
    if (2 * (size() + 1) > places_.size()) grow();
    std::uint32_t& place = places_[find(v)];
    if (place != 0) return;
    faults_.push_back(v);
    place = static_cast<std::uint32_t>(size());
  }

 private:
  /// The cell of a fault, or the empty one that it would have.
  std::size_t find(const map_violation& v) const {
    constexpr std::uint64_t mix = 0x9E3779B97F4A7C15u;
    std::uint64_t hash = static_cast<std::uint64_t>(v.fault);
    for (const std::uint64_t part : {v.keyframe, v.point, static_cast<std::uint64_t>(v.keypoint)})
      hash = (hash ^ hash >> 32 ^ part) * mix;
    const std::size_t mask = places_.size() - 1;
    std::size_t at = static_cast<std::size_t>(hash >> 32) & mask;
    while (places_[at] != 0 && !same(faults_[places_[at] - 1], v)) at = (at + 1) & mask;
    return at;
  }
  static bool same(const map_violation& a, const map_violation& b) {
    return a.fault == b.fault && a.keyframe == b.keyframe && a.point == b.point && a.keypoint == b.keypoint;
  }
  void grow() {
    std::size_t cells = 64;
    while (cells < 4 * (size() + 1)) cells *= 2;
    places_.assign(cells, 0);
    for (std::size_t i = 0; i < size(); ++i) places_[find(faults_[i])] = static_cast<std::uint32_t>(i + 1);
  }

  plain_vector<map_violation> faults_;
  plain_vector<std::uint32_t> places_;  ///< in faults_, from 1 on; 0: none. An open-addressing table
};

/// What becomes of the faults that a stage meets: the first ends its work (default), or all of them are noted, and the stage
/// does its work without the parts of the map that they concern.
class fault_sink {
 public:
  /// Throws inconsistent_map at the first fault.
  fault_sink() = default;
  /// Appends to the list, each fault once.
  explicit fault_sink(fault_list& noted) : noted_(&noted) {}

  /// \throws inconsistent_map  unless there is a list; std::bad_alloc
  [[gnu::cold]] void operator()(const map_violation& v) const {
    if (noted_ == nullptr) throw inconsistent_map(v);
    noted_->note(v);
  }
  /// Whether it throws.
  bool throws() const { return noted_ == nullptr; }

 private:
  fault_list* noted_ = nullptr;
};

}  // namespace turbomap

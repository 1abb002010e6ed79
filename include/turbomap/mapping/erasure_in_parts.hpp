// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A keyframe with thousands of points leaves the user's map in parts, between which others may take the guard. After each part
/// the map is sound: the keyframe is alive and sees fewer points. Whatever others do to it in between is met by the next part,
/// which looks again.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_fault.hpp"
#include "../map/map_traits.hpp"
#include "../map/validate.hpp"
#include "../plain_vector.hpp"
#include "look_again.hpp"

namespace turbomap {

/// What a part of an erasure came to.
enum class erasure_part : std::uint8_t {
  some,    ///< more keypoints may see points
  last,    ///< no keypoint sees a point
  refused  ///< slots and points contradict each other; nothing was changed
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Takes the observations of one keyframe away, and knows the keyframe until end(): what an exception left is gone on with.
template <class Map>
class erasure_in_parts {
 public:
  using traits = map_traits<Map>;              ///< how the map is read and changed
  using keyframe = typename traits::keyframe;  ///< names a keyframe

  /// A keyframe is to be erased of which nothing is taken away yet. \param id  of it
  void begin(const keyframe& k, std::uint64_t id) { keyframe_ = k, id_ = id, next_ = 0, active_ = true; }
  /// It is erased, or stays.
  void end() { keyframe_ = keyframe{}, active_ = false; }
  /// Whether there is one, begun and not ended.
  bool active() const { return active_; }
  /// Whether that is this one.
  bool is_of(const keyframe& k) const { return active_ && keyframe_ == k; }
  /// The one; only where active().
  const keyframe& of() const { return keyframe_; }
  /// Its id.
  std::uint64_t id() const { return id_; }

  /// Takes away observations of its next points, `most` at most. The last part looks at all keypoints: what others added behind it
  /// goes too. The caller holds the guard, and has looked whether the keyframe is alive. One that is refused has ended.
  /// \param touched  a list: points that lost a view are appended, some twice
  /// \throws inconsistent_map  in place of `refused`, as fault_sink says: it has ended then too
  template <class List>
  erasure_part operator()(Map& map, std::size_t most, int fewest, List& touched, fault_sink faults) {
    look_at_slots(map, keyframe_);  // all: other keypoints may see the same points by now
    const std::size_t keypoints = keypoint_count_of(map, keyframe_);
    std::size_t end = next_, points = 0;
    for (; end < keypoints && points < most; ++end)
      points += traits::point_at(map, keyframe_, end) == typename traits::point{} ? std::size_t{0} : std::size_t{1};
    const bool last = end == keypoints;
    const std::size_t begin = last ? 0 : next_;
    look_at_points(map, keyframe_, fewest, begin, end);
    try {
      active_ = require_removable(map, keyframe_, fewest, faults, begin, end);
    } catch (const inconsistent_map&) {
      active_ = false;
      throw;
    }
    if (!active_) return erasure_part::refused;
    make_room(touched, touched.size() + (end - begin));
    fade_keypoints(map, keyframe_, begin, end, fewest, &touched);
    next_ = end;
    return last ? erasure_part::last : erasure_part::some;
  }

 private:
  keyframe keyframe_{};
  std::uint64_t id_ = 0;
  std::size_t next_ = 0;  ///< keypoint
  bool active_ = false;
};

TURBOMAP_END_NAMESPACE

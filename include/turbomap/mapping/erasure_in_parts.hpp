// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// To erase a keyframe with thousands of points takes long, and the guard of the user's map must not be held for that long. So its
/// observations are taken away in parts, and others may take the guard between two of them. After each part the map is sound: the
/// keyframe is alive and sees fewer points. Each part reads the keyframe again, because others may have changed it.

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

/// Takes the observations of one keyframe away. It remembers the keyframe until end(), so that after an exception the next call
/// goes on with it.
template <class Map>
class erasure_in_parts {
 public:
  using traits = map_traits<Map>;              ///< how the map is read and changed
  using keyframe = typename traits::keyframe;  ///< names a keyframe

  /// Begins with a keyframe; nothing is taken away from it yet. \param id  the keyframe's
  void begin(const keyframe& k, std::uint64_t id) { keyframe_ = k, id_ = id, next_ = 0, active_ = true; }
  /// Forgets the keyframe: it was erased, or stays.
  void end() { keyframe_ = keyframe{}, active_ = false; }
  /// Whether a keyframe was begun and not ended.
  bool active() const { return active_; }
  /// Whether this keyframe was begun and not ended.
  bool is_of(const keyframe& k) const { return active_ && keyframe_ == k; }
  /// The keyframe that was begun; only where active().
  const keyframe& of() const { return keyframe_; }
  /// The id of that keyframe.
  std::uint64_t id() const { return id_; }

  /// Takes away the observations of the next `most` points. The last part goes over all keypoints once more, so that what others
  /// added in slots that were empty already goes too. The caller holds the guard and has seen that the keyframe is alive. After
  /// `refused` the erasure has ended.
  /// \param touched  a list: points that lost a view are appended, some twice
  /// \throws inconsistent_map  in place of `refused`, where `faults` has no list; the erasure has ended then too
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
  std::size_t next_ = 0;  ///< the first keypoint that no part has taken
  bool active_ = false;
};

TURBOMAP_END_NAMESPACE

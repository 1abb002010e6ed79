// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The keyframes of a map_mirror, as they were last read: names, poses, keypoints and slots. Each has a place, a dense number that
/// it keeps while it lives; a table leads from the user's id to it. Nothing here asks the user's map.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../map/simple_map/map_ids.hpp"
#include "../plain_vector.hpp"
#include "../types.hpp"
#include "id_numbers.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Storage by place. Place 0 stands for whatever is not alive.
template <class Map>
class mirror_keyframes {
 public:
  using user_keyframe = typename map_traits<Map>::keyframe;  ///< what the user calls a keyframe
  static constexpr std::int32_t gone = 0;                    ///< the place of what is not alive

  /// What is kept of a keyframe.
  struct entry {
    user_keyframe name{};              ///< what the user calls it
    std::uint64_t id = 0;              ///< by the user's map
    std::uint8_t read = 0;             ///< slots and pose are as they were last seen; 0: to be read anew
    std::uint8_t pose_read = 0;        ///< the same of the pose alone
    bool has_keypoints = false;        ///< they never change
    plain_vector<keypoint> keypoints;  ///< with slots
    plain_vector<map_point_id> slots;  ///< [keypoint] its point
    rigid_transform<double> T_cw;      ///< the pose
  };

  /// None. `gone` has an id that no store has: a list that still names a dead keyframe must not lead to another one's.
  mirror_keyframes() {
    take(user_keyframe{}, static_cast<std::uint64_t>(-1)), places_.retire(gone);
    entries_[gone].has_keypoints = true;  // none
  }

  /// Places that were ever taken, `gone` too.
  std::size_t size() const { return entries_.size(); }
  /// @{
  /// What is kept in a place (not checked).
  entry& operator[](std::size_t place) { return entries_[place]; }
  const entry& operator[](std::size_t place) const { return entries_[place]; }
  /// @}
  /// Whether the place is named by a keyframe that still has it.
  bool known(map_keyframe_id k) const { return k.index > 0 && places_.known(k.index, k.generation); }
  /// Whether what has a place is alive.
  bool alive(std::int32_t place) const { return places_.alive(place); }
  /// Who has a place.
  map_keyframe_id at(std::int32_t place) const { return {place, places_.generation(place)}; }
  /// The place of an id; id_numbers::none: it has none.
  std::int32_t find(std::uint64_t id) const { return numbers_.find(id); }

  /// A place for a keyframe of which nothing is read yet. Throws std::bad_alloc, unchanged.
  std::int32_t take(const user_keyframe& name, std::uint64_t id) {
    if (entries_.capacity() == entries_.size()) entries_.reserve(2 * entries_.size() + 16);
    make_room(lost_, entries_.size() + 1);  // for retire()
    numbers_.make_room();
    const std::int32_t k = places_.take();  // the last step that may throw
    if (static_cast<std::size_t>(k) == entries_.size()) entries_.emplace_back();
    auto& taken = entries_[static_cast<std::size_t>(k)];
    taken = {};
    taken.name = name, taken.id = id;
    if (!(name == user_keyframe{})) numbers_.set(id, k);
    return k;
  }
  /// What has the place is no longer alive; its name stays until drop_names(). The place stays taken till give_back(), or clear():
  /// lists that are to be read anew name it yet.
  void retire(std::size_t place) {
    auto& lost = entries_[place];
    numbers_.erase(lost.id, static_cast<std::int32_t>(place));
    places_.retire(static_cast<std::int32_t>(place));
    free_lists(lost);
    lost.has_keypoints = true;  // none
    lost.read = 0;
    lost_.push_back(static_cast<std::int32_t>(place));
  }
  /// The place that was retired last may be taken again.
  void give_back(std::int32_t place) {
    lost_.pop_back();
    places_.give_back(place);
  }
  /// Names of what is no longer alive are let go.
  void drop_names() {
    for (std::size_t k = 1; k < entries_.size(); ++k)
      if (!places_.alive(static_cast<std::int32_t>(k))) entries_[k].name = user_keyframe{};
  }
  /// None, and no name is kept.
  void clear() {
    for (std::size_t k = 1; k < entries_.size(); ++k) {
      entries_[k].name = user_keyframe{};
      if (!places_.alive(static_cast<std::int32_t>(k))) continue;
      numbers_.erase(entries_[k].id, static_cast<std::int32_t>(k));
      free_lists(entries_[k]);
      places_.give_back(static_cast<std::int32_t>(k));
    }
    for (const std::int32_t k : lost_) places_.give_back(k);
    lost_.clear();
  }

 private:
  static void free_lists(entry& e) {
    plain_vector<map_point_id>().swap(e.slots);
    plain_vector<keypoint>().swap(e.keypoints);
  }

  plain_detail::place_list places_;
  id_numbers numbers_;
  std::vector<entry> entries_;
  plain_vector<std::int32_t> lost_;  ///< places that were retired and not given back
};

TURBOMAP_END_NAMESPACE

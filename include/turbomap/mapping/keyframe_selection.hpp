// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A set of keyframes of the map for one call, each once: their handles, to pin them, and their poses.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/map_fault.hpp"
#include "../map/map_traits.hpp"
#include "../map/numbering.hpp"
#include "../math/rotation.hpp"
#include "../plain_vector.hpp"
#include "../store/posed_keyframe.hpp"
#include "handle_table.hpp"
#include "look_again.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Collects keyframes in the order in which they are first named. Make one and use it again: its memory is reused.
template <class Map>
class keyframe_selection {
 public:
  using traits = map_traits<Map>;              ///< traits of the map
  using keyframe = typename traits::keyframe;  ///< names a keyframe

  /// None; the memory stays.
  void clear() {
    numbers_.clear();
    keyframes_.clear(), ids_.clear();
    T_cw_.clear(), handles_.clear();
  }
  /// The number of a keyframe in this selection; it is taken in if it is new. id_table::none when it is not in the store,
  /// so not to be searched yet, when it has the index of one that has gone since, or has no pose that can be used, which `faults`
  /// is told. The caller holds the guard.
  /// Throws std::bad_alloc.
  std::size_t place(const Map& map, keyframe k, const handle_table& stored, fault_sink faults = {}) {
    const std::size_t known = numbers_.find(map, k);
    if (known != id_table::none) return is_the_one(known, k) ? known : id_table::none;
    const std::uint64_t id = traits::id(map, k);
    keyframe_handle handle;
    if (!stored.find(id, handle)) return id_table::none;
    const auto T_cw = pose_of(map, k);
    if (!is_pose(T_cw)) {
      faults({map_fault::bad_pose, id, 0, 0});
      return id_table::none;
    }
    keyframes_.push_back(k), ids_.push_back(id);
    T_cw_.push_back(T_cw);
    handles_.push_back(handle);
    return numbers_.place(map, k);
  }
  /// Reads the poses of those that are alive anew; one that cannot be used now stays as it was. The caller holds the guard.
  /// \return whether somebody has moved one
  bool read_poses(const Map& map) {
    bool moved = false;
    for (std::size_t i = 0; i < size(); ++i) {
      look_again(map, keyframes_[i]);
      if (!traits::alive(map, keyframes_[i])) continue;
      const auto now = pose_of(map, keyframes_[i]);
      if (is_same_pose(now, T_cw_[i]) || !is_pose(now)) continue;
      if (!moved) forget_copy(map);
      T_cw_[i] = now;
      moved = true;
    }
    return moved;
  }
  /// Its number, or id_table::none; so for no keyframe, which a list that contradicts the map may name.
  std::size_t find(const Map& map, keyframe k) const {
    if (k == keyframe{}) return id_table::none;
    const std::size_t known = numbers_.find(map, k);
    return known != id_table::none && is_the_one(known, k) ? known : id_table::none;
  }

  /// Number of keyframes.
  std::size_t size() const { return keyframes_.size(); }
  /// Keyframe i (not checked).
  keyframe operator[](std::size_t i) const { return keyframes_[i]; }
  /// The keyframes in the order of their numbers.
  const list_of<keyframe>& keyframes() const { return keyframes_; }
  /// Their ids.
  const plain_vector<std::uint64_t>& ids() const { return ids_; }
  /// Their poses when they were taken in, or read_poses() read them last, world to body.
  const plain_vector<rigid_transform<double>>& T_cw() const { return T_cw_; }
  /// Their handles in the store.
  const plain_vector<keyframe_handle>& handles() const { return handles_; }

 private:
  /// Between two parts of a snapshot a keyframe may go, and another get its index.
  bool is_the_one(std::size_t number, const keyframe& k) const { return keyframes_[number] == k; }

  keyframe_numbering<Map> numbers_;
  list_of<keyframe> keyframes_;
  plain_vector<std::uint64_t> ids_;
  plain_vector<rigid_transform<double>> T_cw_;
  plain_vector<keyframe_handle> handles_;
};

TURBOMAP_END_NAMESPACE

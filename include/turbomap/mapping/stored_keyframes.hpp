// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How keyframes of the user's map come into the keyframe store, and leave it. Each one is looked at in the map first, so that what
/// is in the store is what the map has. A table keeps the handle of each, by its id.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../store/argument_checks.hpp"
#include "../traits.hpp"
#include "handle_table.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A store, and which keyframes of a map are in it.
template <class Map, class Policy>
class stored_keyframes {
 public:
  using traits = map_traits<Map>;              ///< how the map is read.
  using keyframe = typename traits::keyframe;  ///< the name of a keyframe.
  using store_type = store_of<Map, Policy>;    ///< where they are kept.

  /// None. Map and store must outlive this.
  stored_keyframes(Map& map, store_type& store) : map_(map), store_(store) {}

  /// See local_mapper::insert().
  template <class Data>
  void insert(keyframe k, const Data& data) {
    const std::uint64_t id = checked_id(k, count_in(data));
    require(!handles_.contains(id), "keyframe id", id, "is in the store already");
    const keyframe_handle handle = store_.insert(data);
    try {
      handles_.add(id, handle);
    } catch (...) {
      store_.erase(handle);
      throw;
    }
  }
  /// Throws std::invalid_argument when it is not there.
  void remove(std::uint64_t id) {
    erase(handles_.at(id));
    handles_.erase(id);
  }
  /// All leave the store.
  void clear() {
    handles_.for_each_handle([this](keyframe_handle handle) { erase(handle); });
    handles_.clear();
  }

  /// Throws std::invalid_argument unless a keyframe is in the map and in the store. The caller holds the guard. \return its id
  std::uint64_t require_stored(const keyframe& k) const {
    require_alive(k);
    const std::uint64_t id = traits::id(map_, k);
    handles_.at(id);  // throws when it is not there
    return id;
  }

  /// Where they are kept.
  store_type& store() const { return store_; }
  /// The handle of each.
  const handle_table& handles() const { return handles_; }

 private:
  /// The caller holds the guard.
  void require_alive(const keyframe& k) const {
    require(!(k == keyframe{}), "keyframe", "none", "is not a keyframe of the map");
    require(traits::alive(map_, k), "keyframe", "dead", "is not in the map, or no longer");
  }
  /// Takes the guard. \throws std::invalid_argument  the keyframe is none, not in the map, or cannot be used there
  std::uint64_t checked_id(const keyframe& k, std::size_t keypoints) const {
    [[maybe_unused]] const auto guard = map_guard(map_);
    require_alive(k);
    check_pose("keyframe", pose_of(map_, k));
    require(keypoints == keypoint_count_of(map_, k), "keypoint_count", keypoints,
            "is not that of the keyframe in the map");
    return traits::id(map_, k);
  }
  static std::size_t count_in(const keyframe_data<typename traits::descriptor, typename traits::camera>& data) {
    return data.keypoint_count < 0 ? 0 : static_cast<std::size_t>(data.keypoint_count);
  }
  template <class Data>
  static std::size_t count_in([[maybe_unused]] const Data& data) {
    static_assert(require_keyframe_traits<Data>());
    if constexpr (has_keyframe_traits_v<Data>)
      return keyframe_traits<Data>::keypoint_count(data);
    else
      return 0;
  }
  /// keyframe_store::clear() may have taken it out before.
  void erase(keyframe_handle handle) {
    if (store_.contains(handle)) store_.erase(handle);
  }

  Map& map_;
  store_type& store_;
  handle_table handles_;
};

TURBOMAP_END_NAMESPACE

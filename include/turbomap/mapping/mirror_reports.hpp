// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What others say they have changed in a map that is mirrored. They may say so at any time; the mirror hears it when the next
/// keyframe is processed, and that everything may have changed when the guard is next taken. Where no keyframe is processed for
/// long, a list of all that was said would grow, and keep objects of the user's: beyond a number it becomes that everything may
/// have changed.

#include <cstddef>
#include <mutex>
#include <utility>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../plain_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// All members may be called from any thread.
template <class Map>
class mirror_reports {
 public:
  using user_keyframe = typename map_traits<Map>::keyframe;  ///< what the user calls a keyframe
  using user_point = typename map_traits<Map>::point;        ///< what the user calls a point

  /// What was reported since it was last asked for.
  struct reported {
    list_of<user_point> points;        ///< that changed
    list_of<user_keyframe> keyframes;  ///< that changed
    bool all = false;                  ///< everything may have changed
  };

  static constexpr std::size_t most = std::size_t{1} << 16;  ///< names that are kept; one more becomes add_all()

  /// A point changed.
  void add(const user_point& p) { add(p, reported_.points); }
  /// A keyframe changed.
  void add(const user_keyframe& k) { add(k, reported_.keyframes); }
  /// Everything may have changed: that says what was reported before, too.
  void add_all() {
    reported dropped;  // let go without the lock: it may be the last that keeps an object
    const std::lock_guard<std::mutex> lock(mutex_);
    std::swap(dropped, reported_);
    reported_.all = true;
  }
  /// What was reported; nothing is, afterwards. No lock is held when it is used: who reports may hold locks of objects.
  reported take() {
    reported taken;
    const std::lock_guard<std::mutex> lock(mutex_);
    std::swap(taken, reported_);
    return taken;
  }

  /// Whether everything may have changed; that is not reported afterwards.
  bool take_all() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::exchange(reported_.all, false);
  }

 private:
  template <class Name, class List>
  void add(const Name& name, List& list) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (reported_.all) return;
      if (reported_.points.size() + reported_.keyframes.size() < most) return list.push_back(name);
    }
    add_all();
  }

  std::mutex mutex_;
  reported reported_;
};

TURBOMAP_END_NAMESPACE

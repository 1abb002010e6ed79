// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What merged points have become, for systems that do not remember it themselves: behind map_traits::replacement. It forgets in
/// rounds, so that neither ids nor the objects behind names pile up.

#include <cstdint>
#include <new>
#include <unordered_map>
#include <utility>

namespace turbomap {

/// From the id of a merged point to the name of the point that it was merged into. Not synchronised: keep it beside the map, under
/// its guard.
///
///     static void retire(my::Map& m, point p, point into) { m.erase(p), m.replacements.note(p->id, into); }
///     static point replacement(const my::Map& m, point p) { return m.replacements.find(p->id); }
///     // before each keyframe, under the guard:
///     map.replacements.next_round();
///
/// A name is kept for two rounds, this one and the next: commits ask for what was merged while the keyframe is processed, tracking
/// for what it saw before.
template <class Point>
class replacement_table {
 public:
  /// A point is gone; `into`: what it was merged into, Point{} when it was erased. Does not throw: without memory nothing is
  /// remembered, and the point counts as erased. O(1).
  void note(std::uint64_t id, const Point& into) noexcept {
    if (into == Point{}) return;
    try {
      recent_.insert_or_assign(id, into);
    } catch (const std::bad_alloc&) {
      recent_.erase(id);
    }
  }
  /// What the point was merged into, which may have been merged too (turbomap::resolve() goes on); Point{}: not merged, or
  /// forgotten. O(1).
  Point find(std::uint64_t id) const {
    for (const auto* table : {&recent_, &older_})
      if (const auto at = table->find(id); at != table->end()) return at->second;
    return Point{};
  }
  /// Forgets what was noted before the last round.
  void next_round() {
    older_.swap(recent_);
    recent_.clear();
  }
  /// Forgets all.
  void clear() { recent_.clear(), older_.clear(); }
  /// Whether nothing is remembered.
  bool empty() const { return recent_.empty() && older_.empty(); }

 private:
  std::unordered_map<std::uint64_t, Point> recent_, older_;
};

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Points whose appearance is due. Fusion, adjustment and culling touch the same points one after the other, and none of them
/// reads what the one before has changed in their appearance: so what they touch is noted, and computed once.

#include <cstddef>

#include "../config.hpp"
#include "../plain_vector.hpp"
#include "appearance_update.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Notes points, and updates each of them once. Of one context.
template <class Map, class Policy>
class due_appearances {
 public:
  using point = typename map_traits<Map>::point;  ///< names a point
  using scope = mapping_scope<Map, Policy>;       ///< what a stage is called with

  /// Nothing is due. \param ctx  its resource gives the memory, and must outlive this
  explicit due_appearances(const context<Policy>& ctx) : appearance_(ctx) {}

  /// Their observations changed: descriptor, normal and range are due. Dead points and repetitions do no harm.
  void changed(span<const point> points) { append(points, changed_); }
  /// Their position changed: normal and range are due.
  void moved(span<const point> points) { append(points, moved_); }
  /// Nothing is due.
  void clear() { changed_.clear(), moved_.clear(); }
  /// Whether nothing is due.
  bool empty() const { return changed_.empty() && moved_.empty(); }

  /// Updates all of them; then none is due, also where it throws what appearance_update throws.
  /// \return how many points were updated
  std::size_t update(const scope& s, const appearance_options& options) {
    working_changed_.clear(), working_moved_.clear();
    working_changed_.swap(changed_), working_moved_.swap(moved_);
    return appearance_(s, working_changed_, working_moved_, options);
  }

 private:
  static void append(span<const point> points, list_of<point>& list) {
    for (const point& p : points) list.push_back(p);
  }

  appearance_update<Map, Policy> appearance_;
  list_of<point> changed_, moved_, working_changed_, working_moved_;
};

TURBOMAP_END_NAMESPACE

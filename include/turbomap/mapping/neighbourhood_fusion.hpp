// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Fusion of duplicates between one keyframe and its neighbourhood, as far as there is time. First the points of the keyframe are
/// searched in as many targets as fit before the deadline; then the points of these targets in the keyframe. The stage itself is
/// duplicate_fusion.hpp.

#include <cstddef>

#include "../config.hpp"
#include "../context.hpp"
#include "../map/map_traits.hpp"
#include "../map/neighbourhood.hpp"
#include "../plain_vector.hpp"
#include "duplicate_fusion.hpp"
#include "look_again.hpp"
#include "mapping_progress.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Call choose_targets(), then fuse(). Of one context.
template <class Map, class Policy>
class neighbourhood_fusion {
 public:
  using keyframe = typename map_traits<Map>::keyframe;  ///< the name of a keyframe.
  using point = typename map_traits<Map>::point;        ///< the name of a map point.
  using scope = mapping_scope<Map, Policy>;             ///< what a stage works on.

  /// \param ctx  its resource gives the memory, and must outlive this
  explicit neighbourhood_fusion(const context<Policy>& ctx) : fusion_(ctx) {}

  /// Chooses keyframes that can be searched, as many as there is time for. \return how many
  std::size_t choose_targets(const scope& s, const keyframe& current, const neighbourhood_options& options,
                             mapping_progress& progress) {
    {
      const auto guard = s.guard();
      targets_.clear();
      look_again(s.map, current);
      if (map_traits<Map>::alive(s.map, current))  // else erased meanwhile
        targets_ = neighbourhood_.targets(s.map, current, options, [&](const keyframe& k) { return s.can_use(k); });
    }
    const std::size_t fitting = progress.fitting(mapping_piece::fuse_target, targets_.size());
    if (fitting < targets_.size()) progress.cut(mapping_piece::fuse_target);
    targets_.resize(fitting);
    return fitting;
  }
  /// Searches and commits both ways. done() and touched() say what that did to the map, also where it throws.
  void fuse(const scope& s, const keyframe& current, const fusion_options& options, mapping_progress& progress) {
    fusion_.begin();
    progress.timed(mapping_piece::fuse_target, static_cast<double>(targets_.size()),
                   [&] { fusion_.forward(s, current, targets_, options); });
    if (!progress.fits(mapping_piece::fuse_back)) return progress.cut(mapping_piece::fuse_back);
    progress.timed(mapping_piece::fuse_back, 1, [&] { fusion_.backward(s, current, targets_, options); });
  }
  /// What the last fuse() did.
  const fusion_summary& done() const { return fusion_.done(); }
  /// Points that gained observations in the last fuse(): their appearance is due.
  const list_of<point>& touched() const { return fusion_.touched(); }
  /// No target and no touched point is known. Lists that the work is done in keep names until the next call.
  void clear() {
    fusion_.begin();
    targets_.clear();
  }

 private:
  neighbourhood<Map> neighbourhood_;
  duplicate_fusion<Map, Policy> fusion_;
  list_of<keyframe> targets_;
};

TURBOMAP_END_NAMESPACE

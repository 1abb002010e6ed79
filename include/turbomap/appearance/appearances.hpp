// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The appearance of the points of one call, where it was computed, and its form on the host.

#include <cstddef>
#include <memory_resource>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../result_copies.hpp"
#include "appearance_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The memory of one call: filled by update_appearance().
template <class Descriptor, class Memory>
struct appearance_buffers {
  /// Empty. \param resource  must outlive this
  explicit appearance_buffers(std::pmr::memory_resource* resource)
      : inputs(resource), points(resource), descriptors(resource) {}

  array<std::byte, Memory> inputs;                          ///< the arguments of the call, packed
  array<point_appearance, Memory> points;                   ///< direction and distance range of each point
  array<typename Descriptor::element, Memory> descriptors;  ///< [point][element]; empty when not asked for
};

/// The appearance of the points of one call. Make one and use it for every call: its memory is reused. Move-only; not shared
/// between threads.
template <class Descriptor, class Camera, class Policy>
class appearances {
 public:
  using memory_type = memory_of_t<Policy>;       ///< where the results stay
  using element = typename Descriptor::element;  ///< of a descriptor

  /// No points. \param ctx  its resource gives the memory, and must outlive this
  explicit appearances(const context<Policy>& ctx) : buffers_(ctx.resource()), copies_(ctx) {}
  /// Takes the memory of another, which has no points then.
  appearances(appearances&&) = default;
  /// Exchanges the memory with another.
  appearances& operator=(appearances&&) = default;

  /// No points: what is left where a call ran out of memory.
  void clear() {
    buffers_.points.resize_discard(0);
    buffers_.descriptors.resize_discard(0);
  }
  /// The points in the order of the call, on the host, equal to the last bit on every policy. Waits. O(points).
  /// \param descriptors  overwritten by [point][element], 0 for a point without observations; empty when the call did
  ///                     not ask for descriptors
  template <class Points, class Elements>
  void plan(context<Policy>& ctx, Points& points, Elements& descriptors) const {
    points.resize(buffers_.points.size());
    descriptors.resize(buffers_.descriptors.size());
    copies_.fetch(ctx, {{points.data(), buffers_.points.data(), points.size() * sizeof(point_appearance)},
                        {descriptors.data(), buffers_.descriptors.data(), descriptors.size() * sizeof(element)}});
  }
  /// For update_appearance(), which fills them.
  appearance_buffers<Descriptor, memory_type>& buffers() { return buffers_; }

 private:
  appearance_buffers<Descriptor, memory_type> buffers_;
  mutable result_copies copies_;
};

TURBOMAP_END_NAMESPACE

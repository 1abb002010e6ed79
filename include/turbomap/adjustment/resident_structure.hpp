// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The lists of an adjustment_structure where the policy computes.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "order_observations.hpp"
#include "structure.hpp"
#include "uploaded.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The lists of one problem.
template <class Memory>
class resident_structure {
 public:
  /// Empty. \param resource  memory of the policy; must outlive this
  explicit resident_structure(std::pmr::memory_resource* resource) {
    const auto use_resource = [resource](auto& list, auto&) { list = std::decay_t<decltype(list)>(resource); };
    for_each_sum_list(sums_, sums_, use_resource);
    for_each_block_list(blocks_, blocks_, use_resource);
  }

  /// All but the lists of blocks. The structure must stay as it is while it is read.
  template <class Policy>
  void send_sums(const Policy& policy, const adjustment_structure& s) {
    for_each_sum_list(sums_, s, [&](auto& list, const auto& host) { list.send(policy, host); });
  }
  /// The lists of blocks.
  template <class Policy>
  void send_blocks(const Policy& policy, const adjustment_structure& s) {
    for_each_block_list(blocks_, s, [&](auto& list, const auto& host) { list.send(policy, host); });
  }

  /// Room for the lists of observations that the policy makes. \param to  where
  void make_sums(const observation_input& in, observation_lists& to) {
    const auto at = [](int i) { return static_cast<std::size_t>(i); };
    const std::size_t rows = at(in.rows), landmarks = at(in.landmarks) + 1, frames = at(in.free_frames) + 1;
    to.landmark_row = sums_.landmark_row.make(landmarks), to.landmark_slot = sums_.landmark_slot.make(landmarks);
    to.slot_coupling = sums_.slot_coupling.make(rows + 1), to.slot_frame = sums_.slot_frame.make(rows);
    to.slot_landmark = sums_.slot_landmark.make(rows), to.slot_list = sums_.slot_list.make(rows);
    to.frame_partial = sums_.frame_partial.make(frames), to.frame_slot = sums_.frame_slot.make(frames);
    to.partial_list = sums_.partial_list.make(at(in.most_chunks()));
  }
  /// The lists that are not of observations, where they are already: see sum_lists.
  void adopt(const std::int32_t* free_of_frame, const std::int32_t* frame_of_free, const std::int32_t* frame_factor,
             const std::int32_t* frame_factor_list, const std::int32_t* frame_pair, const frame_neighbour* neighbours) {
    sums_.free_of_frame.adopt(free_of_frame), sums_.frame_of_free.adopt(frame_of_free);
    sums_.frame_factor.adopt(frame_factor), sums_.frame_factor_list.adopt(frame_factor_list);
    sums_.frame_pair.adopt(frame_pair), sums_.neighbours.adopt(neighbours);
  }
  /// Fetches the lists of observations that the policy made.
  template <class Policy>
  void fetch(const Policy& policy, adjustment_structure& s) const {
    const auto landmarks = static_cast<std::size_t>(s.landmarks) + 1,
               frames = static_cast<std::size_t>(s.free_frames) + 1;
    fetch_list(policy, sums_.landmark_row, landmarks, s.landmark_row);
    fetch_list(policy, sums_.landmark_slot, landmarks, s.landmark_slot);
    fetch_list(policy, sums_.slot_coupling, s.slots() + 1, s.slot_coupling);
    fetch_list(policy, sums_.slot_frame, s.slots(), s.slot_frame);
    fetch_list(policy, sums_.slot_landmark, s.slots(), s.slot_landmark);
    fetch_list(policy, sums_.slot_list, s.slots(), s.slot_list);
    fetch_list(policy, sums_.frame_partial, frames, s.frame_partial);
    fetch_list(policy, sums_.frame_slot, frames, s.frame_slot);
    fetch_list(policy, sums_.partial_list, static_cast<std::size_t>(s.sizes.free_chunks), s.partial_list);
  }

  /// Fills in the pointers of a view, e.g. schur_view. Those of the blocks are null before send_blocks().
  template <class View>
  void point(View& view) const {
    const auto to_data = [](auto& pointer, const auto& list) { pointer = list.data(); };
    for_each_sum_list(view, sums_, to_data);
    for_each_block_list(view, blocks_, to_data);
  }

 private:
  template <class T>
  using list = resident_copy<T, Memory>;

  sum_lists<list> sums_;
  block_lists<list> blocks_;
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The structure of a problem: in which order observations are computed, and fixed lists of what is summed into what.
/// Every sum of an adjustment follows such a list, so its bits depend neither on the number of threads nor on the order
/// in which they run. structure_builder.hpp makes it.
///
/// A **row** is an observation in the order (landmark, frame); a **coupling** is a row of a free frame; a **slot** is all
/// couplings of one frame with one landmark (a rig may see it twice); a **block** is two free frames that share a
/// landmark or a factor; a **chunk** is observations of one frame that are computed together, and gives one partial sum.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../config.hpp"
#include "../plain_vector.hpp"

namespace turbomap {

/// Observations of one group, of one frame and kind, that are computed together.
struct observation_chunk {
  std::int32_t frame;  ///< number of the frame
  std::int32_t free;   ///< number among the free frames; -1: fixed
  std::int32_t kind;   ///< the group's own: e.g. camera and whether stereo
  std::int32_t begin;  ///< first entry, a multiple of observation_padding
  std::int32_t count;  ///< entries that are real
};

/// Two observations of one landmark by two frames, as numbers of slots.
struct slot_pair {
  std::int32_t first;   ///< a slot
  std::int32_t second;  ///< another slot of the same landmark
};

/// The two frames of a factor, as numbers among the free frames; -1: fixed.
struct free_pair {
  std::int32_t first;   ///< of the first frame
  std::int32_t second;  ///< of the second frame
};

/// A factor between two free frames as one of them sees it.
struct frame_neighbour {
  std::int32_t factor;    ///< number among the factors between two frames
  std::int32_t other;     ///< the other free frame
  std::int32_t is_first;  ///< 1: the frame that sees it is the factor's first
};

inline constexpr int observation_padding = 8;  ///< entries a frame's observations are padded to: lanes of a pack

/// Observations of one group in the order they are computed in: by frame, kind, landmark.
struct group_structure {
  plain_vector<observation_chunk> chunks;  ///< in the order of frames
  plain_vector<std::int32_t> source;       ///< [entry] row of the caller; padding repeats the last one
  plain_vector<std::int32_t> landmark;     ///< [entry]
  plain_vector<std::int32_t> row;          ///< [entry] place in the order by landmark
  /// [entry] place among the couplings of free frames with landmarks; -1: fixed frame
  plain_vector<std::int32_t> coupling;
};

/// The lists that all solvers follow. `x_y` of size [x + 1] says where the y of each x begin.
/// \tparam List  what a list is: a vector of the host, its copy where the policy computes, or a pointer to that
template <template <class> class List>
struct sum_lists {
  List<std::int32_t> free_of_frame{};      ///< [frame] number among the free frames; -1: fixed
  List<std::int32_t> frame_of_free{};      ///< [free frame] the inverse
  List<std::int32_t> landmark_row{};       ///< [landmark + 1]
  List<std::int32_t> landmark_slot{};      ///< [landmark + 1]
  List<std::int32_t> slot_coupling{};      ///< [slot + 1]
  List<std::int32_t> slot_frame{};         ///< [slot] free frame
  List<std::int32_t> slot_landmark{};      ///< [slot]
  List<std::int32_t> frame_partial{};      ///< [free frame + 1] into partial_list
  List<std::int32_t> partial_list{};       ///< chunks of a frame
  List<std::int32_t> frame_slot{};         ///< [free frame + 1] into slot_list
  List<std::int32_t> slot_list{};          ///< slots of a frame
  List<std::int32_t> frame_factor{};       ///< [free frame + 1] into frame_factor_list
  List<std::int32_t> frame_factor_list{};  ///< partial sums that factors of one or two frames give to a frame
  List<std::int32_t> frame_pair{};         ///< [free frame + 1] into neighbours
  List<frame_neighbour> neighbours{};      ///< factors between a frame and another free one
};

/// The lists of the blocks of the reduced matrix, for solvers that form it.
template <template <class> class List>
struct block_lists {
  List<std::int32_t> block_row{};     ///< [block] free frame, below that of the column; in (row, column) order
  List<std::int32_t> block_column{};  ///< [block] free frame
  List<std::int32_t> block_pair{};    ///< [block + 1] into pairs
  List<slot_pair> pairs{};            ///< of slots, block by block
  List<std::int32_t> block_factor{};  ///< [block + 1] into factor_list
  List<std::int32_t> factor_list{};   ///< 2 * factor between frames + (its first frame is the column)
};

/// Calls f(list of a, same list of b) for each of sum_lists.
template <class A, class B, class Function>
void for_each_sum_list(A& a, B& b, Function f) {
  f(a.free_of_frame, b.free_of_frame), f(a.frame_of_free, b.frame_of_free);
  f(a.landmark_row, b.landmark_row), f(a.landmark_slot, b.landmark_slot);
  f(a.slot_coupling, b.slot_coupling), f(a.slot_frame, b.slot_frame), f(a.slot_landmark, b.slot_landmark);
  f(a.frame_partial, b.frame_partial), f(a.partial_list, b.partial_list);
  f(a.frame_slot, b.frame_slot), f(a.slot_list, b.slot_list);
  f(a.frame_factor, b.frame_factor), f(a.frame_factor_list, b.frame_factor_list);
  f(a.frame_pair, b.frame_pair), f(a.neighbours, b.neighbours);
}
/// The same of block_lists.
template <class A, class B, class Function>
void for_each_block_list(A& a, B& b, Function f) {
  f(a.block_row, b.block_row), f(a.block_column, b.block_column);
  f(a.block_pair, b.block_pair), f(a.pairs, b.pairs);
  f(a.block_factor, b.block_factor), f(a.factor_list, b.factor_list);
}

/// A list on the host.
template <class T>
using list_on_host = plain_vector<T>;
/// A pointer to the elements of a list.
template <class T>
using list_pointer = const T*;

/// How long the lists of observations are.
struct structure_sizes {
  std::int32_t rows = 0;       ///< observations
  std::int32_t couplings = 0;  ///< observations of free frames
  std::int32_t slots = 0;      ///< pairs of a free frame and a landmark that it sees
  // Where the lists are elsewhere, also:
  std::int32_t chunks = 0;       ///< of the one group
  std::int32_t free_chunks = 0;  ///< those of free frames, which come first
  std::int32_t moving = 0;       ///< landmarks with rows that are not fixed
  std::int64_t pairs = 0;        ///< of slots of one landmark
};

/// Made once from the inputs of a problem: on the host (structure_builder.hpp), or where the policy computes
/// (order_observations.hpp).
struct adjustment_structure : sum_lists<list_on_host>, block_lists<list_on_host> {
  int frames = 0;                       ///< all, fixed ones included
  int landmarks = 0;                    ///< all, fixed ones included
  int free_frames = 0;                  ///< frames that move
  int partials = 0;                     ///< chunks of all groups, in order: each gives one partial sum
  int frame_factors = 0;                ///< factors of one frame and between two
  int factor_partials = 0;              ///< partial sums that they give: one per frame
  std::vector<group_structure> groups;  ///< of the groups with landmarks
  plain_vector<free_pair> frame_pairs;  ///< [factor between two frames]
  structure_sizes sizes;                ///< of the lists of observations
  /// The policy made the lists of rows, slots and chunks, where it computes: they are not here, until they are fetched.
  bool elsewhere = false;
  bool groups_elsewhere = false;  ///< the same of `groups`, which are fetched apart: few need them

  /// Observations of all groups.
  std::size_t rows() const { return static_cast<std::size_t>(sizes.rows); }
  /// Observations of free frames, of all groups.
  std::size_t couplings() const { return static_cast<std::size_t>(sizes.couplings); }
  /// Pairs of a free frame and a landmark that it sees.
  std::size_t slots() const { return static_cast<std::size_t>(sizes.slots); }
  /// Partial costs.
  std::size_t costs() const { return static_cast<std::size_t>(partials) + static_cast<std::size_t>(frame_factors); }
};

}  // namespace turbomap

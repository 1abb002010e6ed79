// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The structure of a problem, made once on the host: in which order observations are computed, and fixed lists of
/// what is
/// summed into what. Every sum of an adjustment follows such a list, so its bits depend neither on the number of
/// threads
/// nor on the order they run in.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "../config.hpp"
#include "../span.hpp"

namespace turbomap {

/// Observations of one group, of one frame and kind, that are computed together.
struct observation_chunk {
  std::int32_t frame;
  std::int32_t free;   ///< number among the free frames; -1: fixed
  std::int32_t kind;   ///< the group's own: e.g. camera and whether stereo
  std::int32_t begin;  ///< first entry, a multiple of observation_padding
  std::int32_t count;  ///< entries that are real
};

/// Two observations of one landmark by two frames, as numbers of slots.
struct slot_pair {
  std::int32_t first, second;
};

/// A factor between two free frames as one of them sees it.
struct frame_neighbour {
  std::int32_t factor, other, is_first;
};

/// What the structure needs to know of a group of factors with landmarks.
struct landmark_group_input {
  span<const std::int32_t> frame, landmark;
  const std::uint8_t* kind;  ///< one a row, below `kinds`; null: all 0
  int kinds;
};

/// What it needs to know of a group of factors between frames.
struct frame_pair_input {
  span<const std::int32_t> first, second;
};

inline constexpr int observation_padding = 8;  ///< entries a frame's observations are padded to: lanes of a pack

/// Observations of one group in the order they are computed in: by frame, kind, landmark.
struct group_structure {
  std::vector<observation_chunk> chunks;
  std::vector<std::int32_t> source;    ///< [entry] row of the caller; padding repeats the last one
  std::vector<std::int32_t> landmark;  ///< [entry]
  std::vector<std::int32_t> row;       ///< [entry] place in the order by landmark
  /// [entry] place among the couplings of free frames with landmarks; -1: fixed frame
  std::vector<std::int32_t> coupling;
};

/// A **row** is an observation in the order (landmark, frame); a **coupling** a row of a free frame; a **slot** all
/// couplings
/// of one frame with one landmark (a rig may see it twice); a **block** two free frames that share a landmark or a
/// factor.
struct adjustment_structure {
  int frames = 0, landmarks = 0, free_frames = 0;
  int partials = 0;                         ///< chunks of all groups, in order: each gives one partial sum
  std::vector<std::int32_t> free_of_frame;  ///< [frame] -1: fixed
  std::vector<std::int32_t> frame_of_free;
  std::vector<group_structure> groups;
  std::vector<std::int32_t> landmark_row;             ///< [landmark + 1]
  std::vector<std::int32_t> landmark_slot;            ///< [landmark + 1]
  std::vector<std::int32_t> slot_coupling;            ///< [slot + 1]
  std::vector<std::int32_t> slot_frame;               ///< [slot] free frame
  std::vector<std::int32_t> slot_landmark;            ///< [slot]
  std::vector<std::int32_t> frame_partial;            ///< [free frame + 1] into partial_list
  std::vector<std::int32_t> partial_list;             ///< chunks of a frame
  std::vector<std::int32_t> frame_slot;               ///< [free frame + 1] into slot_list
  std::vector<std::int32_t> slot_list;                ///< slots of a frame
  std::vector<std::int32_t> block_row, block_column;  ///< [block] free frames, row < column, in (row, column) order
  std::vector<std::int32_t> block_pair;               ///< [block + 1] into pairs
  std::vector<slot_pair> pairs;
  std::vector<std::int32_t> block_factor;  ///< [block + 1] into factor_list
  std::vector<std::int32_t> factor_list;   ///< 2 * factor between frames + (its first frame is the column)

  std::size_t rows() const { return landmark_row.empty() ? 0 : static_cast<std::size_t>(landmark_row.back()); }
  std::size_t couplings() const { return slot_coupling.empty() ? 0 : static_cast<std::size_t>(slot_coupling.back()); }
  std::size_t slots() const { return slot_frame.size(); }
};

/// Makes the structure. Indices must have been checked. O(observations + pairs), memory is used again.
class structure_builder {
 public:
  using indices = std::vector<std::int32_t>;

  /// All but the blocks.
  /// \param chunk  entries a chunk holds at most, a multiple of observation_padding
  void build(int landmarks, span<const std::uint8_t> fixed_frames, int frames, span<const landmark_group_input> groups,
             int chunk, adjustment_structure& s) {
    s.frames = frames, s.landmarks = landmarks;
    order_frames(fixed_frames, s);
    order_rows(groups, s);
    order_entries(groups, chunk, s);
    s.block_row.clear(), s.block_column.clear(), s.pairs.clear(), s.factor_list.clear();
    s.block_pair.assign(1, 0), s.block_factor.assign(1, 0);
  }

  /// The blocks: for each free frame the later ones that share a landmark or a factor with it. Not needed by solvers
  /// that
  /// never form the reduced matrix. O(pairs).
  void find_blocks(span<const frame_pair_input> pair_groups, adjustment_structure& s) {
    factor_row_.clear(), factor_code_.clear(), factor_column_.clear();
    s.block_row.clear(), s.block_column.clear(), s.pairs.clear(), s.factor_list.clear();
    s.block_pair.assign(1, 0), s.block_factor.assign(1, 0);
    std::int32_t factor = 0;
    for (const auto& g : pair_groups)
      for (std::size_t i = 0; i < g.first.size(); ++i, ++factor) {
        const std::int32_t a = s.free_of_frame[at(g.first[i])], b = s.free_of_frame[at(g.second[i])];
        const bool both = a >= 0 && b >= 0;
        factor_row_.push_back(both ? std::min(a, b) : -1), factor_column_.push_back(std::max(a, b));
        factor_code_.push_back(2 * factor + (a > b ? 1 : 0));
      }
    list_by_frame(factor_row_, s.free_frames, factor_begin_, factor_order_);
    const std::size_t n = at(s.free_frames);
    shared_.assign(n, 0), joined_.assign(n, 0), next_.resize(n), next_factor_.resize(n);
    for (std::int32_t i = 0; i < s.free_frames; ++i) {
      columns_.clear();
      const auto touch = [&](std::int32_t j) {
        if (shared_[at(j)] == 0 && joined_[at(j)] == 0) columns_.push_back(j);
      };
      for_each_pair(s, i, [&](std::int32_t, std::int32_t t) {
        const std::int32_t j = s.slot_frame[at(t)];
        touch(j), ++shared_[at(j)];
      });
      for (std::int32_t k = factor_begin_[at(i)]; k < factor_begin_[at(i) + 1]; ++k) {
        const std::int32_t j = factor_column_[at(factor_order_[at(k)])];
        touch(j), ++joined_[at(j)];
      }
      std::sort(columns_.begin(), columns_.end());
      for (const auto j : columns_) {
        s.block_row.push_back(i), s.block_column.push_back(j);
        next_[at(j)] = s.block_pair.back(), next_factor_[at(j)] = s.block_factor.back();
        s.block_pair.push_back(s.block_pair.back() + shared_[at(j)]);
        s.block_factor.push_back(s.block_factor.back() + joined_[at(j)]);
        shared_[at(j)] = 0, joined_[at(j)] = 0;
      }
      s.pairs.resize(at(s.block_pair.back())), s.factor_list.resize(at(s.block_factor.back()));
      for_each_pair(s, i, [&](std::int32_t a, std::int32_t t) {
        s.pairs[at(next_[at(s.slot_frame[at(t)])]++)] = {a, t};
      });
      for (std::int32_t k = factor_begin_[at(i)]; k < factor_begin_[at(i) + 1]; ++k) {
        const std::size_t f = at(factor_order_[at(k)]);
        s.factor_list[at(next_factor_[at(factor_column_[f])]++)] = factor_code_[f];
      }
    }
  }

  /// Lists the items of each bin, in order; items of bin -1 are in none.
  void list_by_frame(const indices& bin, int bins, indices& begin, indices& list) {
    begin.assign(at(bins) + 1, 0);
    for (const auto b : bin)
      if (b >= 0) ++begin[at(b) + 1];
    for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
    list.resize(at(begin.back()));
    next_in_bin_.assign(begin.begin(), begin.end());
    for (std::size_t i = 0; i < bin.size(); ++i)
      if (bin[i] >= 0) list[at(next_in_bin_[at(bin[i])]++)] = static_cast<std::int32_t>(i);
  }

 private:
  static std::size_t at(std::int32_t i) { return static_cast<std::size_t>(i); }

  void order_frames(span<const std::uint8_t> fixed, adjustment_structure& s) {
    s.free_of_frame.assign(at(s.frames), -1);
    s.frame_of_free.clear();
    key_.resize(at(s.frames));
    for (std::int32_t f = 0; f < s.frames; ++f)
      if (fixed.empty() || fixed[at(f)] == 0) {
        s.free_of_frame[at(f)] = static_cast<std::int32_t>(s.frame_of_free.size());
        s.frame_of_free.push_back(f);
      }
    s.free_frames = static_cast<int>(s.frame_of_free.size());
    std::int32_t next = s.free_frames;
    for (std::int32_t f = 0; f < s.frames; ++f)
      key_[at(f)] = s.free_of_frame[at(f)] < 0 ? next++ : s.free_of_frame[at(f)];
  }

  /// Sorts all observations by (landmark, frame), free frames first: two stable counting sorts.
  void order_rows(span<const landmark_group_input> groups, adjustment_structure& s) {
    std::size_t n = 0;
    for (const auto& g : groups) n += g.frame.size();
    all_frame_.resize(n), all_landmark_.resize(n), order_.resize(n), other_.resize(n);
    first_of_group_.clear();
    std::size_t o = 0;
    for (const auto& g : groups) {
      first_of_group_.push_back(static_cast<std::int32_t>(o));
      for (std::size_t i = 0; i < g.frame.size(); ++i, ++o)
        all_frame_[o] = key_[at(g.frame[i])], all_landmark_[o] = g.landmark[i];
    }
    first_of_group_.push_back(static_cast<std::int32_t>(n));
    counts_.assign(at(s.frames) + 1, 0);
    for (const auto f : all_frame_) ++counts_[at(f) + 1];
    for (std::size_t i = 1; i < counts_.size(); ++i) counts_[i] += counts_[i - 1];
    for (std::size_t i = 0; i < n; ++i) other_[at(counts_[at(all_frame_[i])]++)] = static_cast<std::int32_t>(i);
    s.landmark_row.assign(at(s.landmarks) + 1, 0);
    for (const auto l : all_landmark_) ++s.landmark_row[at(l) + 1];
    for (std::size_t i = 1; i < s.landmark_row.size(); ++i) s.landmark_row[i] += s.landmark_row[i - 1];
    counts_.assign(s.landmark_row.begin(), s.landmark_row.end());
    for (std::size_t i = 0; i < n; ++i) order_[at(counts_[at(all_landmark_[at(other_[i])])]++)] = other_[i];

    s.landmark_slot.assign(1, 0);
    s.slot_coupling.clear(), s.slot_frame.clear(), s.slot_landmark.clear();
    std::int32_t couplings = 0;
    for (std::int32_t l = 0; l < s.landmarks; ++l) {
      std::int32_t last = -1;
      for (std::int32_t r = s.landmark_row[at(l)]; r < s.landmark_row[at(l) + 1]; ++r) {
        const std::int32_t f = all_frame_[at(order_[at(r)])];
        if (f >= s.free_frames) break;
        if (f != last) s.slot_coupling.push_back(couplings), s.slot_frame.push_back(f), s.slot_landmark.push_back(l);
        last = f, ++couplings;
      }
      s.landmark_slot.push_back(static_cast<std::int32_t>(s.slot_frame.size()));
    }
    s.slot_coupling.push_back(couplings);
  }

  /// Sorts each group's observations by (frame, kind), which leaves them in the order of their landmarks, and cuts
  /// chunks.
  void order_entries(span<const landmark_group_input> groups, int chunk, adjustment_structure& s) {
    const std::size_t n = order_.size();
    coupling_of_row_.assign(n, -1);
    std::int32_t couplings = 0;
    for (std::size_t r = 0; r < n; ++r)
      if (all_frame_[at(order_[r])] < s.free_frames) coupling_of_row_[r] = couplings++;
    s.groups.resize(groups.size());
    frame_of_partial_.clear();
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const std::int32_t begin = first_of_group_[g], end = first_of_group_[g + 1];
      const auto kinds = static_cast<std::size_t>(groups[g].kinds);
      const auto bucket = [&](std::int32_t o) {
        const std::size_t kind = groups[g].kind == nullptr ? 0 : groups[g].kind[o - begin];
        return at(all_frame_[at(o)]) * kinds + kind;
      };
      counts_.assign(at(s.frames) * kinds + 1, 0);
      for (std::int32_t o = begin; o < end; ++o) ++counts_[bucket(o) + 1];
      auto& e = s.groups[g];
      e.chunks.clear();
      std::int32_t entry = 0;
      for (std::size_t b = 0; b + 1 < counts_.size(); ++b) {
        const std::int32_t count = counts_[b + 1];
        counts_[b] = entry;  // where this bucket begins
        const auto key = static_cast<std::int32_t>(b / kinds);
        for (std::int32_t i = 0; i < count; i += chunk)
          e.chunks.push_back({key, key, static_cast<std::int32_t>(b % kinds), entry + i, std::min(chunk, count - i)});
        entry += (count + observation_padding - 1) / observation_padding * observation_padding;
      }
      e.source.resize(at(entry)), e.landmark.resize(at(entry)), e.row.resize(at(entry)), e.coupling.resize(at(entry));
      for (std::size_t r = 0; r < n; ++r) {
        const std::int32_t o = order_[r];
        if (o < begin || o >= end) continue;
        const std::size_t i = at(counts_[bucket(o)]++);
        e.source[i] = o - begin, e.landmark[i] = all_landmark_[at(o)];
        e.row[i] = static_cast<std::int32_t>(r), e.coupling[i] = coupling_of_row_[r];
      }
      finish_chunks(e, s);
    }
    s.partials = static_cast<int>(frame_of_partial_.size());
    list_by_frame(frame_of_partial_, s.free_frames, s.frame_partial, s.partial_list);
    list_by_frame(s.slot_frame, s.free_frames, s.frame_slot, s.slot_list);
  }

  /// Numbers of frames instead of their keys, and padding.
  void finish_chunks(group_structure& e, const adjustment_structure& s) {
    frame_of_key_.resize(at(s.frames));
    for (std::int32_t f = 0; f < s.frames; ++f) frame_of_key_[at(key_[at(f)])] = f;
    for (auto& c : e.chunks) {
      c.free = c.frame < s.free_frames ? c.frame : -1;
      c.frame = frame_of_key_[at(c.frame)];
      frame_of_partial_.push_back(c.free);
      for (std::int32_t i = c.begin + c.count; i % observation_padding != 0; ++i) {
        const std::size_t last = at(c.begin + c.count - 1);
        e.source[at(i)] = e.source[last], e.landmark[at(i)] = e.landmark[last];
        e.row[at(i)] = e.row[last], e.coupling[at(i)] = e.coupling[last];
      }
    }
  }

  template <class Function>
  static void for_each_pair(const adjustment_structure& s, std::int32_t frame, Function function) {
    for (std::int32_t k = s.frame_slot[at(frame)]; k < s.frame_slot[at(frame) + 1]; ++k) {
      const std::int32_t a = s.slot_list[at(k)], end = s.landmark_slot[at(s.slot_landmark[at(a)]) + 1];
      for (std::int32_t t = a + 1; t < end; ++t) function(a, t);
    }
  }

  indices key_, all_frame_, all_landmark_, order_, other_, counts_, first_of_group_, coupling_of_row_;
  indices frame_of_key_, frame_of_partial_, columns_, shared_, joined_, next_, next_factor_;
  indices factor_row_, factor_column_, factor_code_, factor_begin_, factor_order_, next_in_bin_;
};

}  // namespace turbomap

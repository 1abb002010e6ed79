// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Makes the structure of a problem (structure.hpp) from indices: stable counting sorts by landmark and frame, then lists of
/// what shares a frame, a landmark or a factor.

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "block_finder.hpp"
#include "structure.hpp"

namespace turbomap {

/// What the structure needs to know of a group of factors with landmarks.
struct landmark_group_input {
  span<const std::int32_t> frame, landmark;
  const std::uint8_t* kind;  ///< one per row, below `kinds`; null: all 0
  int kinds;
};

/// What it needs to know of a group of factors of frames.
struct frame_group_input {
  span<const std::int32_t> first;
  span<const std::int32_t> second;  ///< empty: factors of one frame
};

/// Indices of a problem, as places in the inputs of the caller.
struct structure_input {
  int frames, landmarks;
  span<const std::uint8_t> fixed_frames;  ///< empty: none
  span<const landmark_group_input> landmark_groups;
  span<const frame_group_input> frame_groups;
  int chunk;  ///< entries that a chunk holds at most, a multiple of observation_padding
};

/// Makes the structure. Indices must have been checked. O(observations + pairs); its memory is used again.
class structure_builder {
 public:
  /// All but the blocks: see block_finder.
  void build(const structure_input& in, adjustment_structure& s) {
    s.frames = in.frames, s.landmarks = in.landmarks;
    order_frames(in.fixed_frames, s);
    order_rows(in.landmark_groups, s);
    order_entries(in.landmark_groups, in.chunk, s);
    list_frame_factors(in.frame_groups, s);
    block_finder::clear(s);
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

  /// Sorts the observations of each group by (frame, kind), which leaves them in the order of their landmarks, and cuts
  /// them into chunks.
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
    list_by_bin_(frame_of_partial_, s.free_frames, s.frame_partial, s.partial_list);
    list_by_bin_(s.slot_frame, s.free_frames, s.frame_slot, s.slot_list);
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

  /// What factors of one frame and between two give to their frames, and which frames they join.
  void list_frame_factors(span<const frame_group_input> groups, adjustment_structure& s) {
    const auto free = [&](std::int32_t frame) { return s.free_of_frame[at(frame)]; };
    s.frame_pairs.clear(), frame_of_factor_.clear();
    s.frame_factors = 0;
    for (const auto& g : groups) {
      s.frame_factors += static_cast<int>(g.first.size());
      for (std::size_t i = 0; i < g.first.size(); ++i) {
        frame_of_factor_.push_back(free(g.first[i]));
        if (g.second.empty()) continue;
        frame_of_factor_.push_back(free(g.second[i]));
        s.frame_pairs.push_back({free(g.first[i]), free(g.second[i])});
      }
    }
    s.factor_partials = static_cast<int>(frame_of_factor_.size());
    list_by_bin_(frame_of_factor_, s.free_frames, s.frame_factor, s.frame_factor_list);

    neighbour_.clear(), frame_of_neighbour_.clear();
    for (std::size_t i = 0; i < s.frame_pairs.size(); ++i) {
      const auto factor = static_cast<std::int32_t>(i);
      const auto [a, b] = s.frame_pairs[i];
      frame_of_neighbour_.push_back(b >= 0 ? a : -1), neighbour_.push_back({factor, b, 1});
      frame_of_neighbour_.push_back(a >= 0 ? b : -1), neighbour_.push_back({factor, a, 0});
    }
    list_by_bin_(frame_of_neighbour_, s.free_frames, s.frame_pair, neighbour_order_);
    s.neighbours.clear();
    for (const auto i : neighbour_order_) s.neighbours.push_back(neighbour_[at(i)]);
  }

  using indices = plain_vector<std::int32_t>;

  indices key_, all_frame_, all_landmark_, order_, other_, counts_, first_of_group_, coupling_of_row_;
  indices frame_of_key_, frame_of_partial_, frame_of_factor_, frame_of_neighbour_, neighbour_order_;
  plain_vector<frame_neighbour> neighbour_;
  bin_lister list_by_bin_;
};

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Makes the structure of a problem (structure.hpp) from indices: rows are sorted by landmark and frame, those that are
/// equal stay in their order; then lists of what shares a frame, a landmark or a factor.

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
  span<const std::int32_t> frame;     ///< [row] frame
  span<const std::int32_t> landmark;  ///< [row] landmark
  const std::uint8_t* kind;           ///< one per row, below `kinds`; null: all 0
  int kinds;                          ///< kinds of rows
};

/// What it needs to know of a group of factors of frames.
struct frame_group_input {
  span<const std::int32_t> first;   ///< [row] frame, or the first of two
  span<const std::int32_t> second;  ///< empty: factors of one frame
};

/// Indices of a problem, as places in the inputs of the caller.
struct structure_input {
  int frames;                                        ///< of the problem
  int landmarks;                                     ///< of the problem
  span<const std::uint8_t> fixed_frames;             ///< empty: none
  span<const landmark_group_input> landmark_groups;  ///< in the order of the caller's groups
  span<const frame_group_input> frame_groups;        ///< in the order of the caller's groups
  int chunk;                                  ///< entries that a chunk holds at most, a multiple of observation_padding
  span<const std::int32_t> landmark_place{};  ///< [landmark] its number in the structure; empty: as it is
};

/// Makes the structure. Indices must have been checked. O(observations + pairs); its memory is used again.
class structure_builder {
 public:
  /// All but the blocks: see block_finder.
  void build(const structure_input& in, adjustment_structure& s) {
    s.frames = in.frames, s.landmarks = in.landmarks, s.elsewhere = s.groups_elsewhere = false;
    order_frames(in.fixed_frames, s);
    order_rows(in, s);
    list_slots(s);
    order_entries(in.landmark_groups, in.chunk, s);
    list_frame_factors(in.frame_groups, s);
    block_finder::clear(s);
  }
  /// The same without the lists of observations, which the policy makes.
  void build_frames(const structure_input& in, adjustment_structure& s) {
    s.frames = in.frames, s.landmarks = in.landmarks;
    order_frames(in.fixed_frames, s);
    list_frame_factors(in.frame_groups, s);
    block_finder::clear(s);
  }
  /// [frame] its place where the free frames come first: rows of a landmark are in that order.
  const plain_vector<std::int32_t>& keys() const { return key_; }
  /// The inverse: [key] its frame.
  const plain_vector<std::int32_t>& frames_of_keys(int frames) {
    frame_of_key_.resize(at(frames));
    for (std::int32_t f = 0; f < frames; ++f) frame_of_key_[at(key_[at(f)])] = f;
    return frame_of_key_;
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

  /// An observation in the order (landmark, frame).
  struct ordered_row {
    std::int32_t key, source;  ///< of its frame; number among those of all groups
  };

  /// Sorts all observations by (landmark, frame), free frames first.
  void order_rows(const structure_input& in, adjustment_structure& s) {
    std::size_t n = 0;
    first_of_group_.clear();
    s.landmark_row.assign(at(s.landmarks) + 1, 0);
    const std::int32_t* const place = in.landmark_place.empty() ? nullptr : in.landmark_place.data();
    for (const auto& g : in.landmark_groups) {
      first_of_group_.push_back(static_cast<std::int32_t>(n));
      n += g.frame.size();
      for (const auto l : g.landmark) ++s.landmark_row[at(place == nullptr ? l : place[l]) + 1];
    }
    first_of_group_.push_back(static_cast<std::int32_t>(n));
    std::int32_t longest = 0;
    for (std::size_t i = 1; i < s.landmark_row.size(); ++i) {
      longest = std::max(longest, s.landmark_row[i]);
      s.landmark_row[i] += s.landmark_row[i - 1];
    }
    rows_.resize(n);
    if (longest <= most_in_place)
      order_few(in.landmark_groups, place, s);
    else
      order_by_counting(in.landmark_groups, place, s);
  }

  /// By landmark, then the few of each landmark where they are.
  void order_few(span<const landmark_group_input> groups, const std::int32_t* place, const adjustment_structure& s) {
    ordered_row* const rows = rows_.data();
    counts_.assign(s.landmark_row.begin(), s.landmark_row.end());
    std::int32_t o = 0;
    for (const auto& g : groups)
      for (std::size_t i = 0; i < g.frame.size(); ++i) {
        const std::int32_t l = place == nullptr ? g.landmark[i] : place[g.landmark[i]];
        rows[counts_[at(l)]++] = {key_[at(g.frame[i])], o++};
      }
    for (std::size_t l = 0; l + 1 < s.landmark_row.size(); ++l)
      for (std::int32_t i = s.landmark_row[l] + 1; i < s.landmark_row[l + 1]; ++i) {
        const ordered_row moved = rows[i];
        std::int32_t to = i;
        for (; to > s.landmark_row[l] && rows[to - 1].key > moved.key; --to) rows[to] = rows[to - 1];
        rows[to] = moved;
      }
  }
  /// Two stable counting sorts.
  void order_by_counting(span<const landmark_group_input> groups, const std::int32_t* place,
                         const adjustment_structure& s) {
    counts_.assign(at(s.frames) + 1, 0);
    for (const auto& g : groups)
      for (const auto f : g.frame) ++counts_[at(key_[at(f)]) + 1];
    for (std::size_t i = 1; i < counts_.size(); ++i) counts_[i] += counts_[i - 1];
    by_frame_.resize(rows_.size());
    std::int32_t o = 0;
    for (const auto& g : groups)
      for (std::size_t i = 0; i < g.frame.size(); ++i) {
        const std::int32_t key = key_[at(g.frame[i])];
        const std::int32_t l = place == nullptr ? g.landmark[i] : place[g.landmark[i]];
        by_frame_[at(counts_[at(key)]++)] = {{key, o++}, l};
      }
    counts_.assign(s.landmark_row.begin(), s.landmark_row.end());
    for (const auto& r : by_frame_) rows_[at(counts_[at(r.landmark)]++)] = r.row;
  }

  /// What each free frame has with each landmark.
  void list_slots(adjustment_structure& s) {
    const std::size_t n = rows_.size();
    s.landmark_slot.resize(at(s.landmarks) + 1);
    s.slot_coupling.resize(n + 1), s.slot_frame.resize(n), s.slot_landmark.resize(n);
    s.frame_slot.assign(at(s.free_frames) + 1, 0);
    std::int32_t couplings = 0, slots = 0;
    std::int32_t *const coupling = s.slot_coupling.data(), *const frame = s.slot_frame.data();
    std::int32_t *const landmark = s.slot_landmark.data(), *const of_frame = s.frame_slot.data() + 1;
    const ordered_row* const rows = rows_.data();
    for (std::int32_t l = 0; l < s.landmarks; ++l) {
      s.landmark_slot[at(l)] = slots;
      std::int32_t last = -1;
      for (std::int32_t r = s.landmark_row[at(l)], end = s.landmark_row[at(l) + 1]; r < end; ++r) {
        const std::int32_t f = rows[r].key;
        if (f >= s.free_frames) break;
        if (f != last) {
          coupling[slots] = couplings, frame[slots] = f, landmark[slots] = l;
          ++of_frame[f], ++slots;
        }
        last = f, ++couplings;
      }
    }
    s.sizes.rows = static_cast<std::int32_t>(n), s.sizes.couplings = couplings, s.sizes.slots = slots;
    s.landmark_slot[at(s.landmarks)] = slots;
    s.slot_coupling[at(slots)] = couplings;
    s.slot_coupling.resize(at(slots) + 1), s.slot_frame.resize(at(slots)), s.slot_landmark.resize(at(slots));
    for (std::size_t i = 1; i < s.frame_slot.size(); ++i) s.frame_slot[i] += s.frame_slot[i - 1];
    counts_.assign(s.frame_slot.begin(), s.frame_slot.end());
    s.slot_list.resize(at(slots));
    std::int32_t *const list = s.slot_list.data(), *const next = counts_.data();
    for (std::int32_t i = 0; i < slots; ++i) list[next[frame[i]]++] = i;
  }

  /// Sorts the observations of each group by (frame, kind), which leaves them in the order of their landmarks, and cuts
  /// them into chunks.
  void order_entries(span<const landmark_group_input> groups, int chunk, adjustment_structure& s) {
    s.groups.resize(groups.size());
    frame_of_partial_.clear();
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const std::int32_t begin = first_of_group_[g], end = first_of_group_[g + 1];
      const std::uint8_t* const kind_of = groups[g].kind;
      const auto kinds = static_cast<std::size_t>(groups[g].kinds);
      const auto bucket = [&](std::int32_t key, std::int32_t row) {
        return at(key) * kinds + (kind_of == nullptr ? 0 : kind_of[row]);
      };
      counts_.assign(at(s.frames) * kinds + 1, 0);
      for (std::int32_t i = 0; i < end - begin; ++i) ++counts_[bucket(key_[at(groups[g].frame[at(i)])], i) + 1];
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
      std::int32_t couplings = 0;
      std::int32_t *const source = e.source.data(), *const landmark = e.landmark.data(), *const row_of = e.row.data();
      std::int32_t *const coupling_of = e.coupling.data(), *const next = counts_.data();
      const ordered_row* const rows = rows_.data();
      for (std::int32_t l = 0; l < s.landmarks; ++l)
        for (std::int32_t r = s.landmark_row[at(l)], row_end = s.landmark_row[at(l) + 1]; r < row_end; ++r) {
          const ordered_row row = rows[r];
          const std::int32_t coupling = row.key < s.free_frames ? couplings++ : -1, o = row.source - begin;
          if (row.source < begin || row.source >= end) continue;
          const std::int32_t i = next[bucket(row.key, o)]++;
          source[i] = o, landmark[i] = l, row_of[i] = r, coupling_of[i] = coupling;
        }
      finish_chunks(e, s);
    }
    s.partials = static_cast<int>(frame_of_partial_.size());
    list_by_bin_(frame_of_partial_, s.free_frames, s.frame_partial, s.partial_list);
  }

  /// Numbers of frames instead of their keys, and padding.
  void finish_chunks(group_structure& e, const adjustment_structure& s) {
    const auto& frame_of_key = frames_of_keys(s.frames);
    for (auto& c : e.chunks) {
      c.free = c.frame < s.free_frames ? c.frame : -1;
      c.frame = frame_of_key[at(c.frame)];
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

  struct row_by_frame {
    ordered_row row;
    std::int32_t landmark;
  };
  /// Observations of a landmark that are sorted where they are: beyond it, counting is faster.
  static constexpr std::int32_t most_in_place = 64;

  plain_vector<ordered_row> rows_;
  plain_vector<row_by_frame> by_frame_;
  indices key_, counts_, first_of_group_;
  indices frame_of_key_, frame_of_partial_, frame_of_factor_, frame_of_neighbour_, neighbour_order_;
  plain_vector<frame_neighbour> neighbour_;
  bin_lister list_by_bin_;
};

}  // namespace turbomap

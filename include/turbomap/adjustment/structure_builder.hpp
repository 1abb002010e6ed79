// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Makes the structure of a problem (structure.hpp) from indices: rows are sorted by landmark and frame (row_sorter.hpp); then follow
/// lists of what shares a frame, a landmark or a factor. Which blocks that gives is found when a solver asks (block_finder.hpp).

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "bin_lister.hpp"
#include "block_finder.hpp"
#include "frame_factor_lister.hpp"
#include "row_sorter.hpp"
#include "structure.hpp"
#include "structure_input.hpp"

namespace turbomap {

/// Makes the structure. Indices must have been checked. O(observations + pairs); its memory is used again.
class structure_builder {
 public:
  /// All but the blocks: see block_finder.
  void build(const structure_input& in, adjustment_structure& s) {
    s.frames = in.frames, s.landmarks = in.landmarks, s.elsewhere = s.groups_elsewhere = false;
    order_frames(in.fixed_frames, s);
    sorter_.sort(in, key_, s);
    list_slots(s);
    order_entries(in.landmark_groups, in.chunk, s);
    frame_factors_.list(in.frame_groups, s);
    block_finder::clear(s);
  }
  /// The same without the lists of observations, which the policy makes.
  void build_frames(const structure_input& in, adjustment_structure& s) {
    s.frames = in.frames, s.landmarks = in.landmarks;
    order_frames(in.fixed_frames, s);
    frame_factors_.list(in.frame_groups, s);
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

  /// What each free frame has with each landmark.
  void list_slots(adjustment_structure& s) {
    const std::size_t n = sorter_.rows().size();
    s.landmark_slot.resize(at(s.landmarks) + 1);
    s.slot_coupling.resize(n + 1), s.slot_frame.resize(n), s.slot_landmark.resize(n);
    s.frame_slot.assign(at(s.free_frames) + 1, 0);
    std::int32_t couplings = 0, slots = 0;
    std::int32_t *const coupling = s.slot_coupling.data(), *const frame = s.slot_frame.data();
    std::int32_t *const landmark = s.slot_landmark.data(), *const of_frame = s.frame_slot.data() + 1;
    const row_sorter::ordered_row* const rows = sorter_.rows().data();
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
      const std::int32_t begin = sorter_.first_of_group()[g], end = sorter_.first_of_group()[g + 1];
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
      const row_sorter::ordered_row* const rows = sorter_.rows().data();
      for (std::int32_t l = 0; l < s.landmarks; ++l)
        for (std::int32_t r = s.landmark_row[at(l)], row_end = s.landmark_row[at(l) + 1]; r < row_end; ++r) {
          const row_sorter::ordered_row row = rows[r];
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

  row_sorter sorter_;
  frame_factor_lister frame_factors_;
  bin_lister list_by_bin_;
  plain_vector<std::int32_t> key_, counts_, frame_of_key_, frame_of_partial_;
};

}  // namespace turbomap

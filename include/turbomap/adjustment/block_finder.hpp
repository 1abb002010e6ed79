// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Finds the blocks of the reduced matrix: which pairs of free frames share a landmark or a factor, and what is summed into
/// the block of each pair.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "../config.hpp"
#include "../error.hpp"
#include "../plain_sort.hpp"
#include "../plain_vector.hpp"
#include "bin_lister.hpp"
#include "structure.hpp"

namespace turbomap {

/// Keep one and use it again: it owns the memory that it works in.
class block_finder {
 public:
  /// No blocks are known.
  static void clear(adjustment_structure& s) {
    s.block_row.clear(), s.block_column.clear(), s.pairs.clear(), s.factor_list.clear();
    s.block_pair.assign(1, 0), s.block_factor.assign(1, 0);
  }

  /// Pairs of slots of one landmark: what find() would list. O(landmarks), where the lists are here.
  static std::int64_t count_pairs(const adjustment_structure& s) {
    if (s.elsewhere) return s.sizes.pairs;
    std::int64_t pairs = 0;
    for (std::int32_t l = 0; l < s.landmarks; ++l) {
      const std::int64_t slots = s.landmark_slot[at(l) + 1] - s.landmark_slot[at(l)];
      pairs += slots * (slots - 1) / 2;
    }
    return pairs;
  }
  /// Blocks that find() would find, without their lists. O(pairs).
  std::int64_t count_blocks(const adjustment_structure& s) {
    list_factor_columns(s);
    shared_.assign(at(s.free_frames), -1);  // the last row that had this column
    std::int64_t blocks = 0;
    for (std::int32_t i = 0; i < s.free_frames; ++i) {
      const auto touch = [&](std::int32_t j) { blocks += shared_[at(j)] == i ? 0 : 1, shared_[at(j)] = i; };
      for_each_pair(s, i, [&](std::int32_t, std::int32_t t) { touch(s.slot_frame[at(t)]); });
      for (std::int32_t k = factor_begin_[at(i)]; k < factor_begin_[at(i) + 1]; ++k)
        touch(factor_column_[at(factor_order_[at(k)])]);
    }
    return blocks;
  }

  /// The blocks: for each free frame the later ones that share a landmark or a factor with it. Not needed by solvers that
  /// never form the reduced matrix. O(pairs).
  /// \throws std::invalid_argument  more pairs than an index can count
  void find(adjustment_structure& s) {
    const std::int64_t pairs = count_pairs(s);
    require(pairs <= std::numeric_limits<std::int32_t>::max(), "pairs of observations of one landmark", pairs,
            "are too many for this solver: take pcg");
    clear(s);
    list_factor_columns(s);
    const std::size_t n = at(s.free_frames);
    shared_.assign(n, 0), joined_.assign(n, 0), next_.resize(n), next_factor_.resize(n);
    for (std::int32_t i = 0; i < s.free_frames; ++i) {
      columns_.clear(), row_pairs_.clear();
      const auto touch = [&](std::int32_t j) {
        if (shared_[at(j)] == 0 && joined_[at(j)] == 0) columns_.push_back(j);
      };
      for_each_pair(s, i, [&](std::int32_t a, std::int32_t t) {
        const std::int32_t j = s.slot_frame[at(t)];
        touch(j), ++shared_[at(j)];
        row_pairs_.push_back({a, t});
      });
      for (std::int32_t k = factor_begin_[at(i)]; k < factor_begin_[at(i) + 1]; ++k) {
        const std::int32_t j = factor_column_[at(factor_order_[at(k)])];
        touch(j), ++joined_[at(j)];
      }
      sort_plain(columns_.data(), columns_.size());
      for (const auto j : columns_) {
        s.block_row.push_back(i), s.block_column.push_back(j);
        next_[at(j)] = s.block_pair.back(), next_factor_[at(j)] = s.block_factor.back();
        s.block_pair.push_back(s.block_pair.back() + shared_[at(j)]);
        s.block_factor.push_back(s.block_factor.back() + joined_[at(j)]);
        shared_[at(j)] = 0, joined_[at(j)] = 0;
      }
      s.pairs.resize(at(s.block_pair.back())), s.factor_list.resize(at(s.block_factor.back()));
      for (const auto& pair : row_pairs_) s.pairs[at(next_[at(s.slot_frame[at(pair.second)])]++)] = pair;
      for (std::int32_t k = factor_begin_[at(i)]; k < factor_begin_[at(i) + 1]; ++k) {
        const std::size_t f = at(factor_order_[at(k)]);
        s.factor_list[at(next_factor_[at(factor_column_[f])]++)] = factor_code_[f];
      }
    }
  }

 private:
  static std::size_t at(std::int32_t i) { return static_cast<std::size_t>(i); }

  /// Factors between two free frames, by the earlier one.
  void list_factor_columns(const adjustment_structure& s) {
    factor_row_.clear(), factor_code_.clear(), factor_column_.clear();
    std::int32_t factor = 0;
    for (const auto [a, b] : s.frame_pairs) {
      factor_row_.push_back(a >= 0 && b >= 0 ? std::min(a, b) : -1), factor_column_.push_back(std::max(a, b));
      factor_code_.push_back(2 * factor++ + (a > b ? 1 : 0));
    }
    list_by_bin_(factor_row_, s.free_frames, factor_begin_, factor_order_);
  }

  /// Calls function(slot of the frame, slot of a later frame) for all that see one landmark.
  template <class Function>
  static void for_each_pair(const adjustment_structure& s, std::int32_t frame, Function function) {
    for (std::int32_t k = s.frame_slot[at(frame)]; k < s.frame_slot[at(frame) + 1]; ++k) {
      const std::int32_t a = s.slot_list[at(k)], end = s.landmark_slot[at(s.slot_landmark[at(a)]) + 1];
      for (std::int32_t t = a + 1; t < end; ++t) function(a, t);
    }
  }

  plain_vector<slot_pair> row_pairs_;  ///< of one frame with the later ones
  plain_vector<std::int32_t> columns_, shared_, joined_, next_, next_factor_;
  plain_vector<std::int32_t> factor_row_, factor_column_, factor_code_, factor_begin_, factor_order_;
  bin_lister list_by_bin_;
};

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The order of observations: by landmark, and those of a landmark by frame, free frames first; equal ones stay in their order. Few
/// observations per landmark are sorted where they are, many by counting.

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "../plain_vector.hpp"
#include "../span.hpp"
#include "structure.hpp"
#include "structure_input.hpp"

namespace turbomap {

/// Keep one and use it again: it owns the memory that it works in.
class row_sorter {
 public:
  /// An observation in the order (landmark, frame).
  struct ordered_row {
    std::int32_t key;     ///< of its frame
    std::int32_t source;  ///< number among those of all groups
  };

  /// Sorts all observations by (landmark, frame), free frames first.
  /// \param key  [frame] its place in that order   \param s  gets landmark_row
  void sort(const structure_input& in, const plain_vector<std::int32_t>& key, adjustment_structure& s) {
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
      order_few(in.landmark_groups, key, place, s);
    else
      order_by_counting(in.landmark_groups, key, place, s);
  }

  /// All observations in order.
  const plain_vector<ordered_row>& rows() const { return rows_; }
  /// [group + 1] number of the first observation of a group among those of all groups.
  const plain_vector<std::int32_t>& first_of_group() const { return first_of_group_; }

 private:
  static std::size_t at(std::int32_t i) { return static_cast<std::size_t>(i); }

  struct row_by_frame {
    ordered_row row;
    std::int32_t landmark;
  };
  /// Observations of a landmark that are sorted where they are: beyond it, counting is faster.
  static constexpr std::int32_t most_in_place = 64;

  /// By landmark, then the few of each landmark where they are.
  void order_few(span<const landmark_group_input> groups, const plain_vector<std::int32_t>& key_of,
                 const std::int32_t* place, const adjustment_structure& s) {
    ordered_row* const rows = rows_.data();
    counts_.assign(s.landmark_row.begin(), s.landmark_row.end());
    std::int32_t o = 0;
    for (const auto& g : groups)
      for (std::size_t i = 0; i < g.frame.size(); ++i) {
        const std::int32_t l = place == nullptr ? g.landmark[i] : place[g.landmark[i]];
        rows[counts_[at(l)]++] = {key_of[at(g.frame[i])], o++};
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
  void order_by_counting(span<const landmark_group_input> groups, const plain_vector<std::int32_t>& key_of,
                         const std::int32_t* place, const adjustment_structure& s) {
    counts_.assign(at(s.frames) + 1, 0);
    for (const auto& g : groups)
      for (const auto f : g.frame) ++counts_[at(key_of[at(f)]) + 1];
    for (std::size_t i = 1; i < counts_.size(); ++i) counts_[i] += counts_[i - 1];
    by_frame_.resize(rows_.size());
    std::int32_t o = 0;
    for (const auto& g : groups)
      for (std::size_t i = 0; i < g.frame.size(); ++i) {
        const std::int32_t key = key_of[at(g.frame[i])];
        const std::int32_t l = place == nullptr ? g.landmark[i] : place[g.landmark[i]];
        by_frame_[at(counts_[at(key)]++)] = {{key, o++}, l};
      }
    counts_.assign(s.landmark_row.begin(), s.landmark_row.end());
    for (const auto& r : by_frame_) rows_[at(counts_[at(r.landmark)]++)] = r.row;
  }

  plain_vector<ordered_row> rows_;
  plain_vector<row_by_frame> by_frame_;
  plain_vector<std::int32_t> counts_, first_of_group_;
};

}  // namespace turbomap

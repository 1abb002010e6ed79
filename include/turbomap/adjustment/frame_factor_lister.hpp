// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The lists of factors without landmarks: what they give to each frame, and which frames they join.

#include <cstddef>
#include <cstdint>

#include "../plain_vector.hpp"
#include "../span.hpp"
#include "bin_lister.hpp"
#include "structure.hpp"
#include "structure_input.hpp"

namespace turbomap {

/// Keep one and use it again: it owns the memory that it works in.
class frame_factor_lister {
 public:
  /// What factors of one frame and between two give to their frames, and which frames they join.
  void list(span<const frame_group_input> groups, adjustment_structure& s) {
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

 private:
  static std::size_t at(std::int32_t i) { return static_cast<std::size_t>(i); }

  bin_lister list_by_bin_;
  plain_vector<std::int32_t> frame_of_factor_, frame_of_neighbour_, neighbour_order_;
  plain_vector<frame_neighbour> neighbour_;
};

}  // namespace turbomap

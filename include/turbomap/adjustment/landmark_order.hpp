// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The order in which solvers keep the landmarks of a problem: by the first free frame that sees them, then by the last one.
/// Landmarks that follow each other then share frames: what a block of the reduced matrix reads lies together, and of threads
/// that take equal shares of landmarks, chunks and blocks, each mostly reads what it wrote itself.

#include <cstddef>
#include <cstdint>

#include "../plain_vector.hpp"
#include "structure_input.hpp"

namespace turbomap {

/// Keep one and use it again: it owns its memory.
class landmark_order {
 public:
  /// Orders the landmarks of a problem; those of equal frames, and those that no free frame sees, which come last, keep
  /// their order. Indices must have been checked. O(observations + landmarks + frames).
  void find(const structure_input& in) {
    const auto none = static_cast<std::int32_t>(in.frames);
    first_.assign(at(in.landmarks), none), last_.assign(at(in.landmarks), 0);
    std::int32_t *const first = first_.data(), *const last = last_.data();
    const std::uint8_t* const fixed = in.fixed_frames.empty() ? nullptr : in.fixed_frames.data();
    for (const auto& g : in.landmark_groups) {
      const std::int32_t *const frame = g.frame.data(), *const landmark = g.landmark.data();
      for (std::size_t i = 0; i < g.frame.size(); ++i) {
        const std::int32_t f = frame[i], l = landmark[i];
        if (fixed != nullptr && fixed[f] != 0) continue;
        first[l] = f < first[l] ? f : first[l];
        last[l] = f > last[l] ? f : last[l];
      }
    }
    source_.resize(at(in.landmarks)), place_.resize(at(in.landmarks));
    for (std::int32_t l = 0; l < in.landmarks; ++l) place_[at(l)] = l;
    sort(last_, none, place_, source_);
    sort(first_, none, source_, place_);
    source_.swap(place_);
    for (std::int32_t l = 0; l < in.landmarks; ++l) place_[at(source_[at(l)])] = l;
  }

  /// Keeps the order of the caller.
  void keep(std::int32_t landmarks) {
    source_.resize(at(landmarks)), place_.resize(at(landmarks));
    for (std::int32_t l = 0; l < landmarks; ++l) source_[at(l)] = place_[at(l)] = l;
  }

  /// [place] landmark of the caller.
  const plain_vector<std::int32_t>& source() const { return source_; }
  /// [landmark of the caller] its place.
  const plain_vector<std::int32_t>& place() const { return place_; }

 private:
  static std::size_t at(std::int32_t i) { return static_cast<std::size_t>(i); }

  /// Sorts landmarks by a key from 0 to `most`; equal ones keep their order.
  void sort(const plain_vector<std::int32_t>& key, std::int32_t most, const plain_vector<std::int32_t>& from,
            plain_vector<std::int32_t>& to) {
    next_.assign(at(most) + 2, 0);
    for (const auto k : key) ++next_[at(k) + 1];
    for (std::size_t i = 1; i < next_.size(); ++i) next_[i] += next_[i - 1];
    for (const auto l : from) to[at(next_[at(key[at(l)])]++)] = l;
  }

  plain_vector<std::int32_t> first_, last_, source_, place_, next_;
};

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Who wins a keypoint that several pairs of a plan ask for: the first of them.

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "../plain_vector.hpp"
#include "creation_plan.hpp"

namespace turbomap {

/// Which keypoints of a query and of its neighbours first_claims() has given to a point. Keep one to keep its memory.
class claimed_keypoints {
 public:
  /// No keyframes; the memory stays.
  void clear() { taken_.clear(), begin_.clear(); }
  /// The next keyframe, none of whose keypoints is taken: the query first, then its neighbours in their order.
  void add_keyframe(int keypoints) {
    begin_.push_back(taken_.size());
    taken_.resize(taken_.size() + static_cast<std::size_t>(keypoints));
  }
  /// Takes both keypoints of a pair. False, and neither is taken, where one of them is an earlier pair's.
  /// \throws std::out_of_range  there is no such keypoint
  bool take(const created_point& p) {
    const std::size_t query = place(0, p.query);
    const std::size_t neighbour =
        place(p.neighbour < 0 ? begin_.size() : 1 + static_cast<std::size_t>(p.neighbour), p.candidate);
    if (taken_[query] != 0 || taken_[neighbour] != 0) return false;
    taken_[query] = taken_[neighbour] = 1;
    return true;
  }

 private:
  std::size_t place(std::size_t keyframe, std::int32_t keypoint) const {
    if (keyframe >= begin_.size()) throw std::out_of_range("turbomap::first_claims(): a neighbour that was not added");
    const std::size_t end = keyframe + 1 < begin_.size() ? begin_[keyframe + 1] : taken_.size();
    if (keypoint < 0 || static_cast<std::size_t>(keypoint) >= end - begin_[keyframe])
      throw std::out_of_range("turbomap::first_claims(): keyframe " + std::to_string(keyframe) + " has no keypoint " +
                              std::to_string(keypoint));
    return begin_[keyframe] + static_cast<std::size_t>(keypoint);
  }

  plain_vector<std::uint8_t> taken_;  ///< by keypoint of one keyframe after the other
  plain_vector<std::size_t> begin_;   ///< of each keyframe in taken_
};

/// The accepted points in (neighbour, query keypoint) order, as a map inserts them: a keypoint that an earlier point of the
/// plan was given to gets no second one, in the query and in every neighbour. O(points).
/// \param plan     all outcomes in (neighbour, query keypoint) order
/// \param claimed  has the query and every neighbour; keypoints that are given to a point are taken
/// \param result   overwritten; not the plan
template <class List, class Result>
void first_claims(const List& plan, claimed_keypoints& claimed, Result& result) {
  result.clear();
  for (const created_point& p : plan)
    if (p.outcome == creation_outcome::accepted && claimed.take(p)) result.push_back(p);
}
/// The same in memory of its own.
/// \param query_keypoints    keypoints of the query
/// \param neighbour_keypoints keypoints of each neighbour
template <class List = std::vector<created_point>>
List first_claims(const List& plan, int query_keypoints, const std::vector<int>& neighbour_keypoints) {
  claimed_keypoints claimed;
  claimed.add_keyframe(query_keypoints);
  for (const int keypoints : neighbour_keypoints) claimed.add_keyframe(keypoints);
  List result;
  first_claims(plan, claimed, result);
  return result;
}

}  // namespace turbomap

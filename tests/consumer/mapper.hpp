// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The user's mapper, written once for every execution policy: store, search, filters, creation.

#include <turbomap/context.hpp>
#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/filters.hpp>
#include <turbomap/matching/point_creation.hpp>
#include <turbomap/store/keyframe_store.hpp>

#include <vector>

#include "plans.hpp"

namespace my {

template <class Policy>
class mapper {
 public:
  using traits = turbomap::keyframe_traits<frame>;
  using camera = turbomap::pinhole<float>;
  using posed = turbomap::posed_keyframe<traits::descriptor, camera>;

  explicit mapper(const Policy& policy) : context_(policy), matches_(context_), points_(context_) {}

  void insert(const frame& f) {
    handles_.push_back(store_.insert(f));
    poses_.push_back(f.pose());
  }
  /// The last frame against all before it.
  plans map() {
    const auto pinned = store_.pin(context_, handles_);
    std::vector<posed> keyframes;
    for (std::size_t i = 0; i < pinned.size(); ++i) keyframes.push_back({pinned[i], poses_[i]});
    turbomap::search_correspondences(context_, keyframes.back(),
                                     turbomap::span<const posed>(keyframes.data(), keyframes.size() - 1), {}, matches_);
    turbomap::filter(context_, matches_, turbomap::mutual_best{}, turbomap::one_to_one{});
    turbomap::create_points(context_, matches_, {}, points_);
    return {matches_.plan(context_), points_.plan(context_, matches_)};
  }

 private:
  turbomap::context<Policy> context_;
  turbomap::keyframe_store<traits::descriptor, camera, turbomap::memory_of_t<Policy>> store_;
  std::vector<turbomap::keyframe_handle> handles_;
  std::vector<turbomap::rigid_transform<double>> poses_;
  turbomap::correspondences<traits::descriptor, camera, Policy> matches_;
  turbomap::point_creation<Policy> points_;
};

}  // namespace my

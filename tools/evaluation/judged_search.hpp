// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the evaluations on recorded data share: keyframes of one camera, searched in both ways, and points made of the
/// matches.

#include <thrust/execution_policy.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <turbomap/context.hpp>
#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/point_creation.hpp>
#include <turbomap/store/gather.hpp>
#include <turbomap/store/keyframe_store.hpp>
#include <type_traits>
#include <vector>

#include "reference/same_plans.hpp"

namespace turbomap::evaluation {

/// Keyframes by number, in the order of insert().
template <class Descriptor, class Camera>
class judged_search {
 public:
  using policy = std::decay_t<decltype(thrust::seq)>;
  using matches_type = correspondences<Descriptor, Camera, policy>;

  void insert(const Camera& camera, const std::vector<keypoint>& keypoints,
              const std::vector<std::uint8_t>& descriptors) {
    const auto rig = make_mono_rig(camera);
    keyframe_data<Descriptor, Camera> data;
    data.keypoint_count = static_cast<int>(keypoints.size());
    data.keypoints = keypoints.data();
    data.descriptors = descriptors.data();
    data.cameras = rig.cameras;
    data.camera_count = 1;
    data.bounds = bounds_of(keypoints);
    handles_.push_back(store_.insert(data));
  }
  std::size_t size() const { return handles_.size(); }

  /// Searches keyframe `query` against `neighbours`, none of whose keypoints holds a map point, and creates points.
  /// \param pose_of  keyframe -> T_cw
  /// \param judge    called with (search, plan of the matches, outcomes) while the keyframes are pinned
  template <class PoseOf, class Judge>
  void operator()(std::size_t query, const std::vector<std::size_t>& neighbours, PoseOf pose_of, search_options search,
                  const creation_options& creation, Judge judge) {
    std::vector<keyframe_handle> handles{handles_[query]};
    for (const std::size_t n : neighbours) handles.push_back(handles_[n]);
    const auto pinned = store_.pin(ctx_, handles);
    using posed = posed_keyframe<Descriptor, Camera>;
    const posed mine{pinned[0], pose_of(query), {}};
    std::vector<posed> others;
    for (std::size_t n = 0; n < neighbours.size(); ++n) others.push_back({pinned[n + 1], pose_of(neighbours[n]), {}});
    const span<const posed> all = others;
    search.candidate_set = candidates::exhaustive;
    search_correspondences(ctx_, mine, all, search, matches_);
    const auto exhaustive = matches_.plan(ctx_);
    search.candidate_set = candidates::epipolar_ordered;
    const auto start = std::chrono::steady_clock::now();
    search_correspondences(ctx_, mine, all, search, matches_);
    ordered_ms_ += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    const auto plan = matches_.plan(ctx_);
    if (!turbomap_test::same(plan, exhaustive)) ++ordered_differs_;
    create_points(ctx_, matches_, creation, creation_);
    judge(matches_.view(), plan, creation_.plan(ctx_, matches_));
  }

  double ordered_ms() const { return ordered_ms_; }                 ///< all epipolar-ordered searches
  std::size_t ordered_differs() const { return ordered_differs_; }  ///< searches whose two ways disagreed

 private:
  keyframe_store<Descriptor, Camera> store_;
  context<policy> ctx_{thrust::seq};
  matches_type matches_{ctx_};
  point_creation<policy> creation_{ctx_};
  std::vector<keyframe_handle> handles_;
  double ordered_ms_ = 0;
  std::size_t ordered_differs_ = 0;
};

}  // namespace turbomap::evaluation

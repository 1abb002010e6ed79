// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A recorded map (.kfm) as a map of the library: keyframes of one moment are one keyframe, its good landmarks are points.
/// Where such a keyframe sees two landmarks by one keypoint, the map is told of the first only: the pair is a duplicate.

#include <thrust/execution_policy.h>

#include <cstring>
#include <map>
#include <set>
#include <turbomap/camera/brown_conrady.hpp>
#include <turbomap/context.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>
#include <turbomap/mapping/appearance_update.hpp>
#include <turbomap/mapping/handle_table.hpp>
#include <turbomap/store/keyframe_store.hpp>
#include <type_traits>
#include <utility>
#include <vector>

#include "keyframe_map.hpp"

namespace turbomap::evaluation {

/// Two good landmarks of the source at one keypoint.
struct landmark_pair {
  std::size_t keyframe;  ///< of the map
  std::size_t keypoint;
  std::int32_t held;      ///< the landmark of the earlier submap: its point is in the slot
  std::int32_t withheld;  ///< the other one: its point lacks this observation
};

/// Raw pixels, one octave. Landmarks and keyframes of the source are named by their numbers.
class landmark_map {
 public:
  using descriptor = binary_descriptor<384>;
  using camera_type = brown_conrady<double>;
  using map_type = simple_map<descriptor, camera_type>;
  using traits = map_traits<map_type>;
  using policy = std::decay_t<decltype(thrust::seq)>;
  using store_type = keyframe_store<descriptor, camera_type>;
  using view = std::pair<std::size_t, std::size_t>;  ///< keyframe, keypoint

  explicit landmark_map(const keyframe_map& source) : source_(source) {
    require(source.descriptor_bytes == descriptor::bytes, "descriptor_bytes", source.descriptor_bytes, "must be 48");
    point_of_.resize(source.landmarks.size());
    seen_.resize(source.landmarks.size());
    std::map<std::uint64_t, std::size_t> at_time;
    for (std::size_t k = 0; k < source.keyframes.size(); ++k) {
      const auto [at, is_new] = at_time.insert({source.keyframes[k].t_ns, keyframes_.size()});
      if (is_new)
        insert(source.keyframes[k]);
      else
        require_same(source.keyframes[k], *of_source_[at->second]);
      for (std::size_t i = 0; i < source.keyframes[k].landmarks.size(); ++i)
        see(at->second, i, source.keyframes[k].landmarks[i]);
    }
    update_appearance(all_points());
  }

  map_type map{1};
  store_type store;
  handle_table stored;
  context<policy> ctx{thrust::seq};

  const keyframe_map& source() const { return source_; }
  const std::vector<map_keyframe_id>& keyframes() const { return keyframes_; }
  const map_keyframe& of_source(std::size_t keyframe) const { return *of_source_[keyframe]; }
  /// The point that was made of a landmark; map_point_id{}: it is not good, or the map saw nothing of it.
  map_point_id point_of(std::int32_t landmark) const { return point_of_[static_cast<std::size_t>(landmark)]; }
  /// What the source says, whether the map was told of it or not.
  const std::set<view>& seen_at(std::int32_t landmark) const { return seen_[static_cast<std::size_t>(landmark)]; }
  /// By keyframe, keypoint.
  const std::vector<landmark_pair>& pairs() const { return pairs_; }

  /// Medoids and normals of points from the observations that the map has.
  void update_appearance(const std::vector<map_point_id>& points) {
    appearance_options options;
    options.scales.levels = 1;
    guard_times unused;
    appearance_({ctx, map, store, stored, unused}, span<const map_point_id>(points), options);
  }

 private:
  void insert(const map_keyframe& k) {
    std::vector<keypoint> keypoints(k.pixels.size());
    for (std::size_t i = 0; i < keypoints.size(); ++i) keypoints[i].x = k.pixels[i].x, keypoints[i].y = k.pixels[i].y;
    const auto previous = keyframes_.empty() ? map_keyframe_id{} : keyframes_.back();
    keyframes_.push_back(
        map.add_keyframe(span<const keypoint>(keypoints), k.T_cw, 1e-9 * static_cast<double>(k.t_ns), previous));
    of_source_.push_back(&k);
    const auto rig = make_mono_rig(source_.camera);
    keyframe_data<descriptor, camera_type> data;
    data.keypoint_count = static_cast<int>(keypoints.size());
    data.keypoints = keypoints.data();
    data.descriptors = k.descriptors.data();
    data.cameras = rig.cameras;
    data.camera_count = 1;
    data.bounds = {0, 0, static_cast<float>(source_.width), static_cast<float>(source_.height)};
    stored.add(traits::id(map, keyframes_.back()), store.insert(data));
  }
  static void require_same(const map_keyframe& a, const map_keyframe& b) {
    const bool same = a.pixels.size() == b.pixels.size() && a.descriptors == b.descriptors &&
                      std::memcmp(&a.T_cw, &b.T_cw, sizeof a.T_cw) == 0;
    require(same, "t_ns", a.t_ns, "two keyframes of one moment must be the same image and pose");
  }
  /// Keyframe `k` sees a landmark.
  void see(std::size_t k, std::size_t i, std::int32_t landmark) {
    if (landmark < 0 || !source_.landmarks[static_cast<std::size_t>(landmark)].good()) return;
    seen_[static_cast<std::size_t>(landmark)].insert({k, i});
    if (map.point_at(keyframes_[k], i) != map_point_id{}) {
      pairs_.push_back({k, i, holder_.at({k, i}), landmark});
      return;
    }
    map_point_id& p = point_of_[static_cast<std::size_t>(landmark)];
    if (p == map_point_id{})
      p = map.add_point(source_.landmarks[static_cast<std::size_t>(landmark)].position, keyframes_[k]);
    require(observe(map, p, keyframes_[k], i), "landmark", landmark, "is seen twice by one keyframe");
    holder_[{k, i}] = landmark;
  }
  std::vector<map_point_id> all_points() const {
    std::vector<map_point_id> all;
    traits::for_each_point(map, [&](map_point_id p) { all.push_back(p); });
    return all;
  }

  const keyframe_map& source_;
  std::vector<map_keyframe_id> keyframes_;
  std::vector<const map_keyframe*> of_source_;
  std::vector<map_point_id> point_of_;
  std::vector<std::set<view>> seen_;
  std::map<view, std::int32_t> holder_;
  std::vector<landmark_pair> pairs_;
  appearance_update<map_type, policy> appearance_{ctx};
};

}  // namespace turbomap::evaluation

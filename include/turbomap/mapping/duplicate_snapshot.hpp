// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From a user's map to the arrays of a duplicate search: points with what a search reads of them, and who sees them already.

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../fusion/duplicate_options.hpp"
#include "../map/map_traits.hpp"
#include "../map/number_points.hpp"
#include "../map/numbering.hpp"
#include "../map/read_ahead.hpp"
#include "../map/validate.hpp"
#include "../plain_vector.hpp"
#include "keyframe_selection.hpp"
#include "look_again.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The snapshot of one search. Make one and use it again: its memory is reused. The caller holds the guard while the map is
/// read.
template <class Map>
class duplicate_snapshot {
 public:
  /// @{
  /// Types of the map, as its traits name them.
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using descriptor = typename traits::descriptor;
  /// @}

  /// No points. \param covariances  points come with their covariances, where the map keeps them; false: points are exact
  void clear(bool covariances = false) {
    keeps_covariances_ = covariances;
    seen_.clear(), taken_in_.clear();
    points_.clear();
    positions_.clear(), normals_.clear(), min_distances_.clear(), max_distances_.clear(), descriptors_.clear();
    covariances_.clear();
    observed_.clear();
  }
  /// Takes in the live points of a keyframe, in the order of its keypoints, each point once. `faults` is told of
  /// those that have no descriptor: they are left out. O(keypoints).
  void add_points_of(const Map& map, keyframe k, fault_sink faults = {}) {
    add_points_of(map, k, 0, keypoint_count_of(map, k), faults);
  }
  /// The same of its keypoints [begin, end).
  void add_points_of(const Map& map, keyframe k, std::size_t begin, std::size_t end, fault_sink faults) {
    const std::size_t known = seen_.size();
    unseen_.clear();
    number_points_of(map, k, begin, end, seen_, scratch_, [&](const point& p, std::size_t, bool is_new) {
      if (is_new) unseen_.push_back(p);
    });
    taken_in_.resize(seen_.size(), -1);
    for_each_ahead<point_data::entry + point_data::appearance>(
        map, unseen_.size(), [&](std::size_t i) -> const point& { return unseen_[i]; },
        [&](std::size_t i, const point& p) { take_in(map, p, known + i, faults); });
  }
  /// What depends on where they are of the points that are alive, anew: somebody has moved keyframes since.
  void read_positions(const Map& map) {
    turbomap::read_positions(map, points_, positions_);
    for (std::size_t p = 0; p < points_.size(); ++p) {
      if (!traits::alive(map, points_[p])) continue;
      normals_[p] = traits::normal(map, points_[p]);
      min_distances_[p] = traits::min_distance(map, points_[p]);
      max_distances_[p] = traits::max_distance(map, points_[p]);
      if constexpr (detail::map_has_v<Map, detail::map_covariance_member>)
        if (keeps_covariances_) covariances_[p] = traits::covariance(map, points_[p]);
    }
  }
  /// Takes in one point if it is alive, the first time that it is named.
  void add_point(const Map& map, point p, fault_sink faults = {}) {
    if (p == point{} || !traits::alive(map, p)) return;
    const std::size_t known = seen_.size();
    if (seen_.place(map, p) != known) return;
    taken_in_.push_back(-1);
    take_in(map, p, known, faults);
  }
  /// Notes which targets see the points already, by the lists of the points. `faults` is told of views by keypoints that the
  /// target does not have.
  /// \param first  it has been noted of the points before this one
  /// O(views of these points).
  void note_observed(const Map& map, const keyframe_selection<Map>& targets, fault_sink faults = {},
                     std::size_t first = 0) {
    const std::size_t noted = observed_.size();
    for_each_ahead<point_data::entry + point_data::views>(
        map, points_.size() - first, [&](std::size_t p) { return points_[first + p]; },
        [&](std::size_t p, const point& name) {
          traits::for_each_observation(map, name, [&](keyframe k, std::size_t i) {
            const std::size_t target = targets.find(map, k);
            if (target != id_table::none) note(map, k, i, target, first + p, faults);
          });
        });
    for (std::size_t v = noted; v < observed_.size(); ++v)  // now that the keypoints are there
      observed_[v].camera = keypoint_of(map, targets[observed_[v].target], observed_[v].keypoint).camera;
  }
  /// The same of a single target, if it is alive, by its slots, which are fewer than the views of all points. All points have been
  /// taken in. O(keypoints).
  void note_observed_by(const Map& map, const keyframe& target) {
    if (!traits::alive(map, target)) return;
    for_each_slot_ahead<static_cast<unsigned>(point_data::entry)>(map, target, [&](std::size_t i, const point& p) {
      if (p == point{} || !traits::alive(map, p)) return;
      const std::size_t known = seen_.find(map, p);
      if (known != point_numbering<Map>::none && taken_in_[known] >= 0)
        observed_.push_back({0, static_cast<std::uint32_t>(taken_in_[known]), static_cast<std::uint32_t>(i),
                             keypoint_of(map, target, i).camera});
    });
  }
  /// Makes skip() of what was noted of the targets from `first` on; needs no guard. \param cameras  of each of them
  void mark_observed(const plain_vector<int>& cameras, std::size_t first = 0) {
    begin_.assign(1, 0);
    for (const int c : cameras) begin_.push_back(begin_.back() + static_cast<std::size_t>(c) * points_.size());
    skip_.assign(begin_.back(), 0);
    for (const view& v : observed_) {
      const std::size_t t = v.target - first;  // wraps where it is before the first
      if (t < cameras.size() && v.camera < static_cast<std::size_t>(cameras[t]))
        skip_[begin_[t] + v.camera * points_.size() + v.point] = 1;
    }
  }
  /// All cameras but one of a target are left out: for a search camera by camera.
  void leave_out_other_cameras(std::size_t target, int cameras, int camera) {
    for (int c = 0; c < cameras; ++c)
      if (c != camera)
        std::fill_n(
            skip_.begin() + static_cast<std::ptrdiff_t>(begin_[target] + static_cast<std::size_t>(c) * points_.size()),
            points_.size(), std::uint8_t{1});
  }

  /// The points as a search takes them; valid until points are added.
  map_point_view<descriptor> points_view() const {
    return {static_cast<int>(points_.size()),
            positions_.data(),
            normals_.data(),
            min_distances_.data(),
            max_distances_.data(),
            descriptors_.data(),
            covariances_.empty() ? nullptr : covariances_.data()};
  }
  /// The points, in the order of their numbers.
  const list_of<point>& points() const { return points_; }
  /// Of each point, or of none: for maps that do not keep them.
  plain_vector<point_covariance>& covariances() { return covariances_; }
  /// What find_duplicates() takes: [camera][point]. \param target  counted from the first that was marked
  span<const std::uint8_t> skip(std::size_t target) const {
    return {skip_.data() + begin_[target], begin_[target + 1] - begin_[target]};
  }

 private:
  struct view {
    std::uint32_t target, point, keypoint, camera;
  };

  void note(const Map& map, keyframe k, std::size_t keypoint, std::size_t target, std::size_t p, fault_sink faults) {
    if (keypoint >= keypoint_count_of(map, k))
      return faults({map_fault::keypoint_out_of_range, traits::id(map, k), traits::id(map, points_[p]), keypoint});
    ask_for_keypoint(map, k, keypoint);
    observed_.push_back(
        {static_cast<std::uint32_t>(target), static_cast<std::uint32_t>(p), static_cast<std::uint32_t>(keypoint), 0});
  }
  /// \param number  that the point has got
  void take_in(const Map& map, const point& p, std::size_t number, fault_sink faults) {
    if (!traits::alive(map, p)) return;
    if (!add_descriptor(map, p)) return faults({map_fault::no_descriptor, 0, traits::id(map, p), 0});
    taken_in_[number] = static_cast<std::int32_t>(points_.size());
    points_.push_back(p);
    positions_.push_back(position_of(map, p));
    normals_.push_back(traits::normal(map, p));
    min_distances_.push_back(traits::min_distance(map, p));
    max_distances_.push_back(traits::max_distance(map, p));
    if constexpr (detail::map_has_v<Map, detail::map_covariance_member>)
      if (keeps_covariances_) covariances_.push_back(traits::covariance(map, p));
  }
  bool add_descriptor(const Map& map, point p) {
    const auto& given = traits::descriptor_data(map, p);  // valid until the next call
    const auto* const elements = detail::elements_of<descriptor>(given);
    if (elements != nullptr) descriptors_.append(elements, descriptor::elements);
    return elements != nullptr;
  }

  point_numbering<Map> seen_;
  plain_vector<std::int32_t> taken_in_;  ///< by number: which of points_ it is; -1: dead, or without a descriptor
  list_of<point> points_, unseen_, scratch_;
  plain_vector<vec3<double>> positions_;
  plain_vector<vec3<float>> normals_;
  plain_vector<float> min_distances_, max_distances_;
  plain_vector<point_covariance> covariances_;  ///< empty: points are exact
  plain_vector<typename descriptor::element> descriptors_;
  list_of<view> observed_;
  plain_vector<std::size_t> begin_;
  plain_vector<std::uint8_t> skip_;
  bool keeps_covariances_ = false;
};

TURBOMAP_END_NAMESPACE

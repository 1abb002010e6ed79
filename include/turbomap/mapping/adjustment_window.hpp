// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What an adjustment takes of the user's map: keyframes that move, keyframes that hold them in place, the points that
/// they see, and every observation of these points.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/covisibility.hpp"
#include "../map/map_traits.hpp"
#include "../map/number_points.hpp"
#include "../map/numbering.hpp"
#include "../map/read_ahead.hpp"
#include "../map/validate.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "keyframe_selection.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Free are the keyframe, those that share enough points with it and, if asked for, with one of those; all their points are
/// free; other keyframes that see these points are fixed, and so is the origin of the map (optional member
/// is_origin(map, keyframe) of the traits). Where nothing would be fixed, the oldest keyframe is. Keyframes that are not in the
/// store are passed over.
template <class Map>
class adjustment_window {
 public:
  /// @{
  /// Types of the map, as its traits name them.
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  /// @}

  /// One observation: a row of the problem.
  struct row {
    std::int32_t frame;     ///< number in frames()
    std::int32_t landmark;  ///< number in points()
    std::int32_t keypoint;  ///< keypoint index, within the keyframe
  };

  /// Chooses the keyframes that move; read() adds the rest. The caller holds the guard, here and in all that choose or read.
  /// \param current  alive and in the store
  /// \param second_min_shared_points  0: no keyframes of the second order
  /// \param most_keyframes  that are not fixed, best covisible ones first; 0: all
  /// \throws inconsistent_map  a pose that cannot be used; where the scope notes faults, these are passed over. Empty where
  ///         the pose is that of `current`
  template <class Policy>
  void choose(const mapping_scope<Map, Policy>& s, keyframe current, int min_shared_points,
              int second_min_shared_points, int most_keyframes) {
    const Map& map = s.map;
    const std::size_t most = most_keyframes == 0 ? no_limit : static_cast<std::size_t>(most_keyframes);
    clear();
    if (add_frame(s, current, role::free) == id_table::none) return;
    const auto can_use = [&](keyframe k) { return s.can_use(k); };
    for (const auto& c : covisibility_(map, current, min_shared_points, most - 1, can_use))
      add_frame(s, c.keyframe, role::free);
    const std::size_t first_order = second_min_shared_points > 0 ? frames_.size() : 0;
    for (std::size_t f = 1; f < first_order && frames_.size() < most; ++f)
      for (const auto& c : covisibility_(map, frames_[f], second_min_shared_points, no_limit, can_use))
        if (frames_.size() < most) add_frame(s, c.keyframe, role::free);
    local_ = frames_.size();
  }
  /// Reads points of the keyframes that move, with their observations: the next `most` slots. \return whether some are left
  /// \throws inconsistent_map  an observation by a dead keyframe, or by a keypoint that its keyframe does not have, a position that
  ///         cannot be used; where the scope notes faults, these are passed over
  /// In all O(observations of the points of the free keyframes).
  template <class Policy>
  bool read(const mapping_scope<Map, Policy>& s, std::size_t most) {
    if (read_slots(s.map, most, [&](const point& p) { add_point(s, p, role::fixed); })) return true;
    if (local_ > 0) hold_something(local_);
    return false;
  }
  /// Between two calls of read() others may have moved keyframes: poses and positions are read anew then, so that all are of
  /// one time.
  template <class Policy>
  void resume(const mapping_scope<Map, Policy>& s) {
    if (frames_.read_poses(s.map)) read_positions(s.map, points_, positions_);
  }
  /// All keyframes that are connected with one through shared points are free, but for the origin: read_connected() finds them.
  /// \param anyone  alive and in the store
  template <class Policy>
  void choose_connected(const mapping_scope<Map, Policy>& s, keyframe anyone) {
    clear();
    if (add_frame(s, anyone, role::free) != id_table::none) local_ = 1;
  }
  /// As read(), of the keyframes that are found on the way too. A keyframe whose points are all known costs time as well: looking
  /// at so many of its keypoints counts as a slot.
  template <class Policy>
  bool read_connected(const mapping_scope<Map, Policy>& s, std::size_t most) {
    const auto visit = [&](const point& p) {
      add_point(s, p, role::free);
      local_ = frames_.size();
    };
    constexpr std::size_t keypoints_per_slot = 16;  // each is a look into an array; a slot is a point and who sees it
    if (read_slots(s.map, most, visit, keypoints_per_slot)) return true;
    if (local_ > 0) hold_something(local_);
    return false;
  }
  /// These keyframes are free, but for the origin. read() adds the rest; dead ones are passed over.
  template <class Policy>
  void choose_these(const mapping_scope<Map, Policy>& s, span<const keyframe> keyframes) {
    clear();
    for (const keyframe& k : keyframes)
      if (!(k == keyframe{}) && traits::alive(s.map, k)) add_frame(s, k, role::free);
    local_ = frames_.size();
  }
  /// Nothing is in the window; the memory stays.
  void clear() {
    frames_.clear(), fixed_.clear(), keypoint_counts_.clear();
    point_numbers_.clear(), points_.clear(), positions_.clear();
    rows_frame_.clear(), rows_landmark_.clear(), rows_keypoint_.clear();
    local_ = next_frame_ = next_slot_ = 0;
  }

  /// The keyframes, in the order of their numbers.
  const keyframe_selection<Map>& frames() const { return frames_; }
  const plain_vector<std::uint8_t>& fixed() const { return fixed_; }  ///< by frame
  /// The points, in the order of their numbers.
  const list_of<point>& points() const { return points_; }
  const plain_vector<vec3<double>>& positions() const { return positions_; }  ///< by point, world, m
  /// Number of observations.
  std::size_t row_count() const { return rows_frame_.size(); }
  /// Observation i (not checked).
  row at(std::size_t i) const { return {rows_frame_[i], rows_landmark_[i], rows_keypoint_[i]}; }
  /// Of each observation, its frame.
  const plain_vector<std::int32_t>& frame_of_row() const { return rows_frame_; }
  /// Of each observation, its point.
  const plain_vector<std::int32_t>& landmark_of_row() const { return rows_landmark_; }
  /// Of each observation, the keypoint index within its keyframe.
  const plain_vector<std::int32_t>& keypoint_of_row() const { return rows_keypoint_; }

 protected:
  /// Whether the map says that a keyframe is its frame of reference.
  static bool is_origin([[maybe_unused]] const Map& map, [[maybe_unused]] keyframe k) {
    if constexpr (detail::map_has_v<Map, detail::map_origin_member>)
      return traits::is_origin(map, k);
    else
      return false;
  }
  /// What a keyframe comes in as. A free one is fixed all the same where it is the origin or no longer in the map.
  enum class role { free, fixed };
  /// Adds a keyframe, unless it is there. \return its number, or id_table::none when it is not in the store
  template <class Policy>
  std::size_t add_frame(const mapping_scope<Map, Policy>& s, keyframe k, role as) {
    const std::size_t known = frames_.size(), at = frames_.place(s.map, k, s.stored, s.faults);
    if (at == known) {
      fixed_.push_back(as == role::fixed || is_origin(s.map, k) || !traits::alive(s.map, k) ? 1 : 0);
      keypoint_counts_.push_back(keypoint_count_of(s.map, k));
    }
    return at;
  }
  /// Takes in a point that is alive, has a position and is not there yet. \return whether it was
  template <class Policy>
  bool place_point(const mapping_scope<Map, Policy>& s, point p, std::size_t& number) {
    const Map& map = s.map;
    number = points_.size();
    if (p == point{} || !traits::alive(map, p)) return false;
    if (!has_finite_position(map, p)) {
      s.faults({map_fault::position_not_finite, 0, traits::id(map, p), 0});
      return false;
    }
    if (point_numbers_.place(map, p) != number) return false;
    points_.push_back(p);
    positions_.push_back(position_of(map, p));
    return true;
  }
  /// Adds an observation, unless the keyframe has no such keypoint: that is a fault.
  template <class Policy>
  void add_row(const mapping_scope<Map, Policy>& s, std::size_t f, std::size_t number, std::size_t keypoint) {
    if (keypoint >= keypoint_counts_[f])
      return s.faults(
          {map_fault::keypoint_out_of_range, frames_.ids()[f], traits::id(s.map, points_[number]), keypoint});
    rows_frame_.push_back(static_cast<std::int32_t>(f));
    rows_landmark_.push_back(static_cast<std::int32_t>(number));
    rows_keypoint_.push_back(static_cast<std::int32_t>(keypoint));
  }
  /// Reads one part of the frames that move: calls visit(point) for their next `most` slots, beginning where the call before ended.
  /// \param most  is reduced by what was read
  /// \param keypoints_per_slot  to look at so many keypoints of a frame counts as one slot; 0: looking does not count
  /// \return whether slots are left
  template <class Visit>
  bool read_slots(const Map& map, std::size_t& most, Visit visit, std::size_t keypoints_per_slot = 0) {
    for (; next_frame_ < local_ && most > 0; ++next_frame_, next_slot_ = 0) {
      if (!traits::alive(map, frames_[next_frame_])) continue;  // erased between two calls
      if (next_slot_ == 0) {
        slots_ = list_points_of(map, next_frame_);
        const std::size_t looks = keypoints_per_slot == 0 ? 0 : keypoint_counts_[next_frame_] / keypoints_per_slot;
        most = looks < most ? most - looks : slots_ > 0 ? 1 : 0;  // a part reads something, or passes over a frame
      }
      const std::size_t begin = next_slot_;
      next_slot_ = slots_ - begin < most ? slots_ : begin + most;
      visit_listed(map, next_frame_, begin, next_slot_, visit);
      most -= next_slot_ - begin;
      if (next_slot_ < slots_) return true;
    }
    return next_frame_ < local_;
  }

 private:
  /// \return how many slots of frame f visit_listed() has to look at
  std::size_t list_points_of(const Map& map, std::size_t f) {
    const std::size_t keypoints = keypoint_count_of(map, frames_[f]);
    if constexpr (point_numbering<Map>::indexed) {
      // Keyframes of a window share their points, so most points are in it already. Whether one is costs a look into an array.
      list_points_in(map, frames_[f], 0, keypoints, unplaced_,
                     [&](const point& p) { return point_numbers_.find(map, p) == id_table::none; });
      return unplaced_.size();
    } else {
      return keypoints;
    }
  }
  /// The points of the listed slots [begin, end).
  template <class Visit>
  void visit_listed(const Map& map, std::size_t f, std::size_t begin, std::size_t end, Visit visit) {
    const auto at = [&](std::size_t i) {
      if constexpr (point_numbering<Map>::indexed)
        return unplaced_[begin + i];
      else
        return traits::point_at(map, frames_[f], begin + i);
    };
    for_each_ahead<point_data::entry + point_data::views>(map, end - begin, at,
                                                          [&](std::size_t, const point& p) { visit(p); });
  }
  /// Adds a point and all of its observations, unless it is there.
  /// \param observers  what keyframes come in as that see it
  template <class Policy>
  void add_point(const mapping_scope<Map, Policy>& s, point p, role observers) {
    std::size_t number;
    if (!place_point(s, p, number)) return;
    traits::for_each_observation(s.map, p, [&](keyframe k, std::size_t keypoint) {
      std::size_t f = frames_.find(s.map, k);
      if (f == id_table::none) {  // only then: whether a keyframe is alive costs a lock in some maps
        if (k == keyframe{} || !traits::alive(s.map, k))
          return s.faults({map_fault::observer_not_alive, 0, traits::id(s.map, p), keypoint});
        f = add_frame(s, k, observers);
      }
      if (f != id_table::none) add_row(s, f, number, keypoint);
    });
  }
  /// Where no keyframe is fixed, fixes the oldest of the first `local`.
  void hold_something(std::size_t local) {
    for (const auto fixed : fixed_)
      if (fixed != 0) return;
    std::size_t oldest = 0;
    for (std::size_t f = 1; f < local; ++f)
      if (frames_.ids()[f] < frames_.ids()[oldest]) oldest = f;
    fixed_[oldest] = 1;
  }

 protected:
  keyframe_selection<Map> frames_;             ///< the keyframes, fixed ones included
  plain_vector<std::uint8_t> fixed_;           ///< 1: does not move; by frame
  plain_vector<std::size_t> keypoint_counts_;  ///< by frame
  point_numbering<Map> point_numbers_;         ///< from points of the map to their numbers
  list_of<point> points_;                      ///< the points
  plain_vector<vec3<double>> positions_;       ///< by point, world, m
  /// @{
  /// Columns of the observations.
  plain_vector<std::int32_t> rows_frame_, rows_landmark_, rows_keypoint_;
  /// @}
  std::size_t local_ = 0;       ///< frames whose points are read
  std::size_t next_frame_ = 0;  ///< the first of them that is not read to its end
  std::size_t next_slot_ = 0;   ///< of it, what is read next

 private:
  covisibility<Map> covisibility_;
  list_of<point> unplaced_;  ///< of the frame that is read: its points that are not in the window
  std::size_t slots_ = 0;    ///< how many they are
};

TURBOMAP_END_NAMESPACE

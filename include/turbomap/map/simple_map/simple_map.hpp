// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A plain map of our own: flat arrays, every reference an index with a generation, no pointers. For the examples, the
/// replay and for users who have no map of theirs. Everything that is done to it goes through its map_traits, as for any
/// other map.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "../../config.hpp"
#include "../../error.hpp"
#include "../../plain_vector.hpp"
#include "../../span.hpp"
#include "../../types.hpp"
#include "../map_traits.hpp"
#include "map_ids.hpp"
#include "observation_pool.hpp"

namespace turbomap {

/// Keyframes with slots, points with observations. Not synchronised: one writer, or the caller's lock. Members throw
/// std::invalid_argument for an id that is stale or never was, and for an index out of range.
template <class Descriptor, class Camera>
class simple_map {
 public:
  using descriptor_type = Descriptor;            ///< of keypoints and points.
  using camera_type = Camera;                    ///< of keyframes.
  using element = typename Descriptor::element;  ///< of a descriptor.

  /// \param levels  of the image pyramid: observations are counted by octave
  explicit simple_map(int levels = pyramid{}.levels) : levels_(static_cast<std::size_t>(levels)) {
    require(levels >= 1 && levels <= 256, "levels", levels, "must be in [1, 256]: octaves are bytes");
  }

  // Poses and positions by value: they may be those of this map, whose lists grow here.

  /// Adds a keyframe without points. Strong guarantee. \param time_s  of the image; \param previous  in time, if there is one
  map_keyframe_id add_keyframe(span<const keypoint> keypoints, rigid_transform<double> T_cw, double time_s = 0,
                               map_keyframe_id previous = {}) {
    for (std::size_t i = 0; i < keypoints.size(); ++i)
      require(keypoints[i].octave < levels_, "keypoints[].octave", static_cast<int>(keypoints[i].octave),
              "is not a level of the map's pyramid");
    if (previous != map_keyframe_id{}) check(previous);
    plain_vector<keypoint> copy(keypoints.data(), keypoints.data() + keypoints.size());
    plain_vector<map_point_id> slots(keypoints.size());
    make_room(keyframes_, keyframe_places_.size() + 1);
    const std::int32_t k = keyframe_places_.take();
    if (static_cast<std::size_t>(k) == keyframes_.size()) keyframes_.emplace_back();
    auto& entry = keyframes_[static_cast<std::size_t>(k)];
    const std::uint32_t generation = keyframe_places_.generation(k);
    entry = {std::move(copy), std::move(slots), T_cw, time_s, next_keyframe_++, generation, none, none};
    if (previous != map_keyframe_id{}) {
      link(k, keyframes_[static_cast<std::size_t>(previous.index)].next);
      link(previous.index, k);
    }
    return {k, generation};
  }

  /// Adds a point (world, m) without observations. Strong guarantee.
  map_point_id add_point(vec3<double> position, map_keyframe_id reference = {}) {
    if (reference != map_keyframe_id{}) check(reference);
    const std::size_t size = point_places_.size() + 1;
    make_room(positions_, size), make_room(normals_, size), make_room(ranges_, size), make_room(points_, size);
    make_room(covariances_, size), make_room(descriptors_, size * elements), make_room(counts_, size * levels_);
    observations_.open(size - 1);
    const std::int32_t p = point_places_.take();
    const auto at = static_cast<std::size_t>(p);
    if (at == points_.size()) {
      positions_.push_back({}), normals_.push_back({}), ranges_.push_back({}), points_.push_back({});
      covariances_.push_back({});
      descriptors_.resize(descriptors_.size() + elements);
      counts_.resize(counts_.size() + levels_);
    }
    positions_[at] = position;
    normals_[at] = {};
    ranges_[at] = {};
    covariances_[at] = {};
    std::fill_n(descriptors_.begin() + static_cast<std::ptrdiff_t>(at * elements), elements, element{});
    std::fill_n(counts_.begin() + static_cast<std::ptrdiff_t>(at * levels_), levels_, 0u);
    points_[at] = {next_point_++, reference, {}, 1, 1};
    return {p, point_places_.generation(p)};
  }

  /// Whether it is in the map; an id that never was one is not.
  bool alive(map_keyframe_id k) const {
    return keyframe_places_.known(k.index, k.generation) && keyframe_places_.alive(k.index);
  }
  /// Whether it is in the map; an id that never was one is not.
  bool alive(map_point_id p) const {
    return point_places_.known(p.index, p.generation) && point_places_.alive(p.index);
  }
  /// Keyframes in the map.
  std::size_t keyframe_count() const { return keyframe_places_.alive_count(); }
  /// Points in the map.
  std::size_t point_count() const { return point_places_.alive_count(); }
  /// Of all points. O(points).
  std::size_t observation_count() const {
    std::size_t count = 0;
    for (std::size_t p = 0; p < points_.size(); ++p) count += observations_.of(p).size();
    return count;
  }
  /// Of the image pyramid.
  int levels() const { return static_cast<int>(levels_); }

  /// World to camera, or to body, m. What follows throws std::invalid_argument for an id that is not alive.
  const rigid_transform<double>& T_cw(map_keyframe_id k) const { return at(k).T_cw; }
  /// The pose from now on; not checked.
  void set_pose(map_keyframe_id k, const rigid_transform<double>& T_cw) { at(k).T_cw = T_cw; }
  /// Those of add_keyframe().
  span<const keypoint> keypoints(map_keyframe_id k) const { return {at(k).keypoints.data(), at(k).keypoints.size()}; }
  /// World, m.
  const vec3<double>& position(map_point_id p) const { return positions_[checked(p)]; }
  /// Valid until the map changes.
  span<const observation> observations(map_point_id p) const { return observations_.of(checked(p)); }
  /// The point that a keypoint sees, map_point_id{} for none.
  map_point_id point_at(map_keyframe_id k, std::size_t keypoint) const {
    const auto& slots = at(k).slots;
    require(keypoint < slots.size(), "keypoint", keypoint, "is not a keypoint of the keyframe");
    return slots[keypoint];
  }
  /// The current handle of a keyframe by its index, that of an observation (not checked).
  map_keyframe_id keyframe_at(std::int32_t index) const { return {index, keyframe_places_.generation(index)}; }

  /// What tracking reports: the point was expected in an image, and found in it.
  void seen_in_tracking(map_point_id p, std::uint32_t visible, std::uint32_t found) {
    auto& entry = points_[checked(p)];
    entry.visible = visible, entry.found = found;
  }
  /// Forgets what merged points became, so that their places are used again: when nobody holds their ids any longer.
  void forget_replacements() {
    for (std::size_t p = 0; p < points_.size(); ++p) {
      const auto place = static_cast<std::int32_t>(p);
      if (!point_places_.alive(place) && points_[p].replacement != map_point_id{}) {
        points_[p].replacement = {};
        point_places_.give_back(place);
      }
    }
  }

 private:
  friend struct map_traits<simple_map>;
  static constexpr std::int32_t none = -1;
  static constexpr auto no_id = static_cast<std::uint64_t>(-1);  ///< of no keyframe
  static constexpr auto elements = static_cast<std::size_t>(Descriptor::elements);

  struct keyframe_entry {
    plain_vector<keypoint> keypoints;
    plain_vector<map_point_id> slots;  ///< one per keypoint: its point, or map_point_id{}
    rigid_transform<double> T_cw;
    double time_s = 0;
    std::uint64_t id = 0;          ///< kept after the keyframe is erased, until the place is used again
    std::uint32_t generation = 0;  ///< of the keyframe that has this id
    std::int32_t previous = none, next = none;
  };
  struct range {
    float min = 0, max = 0;
  };
  struct point_entry {
    std::uint64_t id = 0;
    map_keyframe_id reference = {};
    map_point_id replacement = {};
    std::uint32_t visible = 1, found = 1;
  };

  void check(map_keyframe_id k) const {
    require(alive(k), "keyframe", k.index, "is not a keyframe of the map, or no longer");
  }
  keyframe_entry& at(map_keyframe_id k) { return check(k), keyframes_[static_cast<std::size_t>(k.index)]; }
  const keyframe_entry& at(map_keyframe_id k) const { return check(k), keyframes_[static_cast<std::size_t>(k.index)]; }
  std::size_t checked(map_point_id p) const {
    require(alive(p), "point", p.index, "is not a point of the map, or no longer");
    return static_cast<std::size_t>(p.index);
  }
  map_point_id point_at_place(std::int32_t p) const { return {p, point_places_.generation(p)}; }
  map_keyframe_id keyframe_or_none(std::int32_t k) const { return k == none ? map_keyframe_id{} : keyframe_at(k); }
  void link(std::int32_t previous, std::int32_t next) {  // either may be none
    if (previous != none) keyframes_[static_cast<std::size_t>(previous)].next = next;
    if (next != none) keyframes_[static_cast<std::size_t>(next)].previous = previous;
  }

  std::size_t levels_;
  std::uint64_t next_keyframe_ = 0, next_point_ = 0;
  plain_detail::place_list keyframe_places_, point_places_;
  std::vector<keyframe_entry> keyframes_;
  // Points: one entry each, by index.
  plain_vector<vec3<double>> positions_;
  plain_vector<vec3<float>> normals_;
  plain_vector<range> ranges_;
  plain_vector<point_covariance> covariances_;  ///< of positions
  plain_vector<element> descriptors_;
  plain_vector<std::uint32_t> counts_;  ///< [point][octave]
  plain_vector<point_entry> points_;
  observation_pool observations_;
};

}  // namespace turbomap

#include "simple_map_traits.hpp"

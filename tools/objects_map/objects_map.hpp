// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A map of objects (objects.hpp) with its map_traits: what a SLAM system in the field has in place of a simple_map, to measure
/// what the library costs there. Of the optional traits it has what such systems have: no indices, no counts by octave.
/// Observations are visited in the order in which they were added, as in a simple_map, so that the two make the same map to
/// the last bit.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include <turbomap/descriptor/binary.hpp>
#include <turbomap/map/map_traits.hpp>
#include <turbomap/slot_table.hpp>
#include <turbomap/span.hpp>

#include "objects.hpp"

namespace turbomap_program {

/// Objects in places, a place that became free is used again: the order of a simple_map, in which map_digest() reads.
template <class Object>
class object_list {
 public:
  std::uint64_t next_id() { return next_id_++; }
  void add(const std::shared_ptr<Object>& object) {
    const std::uint32_t place = slots_.acquire();
    slots_.publish(place);
    if (place == objects_.size()) objects_.emplace_back();
    objects_[place] = object;
    places_.emplace(object->id, place);
  }
  /// \param reuse  false: the place of an object that was merged stays empty
  void remove(const Object& object, bool reuse) {
    const auto at = places_.find(object.id);
    slots_.retire(at->second);
    if (reuse) slots_.recycle(at->second);
    objects_[at->second] = nullptr;
    places_.erase(at);
  }
  std::size_t size() const { return places_.size(); }
  template <class F>
  void for_each(F f) const {
    for (const auto& object : objects_)
      if (object) f(object);
  }

 private:
  turbomap::slot_table slots_;
  std::vector<std::shared_ptr<Object>> objects_;
  std::map<std::uint64_t, std::uint32_t> places_;  ///< by id
  std::uint64_t next_id_ = 0;
};

/// \tparam Camera  of the keyframe store's rigs
template <class Camera>
class objects_map {
 public:
  explicit objects_map(int /*levels*/ = 8) {}

  keyframe_ptr add_keyframe(turbomap::span<const turbomap::keypoint> keypoints,
                            const turbomap::rigid_transform<double>& T_cw, double time_s = 0,
                            const keyframe_ptr& previous = {}) {
    const auto k = std::make_shared<object_keyframe>(
        keyframes_.next_id(), std::vector<turbomap::keypoint>(keypoints.begin(), keypoints.end()), T_cw, time_s);
    keyframes_.add(k);
    if (previous) {
      link(k, previous->next());
      link(previous, k);
    }
    return k;
  }
  point_ptr add_point(const turbomap::vec3<double>& position, const keyframe_ptr& reference = {}) {
    const auto p = std::make_shared<object_point>(points_.next_id(), position, reference);
    points_.add(p);
    return p;
  }

  /// Of a keyframe that no point names any more.
  void erase_keyframe(const keyframe_ptr& k) {
    link(k->previous(), k->next());
    k->set_bad();
    keyframes_.remove(*k, true);
  }
  /// Of a point without observations. \param replacement  none, or the point that it was merged into
  void retire(const point_ptr& p, const point_ptr& replacement) {
    p->retire(replacement);
    points_.remove(*p, !replacement);
  }

  bool alive(const keyframe_ptr& k) const { return k && !k->bad(); }
  bool alive(const point_ptr& p) const { return p && !p->bad(); }
  std::size_t keyframe_count() const { return keyframes_.size(); }
  std::size_t point_count() const { return points_.size(); }
  /// Of all points. O(observations).
  std::size_t observation_count() const {
    std::size_t count = 0;
    points_.for_each([&](const point_ptr& p) { count += observations(p).size(); });
    return count;
  }
  turbomap::rigid_transform<double> T_cw(const keyframe_ptr& k) const { return k->pose(); }
  void set_pose(const keyframe_ptr& k, const turbomap::rigid_transform<double>& T_cw) { k->set_pose(T_cw); }
  const std::vector<turbomap::keypoint>& keypoints(const keyframe_ptr& k) const { return k->keypoints; }
  turbomap::vec3<double> position(const point_ptr& p) const { return p->position(); }
  point_ptr point_at(const keyframe_ptr& k, std::size_t keypoint) const { return k->point(keypoint); }
  /// What tracking reports: the point was expected in an image, and found in it.
  void seen_in_tracking(const point_ptr& p, std::uint32_t visible, std::uint32_t found) {
    p->set_tracked(visible, found);
  }

  struct observation {
    keyframe_ptr keyframe;
    std::size_t keypoint;
  };
  /// Calls f(keyframe, keypoint) in the order in which they were added.
  template <class F>
  void for_each_observation(const point_ptr& p, F f) const {
    struct view {
      std::uint64_t number;
      std::size_t keypoint;
      const std::weak_ptr<object_keyframe>* keyframe;
    };
    const auto copy = p->observations();
    std::vector<view> list;
    list.reserve(2 * copy.size());
    for (const auto& [weak, views] : copy)
      for (std::size_t c = 0; c < 2; ++c)
        if (views.keypoint[c] >= 0)
          list.push_back({views.number[c], static_cast<std::size_t>(views.keypoint[c]), &weak});
    std::sort(list.begin(), list.end(), [](const view& a, const view& b) { return a.number < b.number; });
    for (const view& v : list)
      if (const keyframe_ptr k = v.keyframe->lock()) f(k, v.keypoint);
  }
  /// The same as a list.
  std::vector<observation> observations(const point_ptr& p) const {
    std::vector<observation> list;
    list.reserve(8);  // mostly enough
    for_each_observation(p, [&](const keyframe_ptr& k, std::size_t keypoint) { list.push_back({k, keypoint}); });
    return list;
  }

 private:
  friend struct turbomap::map_traits<objects_map>;

  static void link(const keyframe_ptr& previous, const keyframe_ptr& next) {  // either may be none
    if (previous) previous->set_next(next);
    if (next) next->set_previous(previous);
  }

  std::mutex mutex_;  ///< the guard
  object_list<object_keyframe> keyframes_;
  object_list<object_point> points_;
};

}  // namespace turbomap_program

template <class Camera>
struct turbomap::map_traits<turbomap_program::objects_map<Camera>> {
  using map = turbomap_program::objects_map<Camera>;
  using keyframe = turbomap_program::keyframe_ptr;
  using point = turbomap_program::point_ptr;
  using descriptor = turbomap::binary_descriptor<256>;
  using camera = Camera;
  static constexpr bool mirrored = true;  // names are shared_ptr; all edits outside the mapper are made by tracking
  using kf = const keyframe&;
  using pt = const point&;

  static std::unique_lock<std::mutex> guard(map& m) { return std::unique_lock<std::mutex>(m.mutex_); }

  static std::uint64_t id(const map&, kf k) { return k->id; }
  static bool alive(const map&, kf k) { return !k->bad(); }
  static turbomap::rigid_transform<double> pose(const map&, kf k) { return k->pose(); }
  static void set_pose(map&, kf k, const turbomap::rigid_transform<double>& T_cw) { k->set_pose(T_cw); }
  static std::size_t keypoint_count(const map&, kf k) { return k->keypoints.size(); }
  static const turbomap::keypoint& keypoint(const map&, kf k, std::size_t i) { return k->keypoints.at(i); }
  static point point_at(const map&, kf k, std::size_t i) { return k->point(i); }
  static void set_point(map&, kf k, std::size_t i, pt p) { k->set_point(i, p); }
  static double time(const map&, kf k) { return k->time_s; }
  static keyframe previous(const map&, kf k) { return k->previous(); }
  static keyframe next(const map&, kf k) { return k->next(); }
  static bool may_erase(const map&, kf k) { return k->id != 0; }
  static bool is_origin(const map&, kf k) { return k->id == 0; }
  static void erase_keyframe(map& m, kf k) { m.erase_keyframe(k); }

  static std::uint64_t id(const map&, pt p) { return p->id; }
  static bool alive(const map&, pt p) { return !p->bad(); }
  static point replacement(const map&, pt p) { return p->replacement(); }
  static turbomap::vec3<double> position(const map&, pt p) { return p->position(); }
  static void set_position(map&, pt p, const turbomap::vec3<double>& x) { p->set_position(x); }
  static turbomap::vec3<float> normal(const map&, pt p) { return p->appearance().normal; }
  static float min_distance(const map&, pt p) { return p->appearance().min_distance; }
  static float max_distance(const map&, pt p) { return p->appearance().max_distance; }
  static const std::uint8_t* descriptor_data(const map&, pt p) { return p->descriptor(); }
  static turbomap::point_covariance covariance(const map&, pt p) { return p->covariance(); }
  static void set_covariance(map&, pt p, const turbomap::point_covariance& c) { p->set_covariance(c); }
  static keyframe reference(const map&, pt p) { return p->reference(); }
  static void set_reference(map&, pt p, kf k) { p->set_reference(k); }
  static float found_ratio(const map&, pt p) { return p->found_ratio(); }
  static void set_appearance(map&, pt p, const turbomap::vec3<float>& normal, float min, float max,
                             const std::uint8_t* d) {
    p->set_appearance({normal, min, max}, d);
  }
  template <class F>
  static void for_each_observation(const map& m, pt p, F f) {
    m.for_each_observation(p, f);
  }
  static void add_observation(map&, pt p, kf k, std::size_t i) { p->add_observation(k, i); }
  static void erase_observation(map&, pt p, kf k, std::size_t i) { p->erase_observation(k, i); }
  static point add_point(map& m, const turbomap::vec3<double>& x, kf reference) { return m.add_point(x, reference); }
  static void retire(map& m, pt p, pt replacement) { m.retire(p, replacement); }
  template <class F>
  static void for_each_keyframe(const map& m, F f) {
    m.keyframes_.for_each(f);
  }
  template <class F>
  static void for_each_point(const map& m, F f) {
    m.points_.for_each(f);
  }
};

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A SLAM system's own classes, keyframes and points that point at each other, each behind a mutex; below them the two
/// traits structs that let the library read and change them as they are.
///
/// Locks of this system. A *write* of what both threads use holds the lock of the map and the lock of the object, in
/// this order; so a *read* may hold either. Tracking reads objects under their own locks and never waits for a commit;
/// the traits read under the map's lock alone, their guard. The exception are the tracking counts of a point: always
/// under its own lock. Nothing is deleted while the system runs: what has left the map is marked bad.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/camera/rig.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/map/map_traits.hpp>
#include <turbomap/traits.hpp>
#include <utility>
#include <vector>

// ---- The system, as it was before it met this library. --------------------------------------------------------------
namespace my {

struct KeyFrame;
using Descriptor = std::array<std::uint8_t, 32>;
using Position = std::array<double, 3>;

struct MapPoint {
  explicit MapPoint(std::uint64_t number, const Position& x, KeyFrame* k) : id(number), position(x), reference(k) {}
  const std::uint64_t id;
  mutable std::mutex mutex;
  Position position;
  std::array<float, 3> normal{};
  float min_distance = 0, max_distance = 0;
  Descriptor descriptor{};
  KeyFrame* reference;
  std::vector<std::pair<KeyFrame*, std::size_t>> observations;
  std::array<std::uint32_t, 8> octave_counts{};  // how many keyframes see it at each level; the library keeps them
  bool bad = false;
  MapPoint* replaced_by = nullptr;
  std::uint32_t visible = 1, found = 1;  // counted by tracking, under `mutex` only
};

struct Feature {
  float u, v, u_right, depth;
  int level;
  Descriptor descriptor;
};

struct Pose {  // world to camera: x_c = R(quaternion) x_w + t
  std::array<double, 4> quaternion{0, 0, 0, 1};
  Position t{};
};

struct KeyFrame {
  std::uint64_t id = 0;  // this and the next two never change once the keyframe is in the map
  std::vector<Feature> features;
  std::vector<int> truth;  // the landmark that each feature shows: to judge the result
  mutable std::mutex mutex;
  Pose T_cw;
  std::vector<MapPoint*> points;  // one per feature, or null
  bool waiting = true;            // for local mapping
  bool bad = false;

  std::vector<MapPoint*> points_now() const {
    const std::lock_guard<std::mutex> lock(mutex);
    return points;
  }
};

struct Map {
  std::mutex mutex;
  std::deque<MapPoint> points;
  std::deque<KeyFrame> keyframes;  // a deque: addresses stay
};

constexpr turbomap::pinhole<float> camera{400, 400, 320, 240};
constexpr double baseline = 0.1;

}  // namespace my

// ---- How to read a keyframe when it is inserted into the store: docs/traits.md. ------------------------------------
template <>
struct turbomap::keyframe_traits<my::KeyFrame> {
  using descriptor = turbomap::binary_descriptor<256>;
  using rig = turbomap::mono_rig<turbomap::pinhole<float>>;
  static rig cameras(const my::KeyFrame&) { return turbomap::make_mono_rig(my::camera, my::camera.fx * my::baseline); }
  static std::size_t keypoint_count(const my::KeyFrame& k) { return k.features.size(); }
  static turbomap::keypoint keypoint(const my::KeyFrame& k, std::size_t i) {
    const my::Feature& f = k.features[i];
    turbomap::keypoint out;
    out.x = f.u, out.y = f.v, out.u_right = f.u_right, out.depth = f.depth;
    out.octave = static_cast<std::uint8_t>(f.level);
    return out;
  }
  static const std::uint8_t* descriptor_data(const my::KeyFrame& k, std::size_t i) {
    return k.features[i].descriptor.data();
  }
  static turbomap::image_bounds bounds(const my::KeyFrame&) { return {0, 0, 640, 480}; }
  // No guard: what is read here never changes.
};

// ---- How to read and change the map: docs/map.md. ------------------------------------------------------------------
template <>
struct turbomap::map_traits<my::Map> {
  using keyframe = my::KeyFrame*;
  using point = my::MapPoint*;
  using descriptor = turbomap::binary_descriptor<256>;
  using camera = turbomap::pinhole<float>;
  using lock = std::lock_guard<std::mutex>;  // of an object, to write it

  static std::unique_lock<std::mutex> guard(my::Map& m) { return std::unique_lock<std::mutex>(m.mutex); }

  // Keyframes.
  static std::uint64_t id(const my::Map&, keyframe k) { return k->id; }
  static bool alive(const my::Map&, keyframe k) { return !k->bad; }
  // The first one holds the frame of reference; one that waits is not culled before its turn.
  static bool may_erase(const my::Map&, keyframe k) { return k->id != 0 && !k->waiting; }
  static bool is_origin(const my::Map&, keyframe k) { return k->id == 0; }
  static turbomap::rigid_transform<double> pose(const my::Map&, keyframe k) {
    const auto& [q, t] = k->T_cw;
    return {q[0], q[1], q[2], q[3], t[0], t[1], t[2]};
  }
  static void set_pose(my::Map&, keyframe k, const turbomap::rigid_transform<double>& T_cw) {
    const lock held(k->mutex);
    k->T_cw = {{T_cw.qx, T_cw.qy, T_cw.qz, T_cw.qw}, {T_cw.tx, T_cw.ty, T_cw.tz}};
  }
  // Keypoints are described once, by keyframe_traits of what the name points to.
  static point point_at(const my::Map&, keyframe k, std::size_t i) { return k->points[i]; }
  static void set_point(my::Map&, keyframe k, std::size_t i, point p) {
    const lock held(k->mutex);
    k->points[i] = p;
  }
  static void erase_keyframe(my::Map&, keyframe k) {
    const lock held(k->mutex);
    k->bad = true;
  }
  template <class F>
  static void for_each_keyframe(const my::Map& m, F f) {
    for (const auto& k : m.keyframes)
      if (!k.bad) f(const_cast<keyframe>(&k));
  }

  // Points.
  static std::uint64_t id(const my::Map&, point p) { return p->id; }
  static bool alive(const my::Map&, point p) { return !p->bad; }
  static point replacement(const my::Map&, point p) { return p->replaced_by; }
  static turbomap::vec3<double> position(const my::Map&, point p) {
    return {p->position[0], p->position[1], p->position[2]};
  }
  static turbomap::vec3<float> normal(const my::Map&, point p) { return {p->normal[0], p->normal[1], p->normal[2]}; }
  static float min_distance(const my::Map&, point p) { return p->min_distance; }
  static float max_distance(const my::Map&, point p) { return p->max_distance; }
  static const std::uint8_t* descriptor_data(const my::Map&, point p) { return p->descriptor.data(); }
  static keyframe reference(const my::Map&, point p) { return p->reference; }
  static float found_ratio(const my::Map&, point p) {
    const lock held(p->mutex);
    return static_cast<float>(p->found) / static_cast<float>(p->visible);
  }
  template <class F>
  static void for_each_observation(const my::Map&, point p, F f) {  // f asks for other objects: no lock of p is held
    for (const auto& [k, i] : p->observations) f(k, i);
  }
  template <class F>
  static void for_each_point(const my::Map& m, F f) {
    for (const auto& p : m.points)
      if (!p.bad) f(const_cast<point>(&p));
  }

  static point add_point(my::Map& m, const turbomap::vec3<double>& x, keyframe reference) {
    return &m.points.emplace_back(m.points.size(), my::Position{x.x, x.y, x.z}, reference);
  }
  static void set_position(my::Map&, point p, const turbomap::vec3<double>& x) {
    const lock held(p->mutex);
    p->position = {x.x, x.y, x.z};
  }
  static void set_appearance(my::Map&, point p, const turbomap::vec3<float>& normal, float min, float max,
                             const std::uint8_t* d) {
    const lock held(p->mutex);
    p->normal = {normal.x, normal.y, normal.z};
    p->min_distance = min, p->max_distance = max;
    std::copy_n(d, p->descriptor.size(), p->descriptor.begin());
  }
  static void set_reference(my::Map&, point p, keyframe k) {
    const lock held(p->mutex);
    p->reference = k;
  }
  static void reserve_observations(my::Map&, point p, std::size_t more) {
    const lock held(p->mutex);
    p->observations.reserve(p->observations.size() + more);
  }
  static void add_observation(my::Map&, point p, keyframe k, std::size_t i) {
    const lock held(p->mutex);
    p->observations.emplace_back(k, i);
  }
  static void erase_observation(my::Map&, point p, keyframe k, std::size_t i) {
    const lock held(p->mutex);
    auto& list = p->observations;
    list.erase(std::remove(list.begin(), list.end(), std::pair{k, i}), list.end());
  }
  static void retire(my::Map&, point p, point replacement) {
    std::uint32_t visible = 0, found = 0;
    {
      const lock held(p->mutex);
      p->bad = true, p->replaced_by = replacement;
      visible = p->visible, found = p->found;
    }
    if (replacement == nullptr) return;
    const lock held(replacement->mutex);
    replacement->visible += visible, replacement->found += found;
  }
  static turbomap::span<const std::uint32_t> octave_counts(const my::Map&, point p) {
    return {p->octave_counts.data(), p->octave_counts.size()};
  }
  static void change_octave_count(my::Map&, point p, int octave, int change) {
    p->octave_counts[static_cast<std::size_t>(octave)] += static_cast<std::uint32_t>(change);  // tracking does not ask
  }
};

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A SLAM system whose map owns its keyframes and points by shared_ptr, and whose objects die when they are erased; below it the
/// two traits structs. Names are shared_ptr: whoever holds one keeps the object, so nobody can read a deleted one. What an
/// object says about others is a weak_ptr where it would be a circle.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/camera/rig.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/map/map_traits.hpp>
#include <turbomap/map/replacement_table.hpp>
#include <turbomap/traits.hpp>
#include <unordered_map>
#include <utility>
#include <vector>

#include "wall_scene.hpp"

// ---- The system, as it was before it met this library. --------------------------------------------------------------
namespace shared {

struct KeyFrame;

struct MapPoint {
  std::uint64_t id = 0;
  bool erased = false;  // for those who hold a name yet
  turbomap::vec3<double> position{};
  turbomap::vec3<float> normal{};
  float min_distance = 0, max_distance = 0;
  std::array<std::uint8_t, 32> descriptor{};
  std::weak_ptr<KeyFrame> reference;
  std::vector<std::pair<std::weak_ptr<KeyFrame>, std::size_t>> observations;
};

struct KeyFrame {
  std::uint64_t id = 0;
  bool erased = false;
  turbomap::rigid_transform<double> T_cw;
  example::wall_view view;
  std::vector<std::shared_ptr<MapPoint>> points;  // one per keypoint, or null
};

/// The only owner, but for those who hold a name for a while.
struct Map {
  std::unordered_map<std::uint64_t, std::shared_ptr<KeyFrame>> keyframes;
  std::unordered_map<std::uint64_t, std::shared_ptr<MapPoint>> points;
  std::uint64_t next_point = 0;
  /// The system forgot what merged points became; the library has to ask.
  turbomap::replacement_table<std::shared_ptr<MapPoint>> replacements;
};

}  // namespace shared

// ---- How to read a keyframe when it is inserted into the store: docs/traits.md. ------------------------------------
template <>
struct turbomap::keyframe_traits<shared::KeyFrame> {
  using descriptor = example::orb;
  using rig = turbomap::mono_rig<example::camera>;
  static rig cameras(const shared::KeyFrame&) {
    return turbomap::make_mono_rig(example::left_camera, example::left_camera.fx * example::baseline);
  }
  static std::size_t keypoint_count(const shared::KeyFrame& k) { return k.view.keypoints.size(); }
  static const turbomap::keypoint& keypoint(const shared::KeyFrame& k, std::size_t i) { return k.view.keypoints[i]; }
  static const std::uint8_t* descriptor_data(const shared::KeyFrame& k, std::size_t i) {
    return k.view.descriptors.data() + 32 * i;
  }
  static turbomap::image_bounds bounds(const shared::KeyFrame&) { return example::image; }
};

// ---- How to read and change the map: docs/map.md. ------------------------------------------------------------------
template <>
struct turbomap::map_traits<shared::Map> {
  using map = shared::Map;
  // A large map of such objects should also say: static constexpr bool mirrored = true;
  using keyframe = std::shared_ptr<shared::KeyFrame>;
  using point = std::shared_ptr<shared::MapPoint>;
  using descriptor = example::orb;
  using camera = example::camera;

  // Parameters are references: a shared_ptr that is copied counts.
  static std::uint64_t id(const map&, const keyframe& k) { return k->id; }
  static bool alive(const map&, const keyframe& k) { return !k->erased; }
  static bool may_erase(const map&, const keyframe& k) { return k->id != 0; }
  static bool is_origin(const map&, const keyframe& k) { return k->id == 0; }
  static const turbomap::rigid_transform<double>& pose(const map&, const keyframe& k) { return k->T_cw; }
  static void set_pose(map&, const keyframe& k, const turbomap::rigid_transform<double>& T) { k->T_cw = T; }
  static const point& point_at(const map&, const keyframe& k, std::size_t i) { return k->points[i]; }
  static void set_point(map&, const keyframe& k, std::size_t i, const point& p) { k->points[i] = p; }
  static void erase_keyframe(map& m, const keyframe& k) {
    k->erased = true;
    m.keyframes.erase(k->id);  // dies when the last name of it is let go
  }
  template <class F>
  static void for_each_keyframe(const map& m, F f) {
    for (const auto& [id, k] : m.keyframes) f(k);
  }

  static std::uint64_t id(const map&, const point& p) { return p->id; }
  static bool alive(const map&, const point& p) { return !p->erased; }
  static point replacement(const map& m, const point& p) { return m.replacements.find(p->id); }
  static const turbomap::vec3<double>& position(const map&, const point& p) { return p->position; }
  static const turbomap::vec3<float>& normal(const map&, const point& p) { return p->normal; }
  static float min_distance(const map&, const point& p) { return p->min_distance; }
  static float max_distance(const map&, const point& p) { return p->max_distance; }
  static const std::uint8_t* descriptor_data(const map&, const point& p) { return p->descriptor.data(); }
  static keyframe reference(const map&, const point& p) { return p->reference.lock(); }
  template <class F>
  static void for_each_observation(const map&, const point& p, F f) {
    for (const auto& [k, i] : p->observations)
      if (const keyframe observer = k.lock()) f(observer, i);
  }
  template <class F>
  static void for_each_point(const map& m, F f) {
    for (const auto& [id, p] : m.points) f(p);
  }

  static point add_point(map& m, const turbomap::vec3<double>& x, const keyframe& reference) {
    const auto p = std::make_shared<shared::MapPoint>();
    p->id = m.next_point++, p->position = x, p->reference = reference;
    m.points.emplace(p->id, p);
    return p;
  }
  static void set_position(map&, const point& p, const turbomap::vec3<double>& x) { p->position = x; }
  static void set_appearance(map&, const point& p, const turbomap::vec3<float>& normal, float min, float max,
                             const std::uint8_t* d) {
    p->normal = normal, p->min_distance = min, p->max_distance = max;
    std::copy_n(d, p->descriptor.size(), p->descriptor.begin());
  }
  static void set_reference(map&, const point& p, const keyframe& k) { p->reference = k; }
  static void reserve_observations(map&, const point& p, std::size_t more) {
    p->observations.reserve(p->observations.size() + more);
  }
  static void add_observation(map&, const point& p, const keyframe& k, std::size_t i) {
    p->observations.emplace_back(k, i);
  }
  // One entry, and nothing else: a point without observations is retired by whoever called this, not here.
  static void erase_observation(map&, const point& p, const keyframe& k, std::size_t i) {
    auto& list = p->observations;
    list.erase(
        std::remove_if(list.begin(), list.end(), [&](const auto& o) { return o.second == i && o.first.lock() == k; }),
        list.end());
  }
  static void retire(map& m, const point& p, const point& replacement) {
    p->erased = true;
    m.replacements.note(p->id, replacement);
    m.points.erase(p->id);
  }
};

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A second map type for tests, as unlike simple_map as users' maps are: objects behind pointers, each with its mutex,
/// observations in trees ordered by address, dead objects flagged and kept. No optional member of map_traits.

#include <turbomap/map/map_traits.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <vector>

#include "map_scene.hpp"

namespace turbomap_test {

struct pointer_point;

struct pointer_keyframe {
  mutable std::mutex mutex;
  std::uint64_t id = 0;
  bool bad = false;
  turbomap::rigid_transform<double> T_cw;
  std::vector<turbomap::keypoint> keypoints;
  std::vector<pointer_point*> points;
};

struct pointer_point {
  mutable std::mutex mutex;
  std::uint64_t id = 0;
  bool bad = false;
  turbomap::vec3<double> position{};
  turbomap::vec3<float> normal{};
  float min_distance = 0, max_distance = 0;
  std::array<std::uint8_t, 32> descriptor{};
  pointer_keyframe* reference = nullptr;
  pointer_point* replaced = nullptr;
  std::map<pointer_keyframe*, std::vector<std::size_t>> observations;
};

struct pointer_map {
  std::deque<pointer_keyframe> keyframes;
  std::deque<pointer_point> points;
};

inline pointer_keyframe* insert_keyframe(pointer_map& map, const std::vector<turbomap::keypoint>& keypoints, double,
                                         pointer_keyframe*) {
  pointer_keyframe& k = map.keyframes.emplace_back();
  k.id = map.keyframes.size() - 1;
  k.keypoints = keypoints;
  k.points.assign(keypoints.size(), nullptr);
  return &k;
}

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::pointer_map> {
  using map = turbomap_test::pointer_map;
  using keyframe = turbomap_test::pointer_keyframe*;
  using point = turbomap_test::pointer_point*;
  using descriptor = turbomap_test::map_descriptor;
  using camera = turbomap_test::map_camera;
  static constexpr bool mirrored = true;
  using lock = std::lock_guard<std::mutex>;

  static std::uint64_t id(const map&, keyframe k) { return k->id; }
  static bool alive(const map&, keyframe k) { return lock(k->mutex), !k->bad; }
  static turbomap::rigid_transform<double> pose(const map&, keyframe k) { return lock(k->mutex), k->T_cw; }
  static void set_pose(map&, keyframe k, const turbomap::rigid_transform<double>& T) { lock(k->mutex), k->T_cw = T; }
  static std::size_t keypoint_count(const map&, keyframe k) { return k->keypoints.size(); }
  static turbomap::keypoint keypoint(const map&, keyframe k, std::size_t i) { return k->keypoints.at(i); }
  static point point_at(const map&, keyframe k, std::size_t i) { return lock(k->mutex), k->points.at(i); }
  static void set_point(map&, keyframe k, std::size_t i, point p) { lock(k->mutex), k->points.at(i) = p; }
  static void erase_keyframe(map&, keyframe k) { lock(k->mutex), k->bad = true; }

  static std::uint64_t id(const map&, point p) { return p->id; }
  static bool alive(const map&, point p) { return lock(p->mutex), !p->bad; }
  static point replacement(const map&, point p) { return lock(p->mutex), p->replaced; }
  static turbomap::vec3<double> position(const map&, point p) { return lock(p->mutex), p->position; }
  static turbomap::vec3<float> normal(const map&, point p) { return lock(p->mutex), p->normal; }
  static float min_distance(const map&, point p) { return p->min_distance; }
  static float max_distance(const map&, point p) { return p->max_distance; }
  static const std::uint8_t* descriptor_data(const map&, point p) { return p->descriptor.data(); }
  static keyframe reference(const map&, point p) { return p->reference; }
  template <class F>
  static void for_each_observation(const map&, point p, F f) {
    std::unique_lock<std::mutex> held(p->mutex);
    const auto copy = p->observations;  // as such systems do: the lock is not held while others are asked
    held.unlock();
    for (const auto& [k, keypoints] : copy)
      for (const std::size_t i : keypoints) f(k, i);
  }
  static point add_point(map& m, const turbomap::vec3<double>& position, keyframe reference) {
    auto& p = m.points.emplace_back();
    p.id = m.points.size() - 1, p.position = position, p.reference = reference;
    return &p;
  }
  static void set_position(map&, point p, const turbomap::vec3<double>& x) { lock(p->mutex), p->position = x; }
  static void set_appearance(map&, point p, const turbomap::vec3<float>& normal, float min, float max,
                             const std::uint8_t* d) {
    const lock held(p->mutex);
    p->normal = normal, p->min_distance = min, p->max_distance = max;
    for (auto& byte : p->descriptor) byte = *d++;
  }
  static void set_reference(map&, point p, keyframe k) { lock(p->mutex), p->reference = k; }
  static void add_observation(map&, point p, keyframe k, std::size_t i) {
    lock(p->mutex), p->observations[k].push_back(i);
  }
  static void erase_observation(map&, point p, keyframe k, std::size_t i) {
    const lock held(p->mutex);
    const auto at = p->observations.find(k);
    for (std::size_t j = 0; j < at->second.size(); ++j)
      if (at->second[j] == i) {
        at->second.erase(at->second.begin() + static_cast<std::ptrdiff_t>(j));
        break;
      }
    if (at->second.empty()) p->observations.erase(at);
  }
  static void retire(map&, point p, point replacement) { lock(p->mutex), p->bad = true, p->replaced = replacement; }
};

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A map with a mutex that is watched: every read and write without it is counted. And a descriptor that counts comparisons
/// made while it is held, since searches compare.

#include <turbomap/descriptor/binary.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>

#include <atomic>
#include <cstddef>
#include <functional>
#include <mutex>
#include <utility>

#include "matching_rigs.hpp"
#include "mirrored_map.hpp"

namespace turbomap_test {

inline std::atomic<bool> any_guard_held{false};
inline std::atomic<long> distance_calls{0}, distance_calls_under_guard{0};

struct probing_descriptor {
  using element = std::uint8_t;
  using distance_type = std::int32_t;
  static constexpr int elements = 32, bytes = 32;
  static constexpr distance_type worst = turbomap::binary_descriptor<256>::worst;
  static distance_type distance(const element* a, const element* b) {
    ++distance_calls;
    if (any_guard_held) ++distance_calls_under_guard;
    return turbomap::binary_descriptor<256>::distance(a, b);
  }
};

struct guard_watch {
  std::mutex mutex;
  std::atomic<bool> held{false};
  std::atomic<bool> armed{false};  ///< whether reads and writes without the guard count
  std::atomic<long> unguarded{0}, taken{0};
  std::function<void()> before, after;  ///< it is taken

  void used() {
    if (armed && !held) ++unguarded;
  }
};

/// Holds the mutex, and says so.
class watched_guard {
 public:
  explicit watched_guard(guard_watch& watch) : watch_(watch), lock_((before(watch), watch.mutex)) {
    ++watch.taken;
    watch_.held = any_guard_held = true;
    try {
      if (watch_.after) watch_.after();
    } catch (...) {
      watch_.held = any_guard_held = false;
      throw;
    }
  }
  watched_guard(const watched_guard&) = delete;
  watched_guard& operator=(const watched_guard&) = delete;
  ~watched_guard() { watch_.held = any_guard_held = false; }

 private:
  static void before(guard_watch& watch) {
    if (watch.before) watch.before();
  }
  guard_watch& watch_;
  std::unique_lock<std::mutex> lock_;
};

template <class Descriptor>
struct watched_map : turbomap::simple_map<Descriptor, pinhole_camera> {
  using turbomap::simple_map<Descriptor, pinhole_camera>::simple_map;
  mutable guard_watch watch;
};

/// The same map, of which the mapper works on a copy.
using mirrored_watched_map = mirrored_map<watched_map<turbomap::binary_descriptor<256>>>;

}  // namespace turbomap_test

template <class Descriptor>
struct turbomap::map_traits<turbomap_test::watched_map<Descriptor>>
    : turbomap::map_traits<turbomap::simple_map<Descriptor, turbomap_test::pinhole_camera>> {
  using map = turbomap_test::watched_map<Descriptor>;
  using base = turbomap::map_traits<turbomap::simple_map<Descriptor, turbomap_test::pinhole_camera>>;
  using keyframe = typename base::keyframe;
  using point = typename base::point;

  static turbomap_test::watched_guard guard(map& m) { return turbomap_test::watched_guard(m.watch); }

  using base::id;
  static std::uint64_t id(const map& m, keyframe k) { return m.watch.used(), base::id(m, k); }
  static bool alive(const map& m, keyframe k) { return m.watch.used(), base::alive(m, k); }
  static const turbomap::rigid_transform<double>& pose(const map& m, keyframe k) {
    return m.watch.used(), base::pose(m, k);
  }
  static std::size_t keypoint_count(const map& m, keyframe k) { return m.watch.used(), base::keypoint_count(m, k); }
  static point point_at(const map& m, keyframe k, std::size_t i) { return m.watch.used(), base::point_at(m, k, i); }
  static void set_point(map& m, keyframe k, std::size_t i, point p) { m.watch.used(), base::set_point(m, k, i, p); }
  static void erase_keyframe(map& m, keyframe k) { m.watch.used(), base::erase_keyframe(m, k); }
  static bool alive(const map& m, point p) { return m.watch.used(), base::alive(m, p); }
  static point replacement(const map& m, point p) { return m.watch.used(), base::replacement(m, p); }
  static const turbomap::vec3<double>& position(const map& m, point p) { return m.watch.used(), base::position(m, p); }
  static const std::uint8_t* descriptor_data(const map& m, point p) {
    return m.watch.used(), base::descriptor_data(m, p);
  }
  template <class F>
  static void for_each_observation(const map& m, point p, F f) {
    m.watch.used(), base::for_each_observation(m, p, f);
  }
  static point add_point(map& m, const turbomap::vec3<double>& x, keyframe k) {
    return m.watch.used(), base::add_point(m, x, k);
  }
  static void set_appearance(map& m, point p, const turbomap::vec3<float>& normal, float min, float max,
                             const std::uint8_t* d) {
    m.watch.used(), base::set_appearance(m, p, normal, min, max, d);
  }
  static void add_observation(map& m, point p, keyframe k, std::size_t i) {
    m.watch.used(), base::add_observation(m, p, k, i);
  }
  static void erase_observation(map& m, point p, keyframe k, std::size_t i) {
    m.watch.used(), base::erase_observation(m, p, k, i);
  }
  static void retire(map& m, point p, point replacement) { m.watch.used(), base::retire(m, p, replacement); }
};

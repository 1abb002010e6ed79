// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The state that a recorded culling read, as a map of its own kind. The recorded lists contradict each other (a slot
/// may hold a point that lists another keypoint of the keyframe, or does not list it at all), so they cannot be put
/// into a map that keeps its promises: slots and observations are kept apart here, as they were there.

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include <turbomap/map/map_traits.hpp>
#include <turbomap/map/observation_counts.hpp>
#include <turbomap/map/simple_map/map_ids.hpp>
#include "readers/recording_snapshot.hpp"

#include "recorded_keyframes.hpp"

namespace turbomap_replay {

/// Keyframes by their index in the recording; points by their row in the snapshot.
template <class Camera>
class recorded_map {
 public:
  using keyframe = turbomap::map_keyframe_id;
  using point = turbomap::map_point_id;

  /// \param alive  keyframes of the recording that are in the map
  recorded_map(const turbomap::recording& recording, const turbomap::culling_snapshot& state,
               const std::vector<std::uint8_t>& alive)
      : recording_(recording), keyframes_(recording.keyframe_count()), points_(state.point.size()) {
    std::int32_t last = -1;
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      keyframes_[k].alive = alive[k] != 0;
      if (!keyframes_[k].alive) continue;
      keyframes_[k].previous = last;
      if (last >= 0) of(last).next = static_cast<std::int32_t>(k);
      last = static_cast<std::int32_t>(k);
    }
    for (std::size_t p = 0; p < points_.size(); ++p)
      for (std::size_t o = state.observations(p).begin; o < state.observations(p).end; ++o)
        points_[p].observations.push_back({state.obs_kf[o], state.obs_keypoints[o]});
    for (std::size_t i = 0; i < state.keyframe.size(); ++i) {
      auto& k = of(state.keyframe[i]);
      k.keypoints = recording.gather_keypoints(static_cast<std::size_t>(state.keyframe[i]));
      k.slots.assign(k.keypoints.size(), -1);
      k.previous = state.previous_next[i][0], k.next = state.previous_next[i][1];
      for (std::size_t row = state.slots(i).begin; row < state.slots(i).end; ++row)
        k.slots[static_cast<std::size_t>(state.slot_keypoint[row])] = state.slot_point[row];
    }
    const auto levels = static_cast<std::size_t>(recording.meta.levels);
    for (std::size_t p = 0; p < points_.size(); ++p)
      turbomap::recount(*this, point{static_cast<std::int32_t>(p), 0}, points_[p].counts, levels);
  }

  static keyframe name(std::int32_t k) { return {k, 0}; }
  /// Points whose kept counts by octave are those of their observations.
  std::size_t count_kept() {
    counted_ = -1;
    std::size_t kept = 0;
    std::vector<std::uint32_t> truth;
    for (std::size_t p = 0; p < points_.size(); ++p) {
      turbomap::recount(*this, point{static_cast<std::int32_t>(p), 0}, truth, points_[p].counts.size());
      kept += truth == points_[p].counts ? 1 : 0;
    }
    return kept;
  }
  /// The next count is of this keyframe: it is taken for an observer of all points in its slots, whatever their lists
  /// say.
  void count_next(std::int32_t k) { counted_ = k; }
  /// Before a keyframe is taken out: empties the slots whose points do not list it, which the recorded system passes
  /// over.
  void erase_next(std::int32_t k) {
    counted_ = -1;
    for (std::int32_t& p : of(k).slots) {
      const auto seen_by_k = [k](const view& v) { return v.keyframe == k; };
      if (p >= 0 && std::none_of(of_point(p).observations.begin(), of_point(p).observations.end(), seen_by_k)) p = -1;
    }
  }

 private:
  friend struct turbomap::map_traits<recorded_map>;
  struct view {
    std::int32_t keyframe;
    turbomap::index_pair keypoints;  ///< left and right, -1: none
  };
  struct keyframe_state {
    bool alive = false;
    std::int32_t previous = -1, next = -1;
    std::vector<turbomap::keypoint> keypoints;  ///< of candidates; of others one at a time is enough
    std::vector<std::int32_t> slots;
  };
  struct point_state {
    bool alive = true;
    std::vector<view> observations;
    std::vector<std::uint32_t> counts;  ///< observers by octave
  };

  keyframe_state& of(std::int32_t k) { return keyframes_[static_cast<std::size_t>(k)]; }
  const keyframe_state& of(std::int32_t k) const { return keyframes_[static_cast<std::size_t>(k)]; }
  point_state& of_point(std::int32_t p) { return points_[static_cast<std::size_t>(p)]; }
  const point_state& of_point(std::int32_t p) const { return points_[static_cast<std::size_t>(p)]; }

  const turbomap::recording& recording_;
  std::vector<keyframe_state> keyframes_;
  std::vector<point_state> points_;
  std::int32_t counted_ = -1;
  mutable std::vector<std::uint32_t> counts_;
};

}  // namespace turbomap_replay

template <class Camera>
struct turbomap::map_traits<turbomap_replay::recorded_map<Camera>> {
  using map = turbomap_replay::recorded_map<Camera>;
  using keyframe = typename map::keyframe;
  using point = typename map::point;
  using descriptor = turbomap_replay::orb;
  using camera = Camera;

  static std::uint64_t id(const map&, keyframe k) { return static_cast<std::uint64_t>(k.index); }
  static bool alive(const map& m, keyframe k) { return m.of(k.index).alive; }
  static rigid_transform<double> pose(const map&, keyframe) { return {}; }
  static std::size_t keypoint_count(const map& m, keyframe k) { return m.of(k.index).slots.size(); }
  static turbomap::keypoint keypoint(const map& m, keyframe k, std::size_t i) {
    const auto& all = m.of(k.index).keypoints;
    if (!all.empty()) return all[i];
    const auto& r = m.recording_;
    const auto at = static_cast<std::size_t>(k.index), row = r.keypoints(at).begin + i;
    turbomap::keypoint p;
    p.octave = r.kp_octave[row], p.u_right = r.kp_uright[row], p.depth = r.kp_depth[row];
    p.camera = r.nleft[at] >= 0 && i >= static_cast<std::size_t>(r.nleft[at]) ? 1 : 0;
    return p;
  }
  static point point_at(const map& m, keyframe k, std::size_t i) {
    const auto& slots = m.of(k.index).slots;
    return i < slots.size() && slots[i] >= 0 ? point{slots[i], 0} : point{};
  }

  static std::uint64_t id(const map&, point p) { return static_cast<std::uint64_t>(p.index); }
  static bool alive(const map& m, point p) { return m.of_point(p.index).alive; }
  static point replacement(const map&, point) { return {}; }
  static vec3<double> position(const map&, point) { return {}; }
  static vec3<float> normal(const map&, point) { return {}; }
  static float min_distance(const map&, point) { return 0; }
  static float max_distance(const map&, point) { return 0; }
  static const std::uint8_t* descriptor_data(const map&, point) { return nullptr; }
  static keyframe reference(const map&, point) { return {}; }
  template <class F>
  static void for_each_observation(const map& m, point p, F f) {
    for (const auto& v : m.of_point(p.index).observations)
      for (const std::int32_t i : v.keypoints)
        if (i >= 0) f(map::name(v.keyframe), static_cast<std::size_t>(i));
  }
  /// A count takes the keyframe for an observer no coarser than any of its views: listed or not, it is put at octave 0.
  static span<const std::uint32_t> octave_counts(const map& m, point p) {
    m.counts_ = m.of_point(p.index).counts;
    if (m.counted_ < 0) return m.counts_;
    const int listed = finest_octave(m, p, map::name(m.counted_));
    if (listed >= 0) --m.counts_[static_cast<std::size_t>(listed)];
    ++m.counts_[0];
    return m.counts_;
  }
  static void change_octave_count(map& m, point p, int octave, int change) {
    m.of_point(p.index).counts[static_cast<std::size_t>(octave)] += static_cast<std::uint32_t>(change);
  }

  static point add_point(map&, const vec3<double>&, keyframe) { return {}; }
  static void set_position(map&, point, const vec3<double>&) {}
  static void set_appearance(map&, point, const vec3<float>&, float, float, const std::uint8_t*) {}
  static void set_reference(map&, point, keyframe) {}
  static void set_pose(map&, keyframe, const rigid_transform<double>&) {}
  static void set_point(map& m, keyframe k, std::size_t i, point p) {
    auto& slots = m.of(k.index).slots;
    if (i < slots.size()) slots[i] = p.index;
  }
  static void add_observation(map&, point, keyframe, std::size_t) {}
  /// A keyframe is taken off a point's list whole, with all its views: what the recorded system does.
  static void erase_observation(map& m, point p, keyframe k, std::size_t) {
    auto& all = m.of_point(p.index).observations;
    all.erase(std::remove_if(all.begin(), all.end(), [k](const auto& v) { return v.keyframe == k.index; }), all.end());
  }
  static void retire(map& m, point p, point) { m.of_point(p.index).alive = false; }
  static void erase_keyframe(map& m, keyframe k) {
    auto& state = m.of(k.index);
    state.alive = false;
    if (state.previous >= 0) m.of(state.previous).next = state.next;
    if (state.next >= 0) m.of(state.next).previous = state.previous;
  }
  static bool may_erase(const map&, keyframe k) { return k.index != 0; }
  static double time(const map& m, keyframe k) {
    return 1e-9 * static_cast<double>(m.recording_.t_ns[static_cast<std::size_t>(k.index)] - m.recording_.t_ns[0]);
  }
  static keyframe previous(const map& m, keyframe k) { return named(m.of(k.index).previous); }
  static keyframe next(const map& m, keyframe k) { return named(m.of(k.index).next); }

 private:
  static keyframe named(std::int32_t k) { return k < 0 ? keyframe{} : map::name(k); }
};

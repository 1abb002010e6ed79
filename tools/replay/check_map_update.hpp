// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Check of the update of map points after a fusion: representative descriptor, normal and range of every point of the
/// current keyframe, and its covisibility, from the recorded observations.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/appearance/update_appearance.hpp>
#include <turbomap/map/covisibility.hpp>

#include "recorded_scene.hpp"

namespace turbomap_replay {

/// The recorded observations of the current keyframe's points, as a map to count covisibility in. Each slot is a
/// point of its own: the recorded system counts a point that is in two slots twice.
struct slot_map {
  const turbomap::map_update_snapshot& update;
  std::int32_t current;
  std::vector<std::int32_t> row_of_keypoint;  ///< -1: no point
  std::vector<std::uint8_t> alive;            ///< a keyframe

  template <class Scene>
  slot_map(const turbomap::recording& recording, const Scene& at)
      : update(*at.snapshot().map_update),
        current(at.snapshot().keyframe),
        row_of_keypoint(recording.keypoints(static_cast<std::size_t>(current)).size(), -1) {
    for (std::size_t i = 0; i < update.keypoint.size(); ++i)
      row_of_keypoint[static_cast<std::size_t>(update.keypoint[i])] = static_cast<std::int32_t>(i);
    for (std::size_t k = 0; k < recording.keyframe_count(); ++k)
      alive.push_back(at.alive(static_cast<std::int32_t>(k)) ? 1 : 0);
  }
};

}  // namespace turbomap_replay

/// What covisibility asks for.
template <>
struct turbomap::map_traits<turbomap_replay::slot_map> {
  using map = turbomap_replay::slot_map;
  struct keyframe {
    std::int32_t index = -1;
    friend bool operator==(keyframe a, keyframe b) { return a.index == b.index; }
  };
  struct point {
    std::int32_t row = -1;
    friend bool operator==(point a, point b) { return a.row == b.row; }
  };
  static std::uint64_t id(const map&, keyframe k) { return static_cast<std::uint64_t>(k.index); }
  static std::uint64_t id(const map&, point p) { return static_cast<std::uint64_t>(p.row); }
  static bool alive(const map&, point) { return true; }
  static std::size_t keypoint_count(const map& m, keyframe) { return m.row_of_keypoint.size(); }
  static point point_at(const map& m, keyframe, std::size_t i) { return {m.row_of_keypoint[i]}; }
  template <class F>
  static void for_each_observation(const map& m, point p, F f) {
    const auto row = static_cast<std::size_t>(p.row);
    const row_range rows = offset_rows(m.update.obs_off, row);
    for (std::size_t o = rows.begin; o < rows.end; ++o) {
      const std::int32_t k = m.update.obs_kf[o];
      if (k == m.current) {
        f(keyframe{k}, static_cast<std::size_t>(m.update.keypoint[row]));
      } else if (m.alive[static_cast<std::size_t>(k)] != 0) {
        for (const std::int32_t view : m.update.obs_keypoints[o])
          if (view >= 0) f(keyframe{k}, static_cast<std::size_t>(view));
      }
    }
  }
};

namespace turbomap_replay {

/// The observations of a recorded update, as update_appearance() takes them.
class recorded_observers {
 public:
  /// \param counts  whether a keyframe's observations do
  template <class Counts>
  recorded_observers(const turbomap::map_update_snapshot& u, Counts counts) : reference_(u.reference) {
    for (std::size_t i = 0; i < u.point.size(); ++i) {
      const auto rows = turbomap::offset_rows(u.obs_off, i);
      for (std::size_t o = rows.begin; o < rows.end; ++o)
        for (const std::int32_t view : u.obs_keypoints[o])
          if (view >= 0 && counts(u.obs_kf[o])) observations_.push_back({u.obs_kf[o], view});
      offset_.push_back(static_cast<std::int32_t>(observations_.size()));
      position_.push_back(turbomap::cast<double>(u.position[i]));
    }
  }
  turbomap::appearance_view view() const {
    turbomap::appearance_view view;
    view.count = static_cast<int>(position_.size());
    view.position = position_.data();
    view.observation_offset = offset_.data();
    view.observations = observations_.data();
    view.reference = reference_.data();
    return view;
  }

 private:
  std::vector<turbomap::vec3<double>> position_;
  std::vector<std::int32_t> offset_{0}, reference_;
  std::vector<turbomap::point_observation> observations_;
};

template <class Camera, class Policy>
class map_update_check {
 public:
  using posed = turbomap::posed_keyframe<orb, Camera>;
  static constexpr double tolerance = 1e-5;  ///< the recorded system computes in float: normals, ranges (relative)
  static constexpr float min_factor = 0.8F, max_factor = 1.2F;  ///< recorded ranges include them
  static constexpr int min_shared = 15;                         ///< points that make two keyframes covisible

  explicit map_update_check(recorded_scene<Camera, Policy>& scene) : scene_(scene), updates_(scene.ctx) {}

  void check(const snapshot_scene<Camera, Policy>& at) {
    if (!at.snapshot().map_update) return;
    const turbomap::map_update_snapshot& u = *at.snapshot().map_update;
    keyframes_.clear();
    for (std::size_t k = 0; k < scene_.handles.size(); ++k) keyframes_.push_back(at.at(static_cast<std::int32_t>(k)));
    const std::size_t count = u.point.size();
    points_ += count;

    // Descriptors are chosen among those of keyframes that are in the map; rays count from all observers.
    update(at, u, false);
    for (std::size_t i = 0; i < count; ++i) {
      if (std::memcmp(descriptors_.data() + i * orb::elements, u.descriptor[i].data(), orb::elements) == 0)
        ++descriptor_agree_;
      else
        report_difference("map_update: descriptor of row, point, keypoint", at.snapshot(), where(u, i));
    }
    update(at, u, true);
    for (std::size_t i = 0; i < count; ++i) {
      const auto& p = result_[i];
      const auto off = [](float a, float b) { return std::abs(static_cast<double>(a) - static_cast<double>(b)); };
      const double normal =
          std::max({off(p.normal.x, u.normal[i].x), off(p.normal.y, u.normal[i].y), off(p.normal.z, u.normal[i].z)});
      const double range = std::max(off(max_factor * p.max_distance / u.max_distance[i], 1),
                                    off(min_factor * p.min_distance / u.min_distance[i], 1));
      normal_error_ = std::max(normal_error_, normal), range_error_ = std::max(range_error_, range);
      if (normal <= tolerance && range <= tolerance)
        ++normal_range_agree_;
      else
        report_difference("map_update: normal or range of row, point, keypoint", at.snapshot(), where(u, i));
    }
    check_covisibility(at, u);
  }

  void add_json(nlohmann::json& json) const {
    json["map_update"] = {{"points", points_},
                          {"descriptor_agree", descriptor_agree_},
                          {"normal_range_agree", normal_range_agree_},
                          {"covisibility_agree", covisibility_agree_},
                          {"max_normal_error", normal_error_},
                          {"max_relative_range_error", range_error_},
                          {"covisible_keyframes", covisible_},
                          {"covisible_keyframes_agree", covisible_agree_}};
  }
  bool good() const {
    return descriptor_agree_ == points_ && normal_range_agree_ == points_ && covisibility_agree_ == points_ &&
           covisible_agree_ == covisible_;
  }

 private:
  static std::array<std::int32_t, 3> where(const turbomap::map_update_snapshot& u, std::size_t i) {
    return {static_cast<std::int32_t>(i), u.point[i], u.keypoint[i]};
  }

  /// All points of the record in one call.
  void update(const snapshot_scene<Camera, Policy>& at, const turbomap::map_update_snapshot& u, bool geometry) {
    const recorded_observers observers(u, [&](std::int32_t k) { return geometry || at.alive(k); });
    turbomap::appearance_options options;
    options.scales = scene_.recording.meta.pyramid();
    options.geometry = geometry, options.descriptors = !geometry;
    turbomap::update_appearance(scene_.ctx, observers.view(), turbomap::span<const posed>(keyframes_), options,
                                updates_);
    updates_.plan(scene_.ctx, result_, descriptors_);
  }

  /// A point agrees when each keyframe that sees it has the recorded weight (none below the least). Of the keyframes
  /// with equal weights the record has any order.
  void check_covisibility(const snapshot_scene<Camera, Policy>& at, const turbomap::map_update_snapshot& u) {
    const slot_map map(scene_.recording, at);
    turbomap::covisibility<slot_map> covisibility;
    std::map<std::int32_t, std::int32_t> ours, theirs;
    std::vector<std::int32_t> weights;
    for (const auto& c : covisibility(map, {map.current}, min_shared)) {
      ours[c.keyframe.index] = c.shared_points;
      weights.push_back(c.shared_points);
    }
    for (std::size_t i = 0; i < u.covis_kf.size(); ++i) theirs[u.covis_kf[i]] = u.covis_w[i];
    covisible_ += u.covis_kf.size();
    for (std::size_t i = 0; i < u.covis_kf.size(); ++i) {
      const auto found = ours.find(u.covis_kf[i]);
      const bool agree =
          found != ours.end() && found->second == u.covis_w[i] && i < weights.size() && weights[i] == u.covis_w[i];
      covisible_agree_ += agree ? 1 : 0;
      if (!agree)
        report_difference("map_update: covisible keyframe, weight, place", at.snapshot(),
                          {u.covis_kf[i], u.covis_w[i], static_cast<std::int32_t>(i)});
    }
    const auto weight = [](const std::map<std::int32_t, std::int32_t>& of, std::int32_t k) {
      const auto found = of.find(k);
      return found == of.end() ? 0 : found->second;
    };
    for (std::size_t i = 0; i < u.point.size(); ++i) {
      bool agree = true;
      for (const std::int32_t k : u.observers(i)) agree = agree && weight(ours, k) == weight(theirs, k);
      covisibility_agree_ += agree ? 1 : 0;
    }
  }

  recorded_scene<Camera, Policy>& scene_;
  turbomap::appearances<orb, Camera, Policy> updates_;
  std::vector<posed> keyframes_;
  std::vector<turbomap::point_appearance> result_;
  std::vector<orb::element> descriptors_;
  std::size_t points_ = 0, descriptor_agree_ = 0, normal_range_agree_ = 0, covisibility_agree_ = 0;
  std::size_t covisible_ = 0, covisible_agree_ = 0;
  double normal_error_ = 0, range_error_ = 0;
};

}  // namespace turbomap_replay

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Judges the points of a replay of a simulated recording by the simulator's ids: which of the points that mapping makes, of
/// the merges and of the observations are wrong.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/io/recording.hpp>
#include <turbomap/map/map_traits.hpp>
#include <turbomap/mapping/mapping_report.hpp>

namespace turbomap_replay {

struct points_verdict {
  std::size_t created = 0, created_wrong = 0;  ///< by mapping; wrong: keypoints do not all show one scene point
  std::size_t merged = 0, merged_wrong = 0;    ///< by fusion; wrong: points of two scene points
  /// In the final map. Wrong points: as above. Wrong observations: of another scene point than most of the point's, or of
  /// clutter. Duplicates: points of a scene point that has one already.
  std::size_t points = 0, points_wrong = 0, points_duplicate = 0, observations = 0, observations_wrong = 0;

  nlohmann::json json() const {
    const auto share = [](std::size_t part, std::size_t all) {
      return all == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(all);
    };
    return {{"created", created},
            {"created_wrong", created_wrong},
            {"merged", merged},
            {"merged_wrong", merged_wrong},
            {"points", points},
            {"points_wrong", points_wrong},
            {"points_wrong_share", share(points_wrong, points)},
            {"points_duplicate", points_duplicate},
            {"observations", observations},
            {"observations_wrong", observations_wrong},
            {"observations_wrong_share", share(observations_wrong, observations)}};
  }
};

template <class Map>
class points_judge {
 public:
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  static constexpr std::int32_t clutter = -1;

  explicit points_judge(const turbomap::recording& recording) : recording_(recording) {}

  /// The scene point that a keypoint shows. Ids of keyframes ascend as the keyframes of the log do.
  std::int32_t truth(const Map& map, keyframe k, std::size_t keypoint) const {
    const auto i = static_cast<std::size_t>(traits::id(map, k));
    return recording_.sim_point_id[static_cast<std::size_t>(recording_.kp_off[i]) + keypoint];
  }
  /// The scene point that most keypoints of a point show (of equal ones the least id), those of one keyframe left out;
  /// clutter if most show that, or none is left.
  std::int32_t truth(const Map& map, point p, keyframe left_out = {}) const { return views(map, p, left_out).scene; }

  /// After each stage of the mapper on keyframe `current`.
  void stage_done(const Map& map, keyframe current, turbomap::mapping_stage stage) {
    using turbomap::mapping_stage;
    if (stage == mapping_stage::search || stage == mapping_stage::point_culling) remember_slots(map, current);
    if (stage == mapping_stage::creation) {
      judge_created(map, current);
      remember_points(map);
    }
    if (stage == mapping_stage::fusion) {
      judge_merged(map);
      remember_points(map);  // it may be repeated
    }
  }
  points_verdict verdict(const Map& map) const {
    points_verdict v = verdict_;
    std::vector<std::int32_t> scenes;
    traits::for_each_point(map, [&](point p) {
      const view_count c = views(map, p);
      ++v.points;
      v.points_wrong += c.wrong != 0 ? 1 : 0;
      v.observations += c.all, v.observations_wrong += c.wrong;
      if (c.scene != clutter) scenes.push_back(c.scene);
    });
    std::sort(scenes.begin(), scenes.end());
    v.points_duplicate = static_cast<std::size_t>(scenes.end() - std::unique(scenes.begin(), scenes.end()));
    return v;
  }

 private:
  struct seen_point {
    point p;
    std::uint64_t id;
    std::int32_t scene;
  };
  struct view_count {
    std::int32_t scene = clutter;  ///< that most keypoints show
    std::size_t all = 0, wrong = 0;
  };

  view_count views(const Map& map, point p, keyframe left_out = {}) const {
    ids_.clear();
    traits::for_each_observation(map, p, [&](keyframe k, std::size_t i) {
      if (!(k == left_out)) ids_.push_back(truth(map, k, i));
    });
    std::sort(ids_.begin(), ids_.end());
    view_count c;
    c.all = ids_.size();
    std::size_t most = 0;
    for (std::size_t i = 0, j = 0; i < ids_.size(); i = j) {
      while (j < ids_.size() && ids_[j] == ids_[i]) ++j;
      if (j - i > most) most = j - i, c.scene = ids_[i];
    }
    c.wrong = c.scene == clutter ? c.all : c.all - most;
    return c;
  }

  void remember_slots(const Map& map, keyframe k) {
    had_.clear();
    for (std::size_t i = 0; i < traits::keypoint_count(map, k); ++i)
      had_.push_back(traits::point_at(map, k, i) == point{} ? 0 : 1);
  }
  void judge_created(const Map& map, keyframe k) {
    std::vector<point> created;
    for (std::size_t i = 0; i < traits::keypoint_count(map, k); ++i) {
      const point p = traits::point_at(map, k, i);
      if (had_[i] == 0 && !(p == point{}) && std::find(created.begin(), created.end(), p) == created.end())
        created.push_back(p);
    }
    verdict_.created += created.size();
    for (const point& p : created) verdict_.created_wrong += views(map, p).wrong != 0 ? 1 : 0;
  }
  void remember_points(const Map& map) {
    before_.clear();
    traits::for_each_point(map, [&](point p) { before_.push_back({p, traits::id(map, p), truth(map, p)}); });
  }
  void judge_merged(const Map& map) {
    std::unordered_map<std::uint64_t, std::int32_t> scene_of;
    for (const seen_point& b : before_) scene_of[b.id] = b.scene;
    for (const seen_point& b : before_) {
      if (traits::alive(map, b.p)) continue;
      const point into = traits::replacement(map, b.p);
      if (into == point{}) continue;
      ++verdict_.merged;
      verdict_.merged_wrong += b.scene == clutter || b.scene != scene_of[traits::id(map, into)] ? 1 : 0;
    }
  }

  const turbomap::recording& recording_;
  points_verdict verdict_;
  std::vector<std::uint8_t> had_;   ///< of each keypoint of the current keyframe, before creation
  std::vector<seen_point> before_;  ///< before fusion: the live points
  mutable std::vector<std::int32_t> ids_;
};

}  // namespace turbomap_replay

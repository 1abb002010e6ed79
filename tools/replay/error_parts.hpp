// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Where the trajectory error of a simulated recording's map comes from. The map's keyframes are adjusted again and again:
/// with the observations that the map has, with those of them that are right by the simulator's ids, with its points joined
/// that show one scene point, with all true observations of these scene points, and with all true observations. What each
/// step gains is the price of what it puts right.

#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/io/recording.hpp>
#include <turbomap/map/map_traits.hpp>

#include "batch_bound.hpp"
#include "trajectory_errors.hpp"

namespace turbomap_replay {

/// Every observation of a map, by the numbers of the recording, whose keyframes' ids ascend as those of the map do.
struct map_observations {
  std::vector<turbomap::vec3<double>> points;
  std::vector<std::int32_t> frame, keypoint, point;  ///< one row per observation
};

template <class Map>
map_observations gather_map_observations(const Map& map) {
  using traits = turbomap::map_traits<Map>;
  map_observations all;
  traits::for_each_point(map, [&](const typename traits::point& p) {
    traits::for_each_observation(map, p, [&](const typename traits::keyframe& k, std::size_t i) {
      all.frame.push_back(static_cast<std::int32_t>(traits::id(map, k)));
      all.keypoint.push_back(static_cast<std::int32_t>(i));
      all.point.push_back(static_cast<std::int32_t>(all.points.size()));
    });
    all.points.push_back(turbomap::cast<double>(traits::position(map, p)));
  });
  return all;
}

template <class Camera, class Policy>
class error_parts {
 public:
  /// \param T_cw, alive  by keyframe of the recording
  error_parts(const turbomap::recording& recording, const Policy& policy, const map_observations& map,
              const std::vector<turbomap::rigid_transform<double>>& T_cw, const std::vector<std::uint8_t>& alive)
      : recording_(recording), policy_(policy), map_(map), T_cw_(T_cw), alive_(alive), fixed_(alive.size()) {
    bool first = true;
    for (std::size_t i = 0; i < alive.size(); ++i) {
      keypoints_.push_back(recording.gather_keypoints(i));
      fixed_[i] = alive[i] == 0 || first ? 1 : 0;
      first = first && alive[i] == 0;
    }
    std::vector<std::map<std::int32_t, int>> votes(map.points.size());
    for (std::size_t r = 0; r < map.frame.size(); ++r)
      ++votes[static_cast<std::size_t>(map.point[r])][truth(map.frame[r], map.keypoint[r])];
    for (const auto& candidates : votes) {
      std::pair<std::int32_t, int> most{-1, 0};
      for (const auto& c : candidates)
        if (c.second > most.second) most = c;
      scene_.push_back(most.first);
    }
  }

  /// Errors in m, of the keyframes that are left, and how many observations each had.
  nlohmann::json operator()() const {
    true_observations own, right = at_truth(), joined = at_truth(), known = at_truth(), all = at_truth();
    own.T_cw = T_cw_, own.points = map_.points;
    numbering by_point, by_scene, of_known, of_all;
    std::map<std::int32_t, std::size_t> views;  // of scene points, by the keyframes that are left
    std::map<std::int32_t, bool> in_map;
    for (std::size_t f = 0; f < alive_.size(); ++f)
      for (std::size_t k = 0; alive_[f] != 0 && k < keypoints_[f].size(); ++k)
        ++views[truth(static_cast<std::int32_t>(f), static_cast<std::int32_t>(k))];
    for (std::size_t r = 0; r < map_.frame.size(); ++r) {
      const std::int32_t f = map_.frame[r], k = map_.keypoint[r], p = map_.point[r];
      const std::int32_t scene = scene_[static_cast<std::size_t>(p)];
      own.add(recording_, f, keypoint(f, k), p);
      if (scene < 0 || truth(f, k) != scene) continue;
      in_map[scene] = true;
      right.add(recording_, f, keypoint(f, k), number(by_point, p, scene, right));
      joined.add(recording_, f, keypoint(f, k), number(by_scene, scene, scene, joined));
    }
    for (std::size_t at = 0; at < alive_.size(); ++at)
      for (std::size_t i = 0; alive_[at] != 0 && i < keypoints_[at].size(); ++i) {
        const auto f = static_cast<std::int32_t>(at), k = static_cast<std::int32_t>(i);
        const std::int32_t scene = truth(f, k);
        if (scene < 0 || views[scene] < 2) continue;
        all.add(recording_, f, keypoint(f, k), number(of_all, scene, scene, all));
        if (in_map.count(scene) != 0) known.add(recording_, f, keypoint(f, k), number(of_known, scene, scene, known));
      }
    nlohmann::json json;
    const auto say = [&](const char* name, const true_observations& of) {
      json[name] = {{"observations", of.frame.size()}, {"points", of.points.size()}, {"ate_rmse_m", error(of)}};
    };
    say("own", own), say("right", right), say("joined", joined), say("known", known), say("all", all);
    return json;
  }

 private:
  using numbering = std::map<std::int32_t, std::int32_t>;

  std::int32_t truth(std::int32_t f, std::int32_t k) const {
    return recording_
        .sim_point_id[recording_.keypoints(static_cast<std::size_t>(f)).begin + static_cast<std::size_t>(k)];
  }
  const turbomap::keypoint& keypoint(std::int32_t f, std::int32_t k) const {
    return keypoints_[static_cast<std::size_t>(f)][static_cast<std::size_t>(k)];
  }
  true_observations at_truth() const {
    true_observations none;
    for (const auto& T : recording_.sim_T_cw_true) none.T_cw.push_back(turbomap::cast<double>(T));
    return none;
  }
  /// The number of a point among those of `to`, at its true position.
  std::int32_t number(numbering& numbers, std::int32_t point, std::int32_t scene, true_observations& to) const {
    const auto at = numbers.insert({point, static_cast<std::int32_t>(to.points.size())});
    if (at.second)
      to.points.push_back(turbomap::cast<double>(recording_.sim_point_xyz[static_cast<std::size_t>(scene)]));
    return at.first->second;
  }
  double error(const true_observations& of) const {
    const row_weights weights{simulated_correlation(recording_.meta)};
    return trajectory_error(recording_, adjust_observations<Camera>(recording_, policy_, of, fixed_, weights).T_cw,
                            alive_);
  }

  const turbomap::recording& recording_;
  const Policy& policy_;
  const map_observations& map_;
  const std::vector<turbomap::rigid_transform<double>>& T_cw_;
  const std::vector<std::uint8_t>& alive_;
  std::vector<std::uint8_t> fixed_;
  std::vector<std::vector<turbomap::keypoint>> keypoints_;
  std::vector<std::int32_t> scene_;  ///< by point of the map: what most of its keypoints show; negative: nothing
};

}  // namespace turbomap_replay

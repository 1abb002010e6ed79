// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Check of the creation of points, on the pairs that the recorded system found.

#include <algorithm>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/matching/given_correspondences.hpp>
#include <turbomap/matching/point_creation.hpp>

#include "check_search.hpp"
#include "recorded_scene.hpp"

namespace turbomap_replay {

template <class Camera, class Policy>
class creation_check {
 public:
  using posed = turbomap::posed_keyframe<orb, Camera>;
  using matches = turbomap::correspondences<orb, Camera, Policy>;
  using match = typename matches::plan_type::value_type;

  explicit creation_check(recorded_scene<Camera, Policy>& scene)
      : scene_(scene), matches_(scene.ctx), points_(scene.ctx) {}

  /// Each neighbour's pairs in one call.
  void check(const snapshot_scene<Camera, Policy>& at) {
    const turbomap::recording_snapshot& s = at.snapshot();
    turbomap::creation_options options;
    options.scales = scene_.recording.meta.pyramid();
    if (scene_.recording.meta.sensor == "inertial") options.max_parallax_cosine = 0.9996;
    for (std::size_t i = 0; i < s.search.neighbours.size(); ++i) {
      const auto pairs = s.pairs(i);
      if (pairs.empty()) continue;
      std::vector<match> given;
      for (const auto& pair : pairs) given.push_back({0, pair[0], pair[1], 0});
      const std::vector<posed> neighbour{at.at(s.search.neighbours[i])};
      turbomap::given_correspondences(scene_.ctx, at.at(s.keyframe), turbomap::span<const posed>(neighbour),
                                      turbomap::span<const match>(given),
                                      parity_options(scene_.recording, turbomap::candidates::exhaustive), matches_);
      turbomap::create_points(scene_.ctx, matches_, options, points_);
      const auto points = points_.plan(scene_.ctx, matches_);
      const auto first = static_cast<std::size_t>(s.search.pairs_off[i]);
      pairs_ += pairs.size();
      for (std::size_t k = 0; k < points.size(); ++k) {
        const std::size_t row = first + k;
        const bool agree = static_cast<int>(points[k].outcome) == s.creation.code[row] &&
                           static_cast<int>(points[k].method) == s.creation.method[row];
        if (agree)
          ++agree_;
        else
          report_difference("creation: decision on neighbour, keypoints", s,
                            {static_cast<std::int32_t>(i), pairs[k][0], pairs[k][1]});
        if (s.creation.code[row] == 0) {
          const auto& p = s.creation.position[row];
          position_error_ = std::max(position_error_, turbomap::norm(points[k].position - turbomap::cast<double>(p)));
        }
      }
    }
  }

  void add_json(nlohmann::json& json) const {
    json["creation"] = {{"pairs", pairs_}, {"decision_agree", agree_}, {"max_position_error_m", position_error_}};
  }
  bool good() const { return agree_ == pairs_ && position_error_ <= 1e-3; }

 private:
  recorded_scene<Camera, Policy>& scene_;
  matches matches_;
  turbomap::point_creation<Policy> points_;
  std::size_t pairs_ = 0, agree_ = 0;
  double position_error_ = 0;
};

}  // namespace turbomap_replay

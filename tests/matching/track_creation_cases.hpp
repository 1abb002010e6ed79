// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The checks of points from tracks, for every execution policy, host or device.

#include <turbomap/matching/track_creation.hpp>

#include "reference/larger_or_nan.hpp"
#include "reference/track_creation_oracle.hpp"
#include "tracks_cases.hpp"

namespace turbomap_test {

/// The points of a scene's tracks under one policy.
struct points_of_tracks {
  turbomap::track_list tracks;
  std::vector<turbomap::created_track> points;
  std::vector<std::uint8_t> kept;
};

template <class Policy, class Descriptor, class Camera>
points_of_tracks create_tracks_under(const Policy& policy, const scene<Descriptor, Camera>& s,
                                     turbomap::search_options options, const turbomap::creation_options& creation) {
  options.across_rig = true;
  turbomap::context<Policy> ctx(policy);
  const resident_scene<Descriptor, Camera, Policy> keyframes(ctx, s);
  const auto found = turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours(), options);
  turbomap::match_tracks<Descriptor, Camera, Policy> joined(ctx);
  turbomap::join_tracks(ctx, found, joined);
  turbomap::track_creation<Policy> made(ctx);
  turbomap::create_track_points(ctx, found, joined, creation, made);
  points_of_tracks result;
  result.tracks = joined.tracks();
  made.plan(ctx, result.points, result.kept);
  return result;
}

/// What was seen over many scenes.
struct track_point_tally {
  long tracks = 0, doubtful = 0, differences = 0, accepted = 0, of_many = 0, lost_views = 0;
  double worst_position = 0, worst_covariance = 0;  ///< relative
  std::vector<long> outcomes = std::vector<long>(14), methods = std::vector<long>(4);
};
inline void check_track_points(const track_point_tally& t, long least) {
  CAPTURE(t.tracks);
  CAPTURE(t.doubtful);
  CHECK(t.differences == 0);
  CHECK(t.doubtful * 100 <= t.tracks);
  CHECK(t.accepted >= least);
  CHECK(t.worst_position < 1e-9);
  CHECK(t.worst_covariance < 1e-5);  // kept in float
}

/// Points under `policy` == points under thrust::seq, to the last bit, and == the oracle.
template <class Policy, class Descriptor, class Camera>
void check_track_creation(const Policy& policy, scene<Descriptor, Camera>& s, turbomap::search_options options,
                          turbomap::creation_options creation, track_point_tally& t) {
  options.scales = creation.scales = s.scales();
  const auto got = create_tracks_under(policy, s, options, creation);
  if constexpr (!std::is_same_v<Policy, sequential>) {
    const auto expected = create_tracks_under(sequential{}, s, options, creation);
    CHECK(same(got.points, expected.points));
    for (std::size_t k = 0; k < got.points.size(); ++k)
      if (got.points[k].outcome == turbomap::creation_outcome::accepted)
        for (int i = got.tracks.offsets[k]; i < got.tracks.offsets[k + 1]; ++i)
          CHECK(got.kept[static_cast<std::size_t>(i)] == expected.kept[static_cast<std::size_t>(i)]);
  }
  const auto neighbours = s.neighbours();
  const auto expected = track_creation_oracle<Descriptor, Camera>(s.query(), neighbours, got.tracks, creation, options);
  REQUIRE(expected.size() == got.points.size());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    const auto& e = expected[k];
    const auto& p = got.points[k];
    ++t.tracks;
    ++t.outcomes[static_cast<std::size_t>(p.outcome)];
    ++t.methods[static_cast<std::size_t>(static_cast<int>(p.method) + 1)];
    if (e.doubtful) {
      ++t.doubtful;
      continue;
    }
    bool equal = e.outcome == p.outcome && e.method == p.method;
    if (equal && e.outcome == turbomap::creation_outcome::accepted) {
      ++t.accepted;
      int views = 0;
      for (std::size_t i = 0; i < e.kept.size(); ++i) {
        equal = equal && e.kept[i] == got.kept[static_cast<std::size_t>(got.tracks.offsets[k]) + i];
        views += e.kept[i];
      }
      equal = equal && views == p.views;
      t.of_many += views > 2 ? 1 : 0;
      t.lost_views += views < static_cast<int>(e.kept.size()) ? 1 : 0;
      const Eigen::Vector3d x(p.position.x, p.position.y, p.position.z);
      t.worst_position = larger_or_nan(t.worst_position, (x - e.position).norm() / (1 + e.position.norm()));
      Eigen::Matrix3d C;
      const auto& c = p.covariance;
      C << c.xx, c.yx, c.zx, c.yx, c.yy, c.zy, c.zx, c.zy, c.zz;
      t.worst_covariance = larger_or_nan(t.worst_covariance, (C - e.covariance).norm() / e.covariance.norm());
    }
    t.differences += equal ? 0 : 1;
  }
}

/// Points of a rig whose keypoints look alike, so that its two cameras match a lot: by the gates of a search, by wide ones, and where
/// many rays count as parallel.
template <class Descriptor = orb, class Policy, class Camera>
track_point_tally check_lookalikes(const Policy& policy, const test_rig<Camera>& rig, double ratio) {
  track_point_tally t;
  turbomap::creation_options creation;
  creation.lookalike_ratio = ratio;
  auto parallel = wide_gates();
  parallel.max_parallax_cosine = 0.99;
  for (unsigned seed = 81; seed < 84; ++seed) {
    scene_recipe recipe;
    recipe.seed = seed, recipe.neighbours = 1, recipe.mapped = 0.1, recipe.prototypes = 60;
    recipe.query_keypoints = 1000, recipe.neighbour_keypoints = 50;
    scene<Descriptor, Camera> s(rig, recipe);
    creation.known_chi2 = seed == 82 ? 500 : turbomap::creation_options{}.known_chi2;  // many are beside a match
    for (const auto& gates : {turbomap::search_options{}, wide_gates(), parallel})
      check_track_creation(policy, s, gates, creation, t);
  }
  check_track_points(t, 200);
  return t;
}

}  // namespace turbomap_test

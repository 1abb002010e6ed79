// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The check of joining matches to tracks, for every execution policy, host or device.

#include <turbomap/matching/tracks.hpp>

#include "matching_cases.hpp"
#include "reference/tracks_oracle.hpp"

namespace turbomap_test {

/// What tracks were seen over many scenes.
struct track_tally {
  long tracks = 0, longest = 0, contradictions = 0, own = 0;
};

/// Searches with the cameras of the rig among each other, joins, compares with the oracle.
template <class Policy, class Camera>
void check_tracks(const Policy& policy, scene<orb, Camera>& s, turbomap::search_options options, track_tally& t) {
  options.scales = s.scales();
  options.across_rig = true;
  turbomap::context<Policy> ctx(policy);
  const resident_scene<orb, Camera, Policy> keyframes(ctx, s);
  const auto found = turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours(), options);
  turbomap::match_tracks<orb, Camera, Policy> joined(ctx);
  for (int round = 0; round < 2; ++round) {  // the second time in memory that was used
    turbomap::join_tracks(ctx, found, joined);
    const auto camera_of = [&](int keyframe, int keypoint) {
      return s.frames[static_cast<std::size_t>(keyframe)].keypoints[static_cast<std::size_t>(keypoint)].camera;
    };
    const int own = s.frames[0].cameras.size() > 1 ? static_cast<int>(s.frames.size()) - 1 : -1;
    const auto plan = found.plan(ctx);
    CHECK(same(std::vector(joined.plan().begin(), joined.plan().end()), plan));
    CHECK(same_tracks(tracks_oracle(plan, camera_of, own), joined.tracks()));
  }
  const auto& tracks = joined.tracks();
  t.tracks += static_cast<long>(tracks.size());
  for (const auto o : tracks.outcomes) t.contradictions += o == turbomap::match_outcome::contradicts ? 1 : 0;
  for (std::size_t k = 0; k < tracks.size(); ++k) {
    const auto begin = static_cast<std::size_t>(tracks.offsets[k]);
    t.longest = std::max<long>(t.longest, tracks.offsets[k + 1] - tracks.offsets[k]);
    t.own += tracks.views[begin + 1].keyframe == 0 ? 1 : 0;
  }
}

}  // namespace turbomap_test

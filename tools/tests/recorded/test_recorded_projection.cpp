// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The search by projection on recorded keyframes and points, against its oracle, under every host policy.

#include <turbomap/fusion/projection_search.hpp>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "recorded_checks.hpp"
#include "reference/projection_oracle.hpp"
#include "replay/check_fusion.hpp"
#include "support/policies.hpp"

using namespace turbomap_test;

namespace {

/// The points of a keyframe's neighbourhood looked for in it, as tracking would; every third keypoint is taken.
template <class Camera, class Policy>
class projection_check {
 public:
  using orb = turbomap_replay::orb;
  using target = turbomap::projection_target<orb, Camera>;
  using targets = turbomap::span<const target>;

  explicit projection_check(turbomap_replay::recorded_scene<Camera, Policy>& scene) : scene_(scene) {}

  void check(const turbomap_replay::snapshot_scene<Camera, Policy>& s) {
    const auto& f = *s.snapshot().fusion;
    const turbomap_replay::gathered_points gathered(f.states, f.backward.state);
    auto points = gathered.view();
    const auto& view = s.view(s.snapshot().keyframe);
    std::vector<std::uint8_t> taken(static_cast<std::size_t>(view.keypoint_count), 0);
    for (std::size_t k = 0; k < taken.size(); k += 3) taken[k] = 1;
    target frame{view, s.T_cw(s.snapshot().keyframe)};
    frame.taken = taken;
    turbomap::projection_options options;
    options.scales = scene_.recording.meta.pyramid();
    options.min_range_factor = 1;  // recorded minima include the factor
    options.keep_trials = true;
    compare(points, frame, options);
    // Every second point is known to 5 cm only.
    std::vector<turbomap::point_covariance> covariance(static_cast<std::size_t>(points.count));
    for (std::size_t p = 0; p < covariance.size(); p += 2)
      covariance[p].xx = covariance[p].yy = covariance[p].zz = 0.0025F;
    points.covariance = covariance.data();
    compare(points, frame, options);
  }
  void add_json(nlohmann::json& json) const {
    json = {{"trials", trials_}, {"differences", differences_}, {"doubtful", doubtful_}, {"matched", matched_}};
  }
  bool good() const { return differences_ == 0; }

 private:
  void compare(const turbomap::map_point_view<orb>& points, const target& frame, turbomap::projection_options options) {
    const auto search = [&] {
      const auto found = turbomap::search_by_projection(scene_.ctx, points, targets(&frame, 1), options);
      return found.trials(scene_.ctx);
    };
    options.one_to_one = false;
    auto expected = search();
    const auto oracle = projection_oracle<orb, Camera>(points, targets(&frame, 1), options);
    for (std::size_t i = 0; i < oracle.size(); ++i) {
      const auto &a = expected.at(i), &b = oracle[i].trial;
      const bool same =
          a.outcome == b.outcome && a.level == b.level && a.keypoint == b.keypoint && a.distance == b.distance;
      ++trials_;
      doubtful_ += oracle[i].doubtful ? 1 : 0;
      differences_ += same || oracle[i].doubtful ? 0 : 1;
    }
    options.one_to_one = true;
    const auto settled = search();
    for (std::size_t i = 0; i < expected.size(); i += static_cast<std::size_t>(points.count))
      settle_oracle(expected.data() + i, points.count);
    for (std::size_t i = 0; i < expected.size(); ++i) {
      differences_ += settled[i].outcome == expected[i].outcome ? 0 : 1;
      matched_ += settled[i].outcome == turbomap::projection_outcome::matched ? 1 : 0;
    }
  }

  turbomap_replay::recorded_scene<Camera, Policy>& scene_;
  std::size_t trials_ = 0, differences_ = 0, doubtful_ = 0, matched_ = 0;
};

}  // namespace

TEST_CASE_TEMPLATE("recorded points are found in recorded keyframes as the oracle finds them", policy,
                   TURBOMAP_TEST_POLICIES) {
  for (const char* name : recordings) {
    const auto directory = data(std::string("recordings/") + name);
    if (!directory) continue;
    const verdict v = check_recording<projection_check>(*directory, policy{}, 3, [](turbomap::recording_snapshot&) {});
    CAPTURE(std::string(name));
    MESSAGE(std::string(name) << ": " << v.json.dump());
    CHECK(v.good);
    CHECK(number(v.json, "trials") > 5'000);
    CHECK(number(v.json, "matched") > 500);
    CHECK(number(v.json, "doubtful") * 500 < number(v.json, "trials"));
  }
}

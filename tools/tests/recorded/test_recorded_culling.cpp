// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Keyframe culling on every recorded snapshot, against what the recorded peer counted and decided; that the check
// sees a record that was changed; and culling of a consistent map made of the recorded observations.

#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/keyframe_culling.hpp>

#include <thrust/execution_policy.h>

#include <functional>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "recorded_checks.hpp"
#include "replay/check_culling.hpp"
#include "replay/repaired_map.hpp"

using turbomap_replay::culling_check;
using turbomap_replay::orb;
using namespace turbomap_test;

namespace {

using sequential = std::decay_t<decltype(thrust::seq)>;  // culling changes the map: it runs on the host alone
using snapshot = turbomap::recording_snapshot;

}  // namespace

TEST_CASE("recorded counts and decisions of keyframe culling are reproduced exactly") {
  std::size_t culled = 0, recordings_there = 0;
  for (const char* name : recordings) {
    const auto directory = data(std::string("recordings/") + name);
    if (!directory) continue;
    ++recordings_there;
    const auto v = check_recording<culling_check>(*directory, sequential{});
    CAPTURE(std::string(name));
    const nlohmann::json& c = v.json["culling"];
    MESSAGE(std::string(name) << ": " << c.dump());
    CHECK(v.good);
    CHECK(number(c, "keyframes") > 70);
    CHECK(number(c, "count_agree") == number(c, "keyframes"));
    CHECK(number(c, "decisions") >= number(c, "keyframes"));
    CHECK(number(c, "sequential_count_agree") == number(c, "decisions"));
    CHECK(number(c, "decision_agree") == number(c, "decisions"));
    CHECK(number(c, "kept_counts_agree") == number(c, "points"));
    culled += number(c, "culled");
  }
  if (recordings_there == 4) CHECK(culled == 9);
}

TEST_CASE("the check of culling sees each thing that is changed") {
  const auto differs = [&](const char* name, std::size_t snapshots, const char* key, const char* total,
                           const std::function<void(turbomap::culling_snapshot&)>& change) {
    const auto directory = data(std::string("recordings/") + name);
    if (!directory) return;
    const auto v = check_recording<culling_check>(*directory, sequential{}, snapshots, [&](snapshot& s) {
      if (s.culling->keyframe.size() > 5) change(*s.culling);
    });
    CAPTURE(std::string(key));
    CHECK_FALSE(v.good);
    CHECK(v.json["culling"][key] < v.json["culling"][total]);
  };
  const char* const stereo = "tum_room1_stereo";  // its second snapshot, of iteration 25, removes a keyframe
  const char* const inertial = "euroc_v102_inertial";
  differs(stereo, 2, "count_agree", "keyframes", [](auto& c) { ++c.dry_points[0]; });
  differs(stereo, 2, "count_agree", "keyframes", [](auto& c) { ++c.dry_redundant[0]; });
  differs(stereo, 2, "sequential_count_agree", "decisions", [](auto& c) { ++c.redundant[0]; });
  differs(stereo, 2, "decision_agree", "decisions", [](auto& c) {
    for (auto& status : c.status)
      if (status == turbomap::recorded_culling::culled) status = turbomap::recorded_culling::kept;
  });
  differs(stereo, 2, "decision_agree", "decisions", [](auto& c) { c.redundant_share = 0.5F; });
  // Without the guards of inertial systems other keyframes would go.
  differs(inertial, 3, "decision_agree", "decisions", [](auto& c) { c.inertial = false; });
}

namespace {

/// Counts by a walk over slots and observations, written from the rule.
template <class Repaired>
turbomap::redundancy plain_count(const Repaired& m, turbomap::map_keyframe_id k, double close) {
  turbomap::redundancy count;
  const auto keypoints = m.state.keypoints(k);
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const auto point = m.state.point_at(k, i);
    if (point == turbomap::map_point_id{} || !(keypoints[i].depth >= 0 && keypoints[i].depth <= close)) continue;
    ++count.points;
    std::set<std::int32_t> others;
    for (const auto& o : m.state.observations(point)) {
      const auto observer = m.state.keyframe_at(o.keyframe);
      const int octave = m.state.keypoints(observer)[static_cast<std::size_t>(o.keypoint)].octave;
      if (!(observer == k) && octave <= keypoints[i].octave + 1) others.insert(o.keyframe);
    }
    count.redundant += others.size() > 3 ? 1 : 0;
  }
  return count;
}

template <class Camera>
void cull_repaired(const turbomap::recording& r, const snapshot& s, std::size_t& erased) {
  const auto& c = *s.culling;
  turbomap_replay::repaired_map<Camera> m(r, s);
  CHECK(m.views * 10 > c.obs_kf.size() * 9);
  REQUIRE(turbomap::validate(m.state).empty());
  turbomap::keyframe_culling_options options;
  options.redundant_share = 0.5F;  // more goes than in the record
  options.max_depth = static_cast<float>(r.meta.close_depth);
  std::vector<turbomap::culling_record<turbomap::map_keyframe_id>> records;
  for (const std::int32_t index : c.keyframe) {
    const auto candidate = m.keyframes[static_cast<std::size_t>(index)];
    const auto expected = plain_count(m, candidate, options.max_depth);
    records.clear();
    turbomap::cull_keyframes(m.state, m.keyframes.back(), {&candidate, 1}, options, records);
    REQUIRE(records.size() == 1);
    const bool first = index == 0;
    CHECK((records[0].verdict == turbomap::culling_verdict::protected_) == first);
    if (first) continue;
    CHECK(records[0].count.points == expected.points);
    CHECK(records[0].count.redundant == expected.redundant);
    const bool goes = static_cast<float>(expected.redundant) > 0.5F * static_cast<float>(expected.points);
    CHECK((records[0].verdict == turbomap::culling_verdict::erased) == goes);
    CHECK(m.state.alive(candidate) == !goes);
    erased += goes ? 1 : 0;
  }
  CHECK(turbomap::validate(m.state).empty());
}

}  // namespace

TEST_CASE("culling of consistent maps made of recorded observations leaves them consistent") {
  for (const char* name : recordings) {
    const auto directory = data(std::string("recordings/") + name);
    if (!directory) continue;
    CAPTURE(std::string(name));
    const auto r = turbomap::read_recording(*directory);
    std::size_t erased = 0;
    for (const auto iteration : r.meta.snapshots) {
      const auto s = turbomap::read_snapshot(r, *directory, iteration);
      if (r.meta.is_fisheye())
        cull_repaired<turbomap::kannala_brandt<float>>(r, s, erased);
      else
        cull_repaired<turbomap::pinhole<float>>(r, s, erased);
    }
    MESSAGE(std::string(name) << ": " << erased << " keyframes taken out");
    CHECK(erased > 5);
  }
}

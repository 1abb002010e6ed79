// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stages of turbomap-bench that read a recorded map: appearances of points, counts for keyframe culling, and culling of the points
/// on probation. Each is compared with its oracle once.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "reference/appearance_oracle.hpp"
#include "reference/culling_oracle.hpp"

#include <turbomap/appearance/update_appearance.hpp>
#include <turbomap/mapping/keyframe_culling.hpp>
#include <turbomap/mapping/point_culling.hpp>

#include "map_stages.hpp"
#include "measure.hpp"
#include "replay/check_map_update.hpp"
#include "replay/recorded_scene.hpp"
#include "replay/repaired_map.hpp"

namespace turbomap_bench {

/// The points of one snapshot's update, with the keyframes as the policy and as the oracle read them.
template <class Camera>
struct recorded_update {
  using posed_type = turbomap::posed_keyframe<orb, Camera>;

  template <class Scene, class HostScene>
  recorded_update(const turbomap::recording_snapshot& s, const Scene& at, const HostScene& host_at,
                  std::size_t keyframes)
      : observers(*s.map_update, [](std::int32_t) { return true; }) {
    for (std::size_t k = 0; k < keyframes; ++k) {
      resident.push_back(at.at(static_cast<std::int32_t>(k)));
      host.push_back(host_at.at(static_cast<std::int32_t>(k)));
    }
  }
  turbomap_replay::recorded_observers observers;
  std::vector<posed_type> resident, host;
};

/// Descriptor, normal and range of the points that the recorded system updated after fusion.
template <class Camera, class Policy>
nlohmann::json time_recorded_update(turbomap_replay::recorded_scene<Camera, Policy>& scene,
                                    const std::vector<recorded_update<Camera>>& updates, int repetitions,
                                    double distance_ms) {
  using posed_type = turbomap::posed_keyframe<orb, Camera>;
  turbomap::appearances<orb, Camera, Policy> appearances(scene.ctx);
  std::vector<turbomap::point_appearance> found;
  std::vector<orb::element> descriptors;
  turbomap::appearance_options options;
  options.scales = scene.recording.meta.pyramid();
  const auto update = [&](const recorded_update<Camera>& u) {
    turbomap::update_appearance(scene.ctx, u.observers.view(), turbomap::span<const posed_type>(u.resident), options,
                                appearances);
    appearances.plan(scene.ctx, found, descriptors);
  };
  const auto by_definition = [&](const recorded_update<Camera>& u) {
    return turbomap_test::appearance_oracle(u.observers.view(), u.host, options);
  };
  // All distances between the descriptors of a point, and a ray per observation.
  stage_floor floor;
  for (const auto& u : updates) {
    update(u);
    const auto expected = by_definition(u);
    const auto view = u.observers.view();
    bool same = found.size() == expected.size();
    const auto near = [](float a, float b) { return std::abs(a - b) <= 1e-5F * std::max(1.0F, std::abs(b)); };
    for (std::size_t i = 0; same && i < expected.size(); ++i) {
      const auto &a = found[i], &b = expected[i];
      same = a.medoid == b.medoid && near(a.normal.x, b.normal.x) && near(a.normal.y, b.normal.y) &&
             near(a.normal.z, b.normal.z) && near(a.min_distance, b.min_distance) &&
             near(a.max_distance, b.max_distance);
      const double n = view.observation_offset[i + 1] - view.observation_offset[i];
      floor.distances += n * (n - 1) / 2, floor.transforms += n;
    }
    require_same(same, "map_update");
  }
  const auto ours = [&] {
    for (const auto& u : updates) update(u);
  };
  const auto oracle = [&] {
    for (const auto& u : updates) by_definition(u);
  };
  auto times = interleave(repetitions, ours, oracle, floor.ms(distance_ms));
  times["floor"] = floor.json();
  return times;
}

/// One recorded map, made consistent, as the library has it and as the oracle does; the candidates of keyframe culling and the points
/// on probation in it.
template <class Camera>
struct culled_map {
  using map_type = typename turbomap_replay::repaired_map<Camera>::map;
  using traits = turbomap::map_traits<map_type>;
  using probation = std::vector<turbomap::recent_point<turbomap::map_point_id>>;

  culled_map(const turbomap::recording& r, const turbomap::recording_snapshot& s) : now(s.keyframe) {
    turbomap_replay::repaired_map<Camera> repaired(r, s);
    current = traits::id(repaired.state, repaired.keyframes.back());
    for (const auto k : repaired.keyframes) {
      const auto keypoints = repaired.state.keypoints(k);
      oracle.keyframes[traits::id(repaired.state, k)] = {{keypoints.begin(), keypoints.end()},
                                                         traits::time(repaired.state, k)};
    }
    for (const auto p : repaired.points) {
      const auto id = traits::id(repaired.state, p);
      oracle.points[id];
      for (const auto& o : repaired.state.observations(p))
        oracle.observe(id, {traits::id(repaired.state, repaired.state.keyframe_at(o.keyframe)),
                            static_cast<std::size_t>(o.keypoint)});
    }
    for (const std::int32_t k : s.culling->keyframe)
      if (k != 0 && k != s.keyframe) candidates.push_back(repaired.keyframes[static_cast<std::size_t>(k)]);
    watch(r, s, repaired);
    map = std::move(repaired.state);
  }

  map_type map;
  turbomap_test::map_oracle oracle;
  turbomap_test::oracle_id current = 0;
  std::int64_t now;  ///< number of the keyframe
  std::vector<turbomap::map_keyframe_id> candidates;
  probation recent;
  std::vector<turbomap_test::oracle_recent> oracle_recent;
  std::map<turbomap_test::oracle_id, float> found_ratio;

 private:
  /// The recorded points on probation that are in the map.
  void watch(const turbomap::recording& r, const turbomap::recording_snapshot& s,
             turbomap_replay::repaired_map<Camera>& repaired) {
    const auto rows = r.recent(static_cast<std::size_t>(s.keyframe));
    std::set<turbomap_test::oracle_id> seen;
    for (std::size_t row = rows.begin; row < rows.end; ++row) {
      const auto [k, keypoint] = r.recent_ref[row];
      const auto made = std::find(r.kf_mnid.begin(), r.kf_mnid.end(), r.recent_firstkf_mnid[row]);
      if (k < 0 || k > s.keyframe || made == r.kf_mnid.end()) continue;
      const auto p =
          repaired.state.point_at(repaired.keyframes[static_cast<std::size_t>(k)], static_cast<std::size_t>(keypoint));
      if (p == turbomap::map_point_id{} || !seen.insert(traits::id(repaired.state, p)).second) continue;
      repaired.state.seen_in_tracking(p, static_cast<std::uint32_t>(r.recent_visible[row]),
                                      static_cast<std::uint32_t>(r.recent_found[row]));
      const std::int64_t since = made - r.kf_mnid.begin();
      recent.push_back({p, since}), oracle_recent.push_back({traits::id(repaired.state, p), since});
      found_ratio[oracle_recent.back().point] =
          static_cast<float>(r.recent_found[row]) / static_cast<float>(r.recent_visible[row]);
    }
  }
};

/// The redundant points of every candidate are counted; none is taken out. On the host under every policy.
template <class Camera>
nlohmann::json time_recorded_culling(std::vector<culled_map<Camera>>& maps, float close_depth, int repetitions) {
  using traits = typename culled_map<Camera>::traits;
  turbomap::keyframe_culling_options options;
  options.max_depth = close_depth;
  turbomap_test::oracle_culling_rules rules;
  rules.share = 1;  // more than all of them: never
  rules.max_depth = close_depth;
  std::vector<turbomap::redundancy> counts;
  // Their keypoints are known from a call before. In the stage, those of a new candidate are not.
  std::deque<turbomap::handle_table> stored;
  std::uint32_t slot = 0;
  for (const auto& m : maps) {
    stored.emplace_back();
    for (const auto k : m.candidates) stored.back().add(traits::id(m.map, k), {slot++, 1});
  }
  turbomap::redundancy_counter<typename culled_map<Camera>::map_type> counter;
  const auto count = [&](const culled_map<Camera>& m) {
    counter.remember_by(&stored[static_cast<std::size_t>(&m - maps.data())]);
    counts.clear(), counter.clear();
    for (const auto k : m.candidates) counts.push_back(counter(m.map, k, options));
  };
  const auto by_definition = [&](culled_map<Camera>& m) {
    std::vector<turbomap_test::oracle_id> ids;
    for (const auto k : m.candidates) ids.push_back(traits::id(m.map, k));
    std::multiset<turbomap_test::oracle_id> unused;
    return cull_keyframes_by_definition(m.oracle, m.current, ids, rules, unused);
  };
  stage_floor floor;
  std::size_t candidates = 0;
  for (auto& m : maps) {
    count(m);
    const auto expected = by_definition(m);
    bool same = counts.size() == expected.size();
    for (std::size_t i = 0; same && i < counts.size(); ++i) {
      same = counts[i].points == expected[i].points && counts[i].redundant == expected[i].redundant;
      // A slot per keypoint, and the counts of each point.
      floor.bytes += static_cast<double>(sizeof(std::int32_t) * m.map.keypoints(m.candidates[i]).size() +
                                         sizeof(std::uint32_t) * static_cast<std::size_t>(expected[i].points) *
                                             static_cast<std::size_t>(m.map.levels()));
    }
    require_same(same, "culling");
    candidates += m.candidates.size();
  }
  const auto ours = [&] {
    for (const auto& m : maps) count(m);
  };
  const auto oracle = [&] {
    for (auto& m : maps) by_definition(m);
  };
  auto times = interleave(repetitions, ours, oracle, floor.ms(0));
  times["floor"] = floor.json(), times["keyframes"] = candidates;
  return times;
}

/// One round over the points on probation; each time on maps of its own. On the host under every policy.
template <class Camera>
nlohmann::json time_recorded_point_culling(const std::vector<culled_map<Camera>>& maps, int repetitions) {
  using traits = typename culled_map<Camera>::traits;
  const turbomap::map_point_culling_options options;
  auto work = maps;
  std::vector<std::set<turbomap_test::oracle_id>> failed(maps.size());
  const auto ours = [&] {
    for (auto& m : work) turbomap::cull_recent_points(m.map, m.recent, m.now, options);
  };
  const auto oracle = [&] {
    for (std::size_t i = 0; i < work.size(); ++i)
      failed[i] = cull_points_by_definition(work[i].oracle, work[i].oracle_recent, work[i].now, work[i].found_ratio,
                                            options.min_found_ratio, options.fewest_measurements, options.patience,
                                            options.probation);
  };
  ours();
  oracle();
  std::size_t points = 0, dropped = 0;
  for (std::size_t i = 0; i < work.size(); ++i) {
    const auto& m = work[i];
    bool same = m.recent.size() == m.oracle_recent.size();
    for (std::size_t k = 0; same && k < m.recent.size(); ++k)
      same = traits::id(m.map, m.recent[k].point) == m.oracle_recent[k].point;
    for (const auto& r : maps[i].recent)
      same = same && traits::alive(m.map, r.point) == (failed[i].count(traits::id(maps[i].map, r.point)) == 0);
    require_same(same, "point_culling");
    points += maps[i].recent.size(), dropped += failed[i].size();
  }
  // Of each point its entry, what tracking counted and one count of measurements.
  stage_floor floor;
  floor.bytes = static_cast<double>(
      points * (sizeof(typename culled_map<Camera>::probation::value_type) + 3 * sizeof(std::uint32_t)));
  auto times = interleave(repetitions, ours, oracle, floor.ms(0), [&] { work = maps; });
  times["floor"] = floor.json(), times["points"] = points, times["dropped"] = dropped;
  return times;
}

}  // namespace turbomap_bench

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Local mapping for those who have no map: a simple_map, keyframes in flat arrays, and the local_mapper over both. The
/// images are simulated, and so is tracking: it finds three of four points of the keyframe before.

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>
#include <turbomap/map/validate.hpp>
#include <vector>

#include "wall_scene.hpp"

int main() {
  using map_type = turbomap::simple_map<example::orb, example::camera>;
  using traits = turbomap::map_traits<map_type>;
  example::wall_scene scene;
  const auto rig = turbomap::make_mono_rig(example::left_camera, example::left_camera.fx * example::baseline);

  turbomap::context ctx{thrust::host};
  map_type map;
  turbomap::keyframe_store<example::orb, example::camera> store;
  turbomap::local_mapper mapper(ctx, map, store,
                                turbomap::local_mapper_options::stereo(example::baseline, example::close_depth));
  std::map<int, turbomap::map_point_id> last_seen;  // landmark -> its point in the keyframe before
  std::map<std::uint64_t, std::vector<int>> truth;  // keyframe id -> landmark of each keypoint
  turbomap::map_keyframe_id previous;
  std::size_t created = 0, merged = 0, culled = 0;

  for (int n = 0; n < 24; ++n) {
    // Tracking makes a keyframe...
    const example::wall_view view = scene.look_from(0.3 * n, 0.1 * std::sin(n));
    const auto k = map.add_keyframe(view.keypoints, view.T_cw, n, previous);
    truth[traits::id(map, k)] = view.landmark;
    // ...and says which points of the map it sees; the first one makes points of its own, by stereo.
    for (std::size_t i = 0; i < view.keypoints.size(); ++i) {
      if (n == 0) {
        turbomap::observe(map, map.add_point(example::back_project(view, i), k), k, i);
      } else if (const auto seen = last_seen.find(view.landmark[i]); seen != last_seen.end() && (i + n) % 4 != 0) {
        const auto point = turbomap::resolve(map, seen->second);  // it may have been merged since, or dropped
        if (point != turbomap::map_point_id{}) turbomap::observe(map, point, k, i);
      }
    }

    // Local mapping.
    mapper.insert(k, turbomap::keyframe_data<example::orb, example::camera>{
                         static_cast<int>(view.keypoints.size()), view.keypoints.data(), view.descriptors.data(),
                         rig.cameras, 1, example::image});
    const turbomap::mapping_report& report = mapper.process(k);
    created += report.points_created, merged += report.fused.merged, culled += report.keyframes_culled.size();
    std::printf(
        "keyframe %2d: %zu neighbours, %3zu points created, %3zu merged, %3zu observations added, %zu keyframes "
        "culled, %.1f ms\n",
        n, report.neighbours, report.points_created, report.fused.merged, report.fused.observations_added,
        report.keyframes_culled.size(), report.total_ms);

    last_seen.clear();
    for (std::size_t i = 0; i < view.keypoints.size(); ++i)
      if (const auto point = map.point_at(k, i); point != turbomap::map_point_id{}) last_seen[view.landmark[i]] = point;
    previous = k;
  }

  // Every point must show one landmark, and lie where that is.
  std::size_t mixed = 0, far = 0;
  traits::for_each_point(map, [&](turbomap::map_point_id p) {
    int landmark = -1;
    bool same = true;
    traits::for_each_observation(map, p, [&](turbomap::map_keyframe_id k, std::size_t i) {
      const int l = truth.at(traits::id(map, k)).at(i);
      same = same && (landmark < 0 || l == landmark);
      landmark = l;
    });
    mixed += same ? 0 : 1;
    if (landmark >= 0) far += turbomap::norm(map.position(p) - scene.landmark(landmark)) <= 0.5 ? 0 : 1;
  });
  std::printf("%zu points (%zu created, %zu merged), %zu keyframes (%zu culled), %zu points mixed, %zu far off\n",
              map.point_count(), created, merged, map.keyframe_count(), culled, mixed, far);
  return turbomap::validate(map).empty() && mixed <= map.point_count() / 100 && far <= map.point_count() / 25 &&
                 merged > 0 && culled > 0
             ? 0
             : 1;
}

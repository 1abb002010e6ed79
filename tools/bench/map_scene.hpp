// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The map that turbomap-bench works on, as the library has it and as the oracles do: what tracking made of a simulated
/// recording, with its duplicates not yet fused.

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include <thrust/execution_policy.h>

#include "reference/serial_fusion_oracle.hpp"

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>
#include <turbomap/mapping/appearance_update.hpp>
#include <turbomap/mapping/handle_table.hpp>
#include <turbomap/store/keyframe_store.hpp>

#include "measure.hpp"
#include "replay/recorded_keyframes.hpp"

namespace turbomap_bench {

/// Keyframes and points have the same ids in both.
template <class Policy>
class map_scene {
 public:
  using map_type = turbomap::simple_map<orb, fisheye>;
  using traits = turbomap::map_traits<map_type>;
  using keyframe = turbomap::map_keyframe_id;
  using point = turbomap::map_point_id;
  using host_policy = thrust::detail::seq_t;

  map_scene(turbomap::context<Policy>& ctx, const turbomap::recording& recording)
      : ctx(ctx),
        store(turbomap_replay::recorded_store_options(recording.meta)),
        map(recording.meta.pyramid().levels),
        appearance(ctx),
        host_store_(turbomap_replay::recorded_store_options(recording.meta)) {
    update.scales = recording.meta.pyramid();
    insert_keyframes(recording);
    for (std::size_t i = 0; i < keyframes.size(); ++i) observe_points(recording, i);
    std::vector<point> all;
    for (const auto& [unused, p] : points) all.push_back(p);
    turbomap::guard_times unused;
    appearance({ctx, map, store, stored, unused}, all, update);
    copy_to_oracle();
  }
  map_scene(const map_scene&) = delete;
  map_scene& operator=(const map_scene&) = delete;

  keyframe query() const { return keyframes.back(); }

  turbomap::context<Policy>& ctx;
  turbomap::keyframe_store<orb, fisheye, turbomap::memory_of_t<Policy>> store;
  turbomap::handle_table stored;
  map_type map;
  std::vector<keyframe> keyframes;
  std::map<std::uint64_t, point> points;  ///< by id
  turbomap_test::serial_fusion_oracle<orb, fisheye> oracle;
  turbomap::appearance_options update;
  turbomap::appearance_update<map_type, Policy> appearance;

 private:
  void insert_keyframes(const turbomap::recording& recording) {
    const auto rig = turbomap_replay::recorded_rig<fisheye>(recording.meta);
    std::vector<turbomap::keypoint> keypoints;
    std::vector<turbomap::keyframe_handle> handles;
    for (std::size_t i = 0; i < recording.keyframe_count(); ++i) {
      const auto data = turbomap_replay::recorded_keyframe(recording, i, rig, keypoints);
      keyframes.push_back(map.add_keyframe(turbomap::span<const turbomap::keypoint>(keypoints),
                                           turbomap::cast<double>(recording.T_cw[i]),
                                           1e-9 * static_cast<double>(recording.t_ns[i]), previous()));
      stored.add(traits::id(map, query()), store.insert(data));
      handles.push_back(host_store_.insert(data));
      oracle.map.keyframes[traits::id(map, query())] = {keypoints, traits::time(map, query())};
    }
    pinned_.emplace(host_store_.pin(host_, turbomap::span<const turbomap::keyframe_handle>(handles)));
    for (std::size_t i = 0; i < keyframes.size(); ++i)
      oracle.keyframes[traits::id(map, keyframes[i])] = {(*pinned_)[i], map.T_cw(keyframes[i]), {}};
  }
  keyframe previous() const { return keyframes.empty() ? keyframe{} : keyframes.back(); }

  /// By the simulator's tracks: tracking's own points, and those that mapping made of its keypoints.
  void observe_points(const turbomap::recording& recording, std::size_t i) {
    const auto rows = recording.associations(i);
    for (std::size_t row = rows.begin; row < rows.end; ++row) {
      const auto keypoint = static_cast<std::size_t>(recording.assoc_kp[row]);
      const std::int32_t track = recording.sim_track_id[recording.keypoints(i).begin + keypoint];
      point& p = point_of_track_[track];
      if (p == point{}) {
        p = map.add_point(turbomap::cast<double>(recording.assoc_pos[row]), keyframes[i]);
        points[traits::id(map, p)] = p;
      }
      turbomap::observe(map, p, keyframes[i], keypoint);
    }
  }
  void copy_to_oracle() {
    for (const auto& [id, p] : points) {
      oracle.map.points[id].reference = traits::id(map, traits::reference(map, p));
      for (const turbomap::observation& o : map.observations(p))
        oracle.map.observe(id, {traits::id(map, map.keyframe_at(o.keyframe)), static_cast<std::size_t>(o.keypoint)});
      const auto* d = traits::descriptor_data(map, p);
      oracle.appearance[id] = {map.position(p),
                               traits::normal(map, p),
                               traits::min_distance(map, p),
                               traits::max_distance(map, p),
                               {d, d + orb::elements}};
    }
  }

  turbomap::context<host_policy> host_{thrust::seq};
  turbomap::keyframe_store<orb, fisheye> host_store_;
  std::optional<typename turbomap::keyframe_store<orb, fisheye>::pinned_type> pinned_;
  std::map<std::int32_t, point> point_of_track_;
};

}  // namespace turbomap_bench

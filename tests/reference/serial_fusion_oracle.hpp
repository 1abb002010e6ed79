// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The fusion of a neighbourhood as its definition reads: target by target, camera by camera, point by point, a search by
/// brute force; a commit after all of them (snapshot) or after each camera (serial); then new appearances. On the map oracle,
/// in plain double.

#include <turbomap/store/posed_keyframe.hpp>

#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "appearance_oracle.hpp"
#include "map_oracle.hpp"
#include "projection_oracle.hpp"

namespace turbomap_test {

/// What a search reads of a point, beside who sees it.
template <class Descriptor>
struct oracle_appearance {
  turbomap::vec3<double> position;
  turbomap::vec3<float> normal;
  float min_distance, max_distance;
  std::vector<typename Descriptor::element> descriptor;
};

template <class Descriptor, class Camera>
class serial_fusion_oracle {
 public:
  using keyframe = turbomap::posed_keyframe<Descriptor, Camera>;

  map_oracle map;
  std::map<oracle_id, oracle_appearance<Descriptor>> appearance;
  std::map<oracle_id, keyframe> keyframes;  ///< views in host memory
  struct {
    std::size_t entries = 0, observations_added = 0, merged = 0, stale = 0, already_observed = 0, conflicts = 0;
  } counts;                        ///< of all commits
  std::vector<oracle_id> touched;  ///< points that gained views
  std::size_t close_calls = 0;     ///< of all searches: trials that rounding may decide

  /// The points of the sources in every target. \param serial  each camera of a target sees the commit before it
  void pass(const std::vector<oracle_id>& sources, const std::vector<oracle_id>& targets, bool serial,
            const turbomap::duplicate_options& search, const oracle_merge_rule& rule) {
    std::vector<oracle_id> points;
    std::set<oracle_id> listed;
    for (const oracle_id k : sources)
      for (std::size_t i = 0; i < map.keyframes.at(k).keypoints.size(); ++i)
        if (const auto p = map.point_at({k, i}); p && listed.insert(*p).second) points.push_back(*p);
    std::vector<entry> plan;
    for (const oracle_id target : targets)
      for (int camera = 0; camera < keyframes.at(target).view.camera_count; ++camera) {
        const auto order = keypoints_by_cell(keyframes.at(target).view, camera);
        for (const oracle_id p : points) {
          if (map.points.count(p) == 0 || map.camera_sees(p, target, camera)) continue;
          const auto found = look_for(p, target, camera, order, search);
          if (found >= 0) plan.push_back({p, {target, static_cast<std::size_t>(found)}});
        }
        if (!serial) continue;
        commit(plan, rule, true);
        plan.clear();
      }
    commit(plan, rule, false);
  }

  /// Descriptors of points anew, normals and ranges too unless told otherwise.
  void refresh(const std::vector<oracle_id>& points, const turbomap::pyramid& scales, bool geometry = true) {
    std::vector<keyframe> all;
    std::map<oracle_id, std::int32_t> number;
    for (const auto& [id, k] : keyframes) number[id] = static_cast<std::int32_t>(all.size()), all.push_back(k);
    for (const oracle_id p : points) {
      if (map.points.count(p) == 0) continue;
      const auto& point = map.points.at(p);
      std::vector<turbomap::point_observation> seen;
      for (const oracle_view& v : point.views)
        seen.push_back({number.at(v.first), static_cast<std::int32_t>(v.second)});
      const std::int32_t offset[] = {0, static_cast<std::int32_t>(seen.size())};
      const auto observers = map.observers(p);
      const std::int32_t reference =
          number.at(point.reference && observers.count(*point.reference) != 0 ? *point.reference : *observers.begin());
      auto& mine = appearance.at(p);
      turbomap::appearance_options options;
      options.scales = scales;
      const auto updated =
          appearance_oracle<Descriptor, Camera>({1, &mine.position, offset, seen.data(), &reference}, all, options)[0];
      const auto& medoid = seen[static_cast<std::size_t>(updated.medoid)];
      const auto* d = all[static_cast<std::size_t>(medoid.keyframe)].view.descriptor_of(medoid.keypoint);
      mine.descriptor.assign(d, d + Descriptor::elements);
      if (!geometry) continue;
      mine.normal = updated.normal;
      mine.min_distance = updated.min_distance, mine.max_distance = updated.max_distance;
    }
  }

 private:
  using entry = std::pair<oracle_id, oracle_view>;  ///< a point was found at a keypoint

  std::int32_t look_for(oracle_id p, oracle_id target, int camera, const std::vector<int>& order,
                        const turbomap::duplicate_options& options) {
    const auto& a = appearance.at(p);
    const turbomap::map_point_view<Descriptor> one{
        1, &a.position, &a.normal, &a.min_distance, &a.max_distance, a.descriptor.data()};
    const auto& k = keyframes.at(target);
    const auto found = oracle_projection(one, 0, turbomap::duplicate_target<Descriptor, Camera>{k.view, k.T_cw, {}},
                                         camera, order, options);
    // Close calls count as well: a point that another camera of its reference keyframe saw has a range that ends within the
    // rounding of float from an octave, a thousand times what double needs.
    close_calls += found.doubtful ? 1 : 0;
    return found.trial.outcome == turbomap::duplicate_outcome::matched ? found.trial.keypoint : -1;
  }
  void commit(const std::vector<entry>& plan, const oracle_merge_rule& rule, bool refresh_survivors) {
    std::vector<oracle_id> survivors;
    for (const auto& [point, view] : plan) {
      ++counts.entries;
      const auto candidate = map.resolve(point);
      if (!candidate || map.keyframes.count(view.first) == 0) {
        ++counts.stale;
      } else if (map.camera_sees(*candidate, view.first, map.keypoint(view).camera)) {
        ++counts.already_observed;
      } else if (const auto holder = map.point_at(view); !holder) {
        map.observe(*candidate, view);
        touched.push_back(*candidate);
        ++counts.observations_added;
      } else {
        const bool candidate_goes = map.measurements(*holder) > map.measurements(*candidate);
        const oracle_id from = candidate_goes ? *candidate : *holder, into = candidate_goes ? *holder : *candidate;
        if (!map.merge(from, into, rule)) {
          ++counts.conflicts;
          continue;
        }
        touched.push_back(into), survivors.push_back(into);
        ++counts.merged;
      }
    }
    if (refresh_survivors) refresh(survivors, {}, false);
  }
};

}  // namespace turbomap_test

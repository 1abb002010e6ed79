// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Local mapping on a map of shared_ptr (shared_objects.hpp) whose objects die when they are erased. It watches every object by a
/// weak_ptr, and shows for how long the mapper keeps names of what has left the map. The mapper is a member of a class.

#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/validate.hpp>
#include <vector>

#include "shared_objects.hpp"

namespace {

using KeyFramePtr = std::shared_ptr<shared::KeyFrame>;
using PointPtr = std::shared_ptr<shared::MapPoint>;

/// The part of a system that runs local mapping. All types of the library can be written down; a context comes first, since the
/// mapper refers to it.
class LocalMapping {
 public:
  explicit LocalMapping(shared::Map& map)
      : map_(map),
        mapper_(context_, map, store_,
                turbomap::local_mapper_options::stereo(example::baseline, example::close_depth)) {}

  const turbomap::mapping_report& add(const KeyFramePtr& k, const std::vector<PointPtr>& created) {
    map_.replacements.next_round();
    mapper_.insert(k, *k);
    mapper_.watch(created);
    return mapper_.process(k);
  }

 private:
  shared::Map& map_;
  turbomap::context<> context_;
  turbomap::keyframe_store<example::orb, example::camera> store_;
  turbomap::local_mapper<shared::Map, turbomap::context<>::policy_type> mapper_;
};

/// How many of the objects that are watched have left the map and live on.
template <class Object>
std::size_t held(const std::map<std::uint64_t, std::weak_ptr<Object>>& watched) {
  std::size_t count = 0;
  for (const auto& [id, object] : watched)
    if (const auto alive = object.lock()) count += alive->erased ? 1 : 0;
  return count;
}

}  // namespace

int main() {
  shared::Map map;
  example::wall_scene scene;
  std::map<std::uint64_t, std::weak_ptr<shared::KeyFrame>> keyframes;
  std::map<std::uint64_t, std::weak_ptr<shared::MapPoint>> points;
  std::size_t merged = 0, culled = 0, most_held = 0, died = 0;
  {
    LocalMapping mapping(map);
    std::map<int, std::weak_ptr<shared::MapPoint>> last_seen;  // landmark -> its point in the keyframe before
    for (int n = 0; n < 24; ++n) {
      const auto k = std::make_shared<shared::KeyFrame>();
      k->id = static_cast<std::uint64_t>(n);
      k->view = scene.look_from(0.3 * n, 0.1 * std::sin(n));
      k->T_cw = k->view.T_cw;
      k->points.resize(k->view.keypoints.size());
      map.keyframes.emplace(k->id, k);
      keyframes[k->id] = k;
      std::vector<PointPtr> created;
      for (std::size_t i = 0; i < k->points.size(); ++i) {
        if (n == 0) {
          created.push_back(turbomap::map_traits<shared::Map>::add_point(map, example::back_project(k->view, i), k));
          turbomap::observe(map, created.back(), k, i);
        } else if (const auto seen = last_seen.find(k->view.landmark[i]); seen != last_seen.end() && (i + n) % 4 != 0) {
          // Dead without a trace, or merged since: then the table knows into what.
          const PointPtr p = seen->second.lock();
          if (p == nullptr) continue;
          if (const PointPtr now = turbomap::resolve(map, p)) turbomap::observe(map, now, k, i);
        }
      }
      const turbomap::mapping_report& report = mapping.add(k, created);
      merged += report.fused.merged, culled += report.keyframes_culled.size();

      last_seen.clear();
      for (std::size_t i = 0; i < k->points.size(); ++i)
        if (k->points[i] != nullptr) last_seen[k->view.landmark[i]] = k->points[i];
      for (const auto& [id, p] : map.points) points[id] = p;
      most_held = std::max(most_held, held(points) + held(keyframes));
    }
    map.replacements.clear();
    std::printf("%zu points merged, %zu keyframes culled; at most %zu erased objects were held by the mapper\n", merged,
                culled, most_held);
  }
  for (const auto& [id, p] : points) died += p.expired() ? 1 : 0;
  const std::size_t left = held(points) + held(keyframes);
  const auto faults = turbomap::validate(map);
  std::printf("%zu points in the map, %zu died, %zu erased objects are left, %zu faults\n", map.points.size(), died,
              left, faults.size());
  return merged > 0 && culled > 0 && left == 0 && died + map.points.size() == points.size() && faults.empty() ? 0 : 1;
}

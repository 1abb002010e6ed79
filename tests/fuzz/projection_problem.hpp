// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A problem of points and keyframes that see them, of any descriptor and camera: the duplicate search, the search by
/// projection and the appearance of points, on hostile points and keyframes.

#include <thrust/execution_policy.h>

#include <cmath>
#include <set>
#include <type_traits>
#include <utility>
#include <vector>

#include <turbomap/appearance/update_appearance.hpp>
#include <turbomap/fusion/duplicate_search.hpp>
#include <turbomap/fusion/projection_search.hpp>
#include <turbomap/store/keyframe_validation.hpp>

#include "hostile.hpp"
#include "hostile_descriptors.hpp"
#include "reference/appearance_oracle.hpp"
#include "scenes/duplicate_scene.hpp"

namespace turbomap_fuzz {

inline turbomap_test::duplicate_recipe draw_duplicates(choices& c) {
  turbomap_test::duplicate_recipe r;
  r.seed = c.byte(), r.targets = 1 + static_cast<int>(c.below(3)), r.points = static_cast<int>(c.below(16));
  r.clutter = static_cast<int>(c.below(12)), r.levels = 1 + static_cast<int>(c.below(8));
  const std::size_t grid = c.below(4);
  r.columns = grid == 0 ? 0 : static_cast<int>(7 * grid), r.rows = grid == 0 ? 0 : static_cast<int>(5 * grid);
  r.taken = c.flag() ? 0.2 : 0, r.uncertain = c.flag() ? 0.5 : 0, r.on_edge = c.flag() ? 0.2 : 0;
  r.skip = c.flag() ? 0.1 : -1, r.origin = c.flag() ? 0 : 1e5;
  r.prototypes = 1 + static_cast<int>(c.below(2));
  return r;
}

template <class Descriptor, class Camera>
class projection_problem {
  using policy = std::decay_t<decltype(thrust::seq)>;
  using scene_type = turbomap_test::duplicate_scene<Descriptor, Camera>;

 public:
  projection_problem(const turbomap_test::test_rig<Camera>& rig, choices& c) : scene_({rig}, draw_duplicates(c)) {
    for (unsigned n = c.byte() % 12; n > 0; --n) spoil_one(c);
    turbomap::keyframe_packing_options packing;
    packing.pyramid = scene_.scales();
    for (auto& f : scene_.frames) {
      turbomap::keyframe_data<Descriptor, Camera> d;
      d.keypoint_count = static_cast<int>(f.keypoints.size());
      d.keypoints = f.keypoints.data(), d.descriptors = f.descriptors.data();
      d.cameras = f.cameras.data(), d.camera_count = static_cast<int>(f.cameras.size()), d.bounds = f.bounds;
      if (!allowed([&] { turbomap::validate(d, packing); })) sound_ = false;
      if (sound_) scene_.repack(f);
    }
  }
  void run(choices& c) {
    if (!sound_) return;
    const auto targets = scene_.targets();
    duplicates(targets, c);
    projections(targets, c);
    appearance(targets, c);
  }

 private:
  void spoil_one(choices& c) {
    const unsigned what = c.byte() % 10;
    const std::size_t points = scene_.position.size();
    if (points > 0) {
      const std::size_t p = c.below(points);
      if (what == 0) scene_.position[p] = c.vector(20);
      if (what == 1) scene_.normal[p].x = c.single(1);
      if (what == 2) scene_.min_distance[p] = c.single(20), scene_.max_distance[p] = c.single(20);
      if (what == 3 && !scene_.covariance.empty()) scene_.covariance[p].xx = c.number(1);
      if (what == 8) spoil_descriptor<Descriptor>(scene_.descriptors, p, c);
    }
    if (scene_.frames.empty()) return;
    auto& f = scene_.frames[c.below(scene_.frames.size())];
    if (what == 4) spoil(f.T_cw, c);
    if (f.keypoints.empty()) return;
    const std::size_t i = c.below(f.keypoints.size());
    auto& k = f.keypoints[i];
    if (what == 5) k.x = c.single(800), k.y = c.single(500);
    if (what == 6) k.u_right = c.single(800), k.octave = static_cast<std::uint8_t>(c.below(9));
    if (what == 7) k = f.keypoints[c.below(f.keypoints.size())];
    if (what == 9) spoil_descriptor<Descriptor>(f.descriptors, i, c);
  }

  template <class Targets, class Plan>
  void check(const Targets& targets, const Plan& plan, double limit, bool once) {
    std::set<std::pair<int, int>> seen;
    for (const auto& m : plan) {
      expect(static_cast<std::size_t>(m.target) < targets.size(), "targets are there");
      const auto& target = targets[static_cast<std::size_t>(m.target)];
      expect(m.keypoint >= 0 && m.keypoint < target.view.keypoint_count, "keypoints are there");
      expect(target.view.camera_of(m.keypoint) == m.camera, "keypoints are of the camera");
      expect(static_cast<double>(m.distance) <= limit, "distances are within the limit");
      expect(static_cast<std::size_t>(m.point) < scene_.position.size(), "points are there");
      const auto& x = scene_.position[static_cast<std::size_t>(m.point)];
      expect(finite({x.x, x.y, x.z}), "points that are not finite match nothing");
      const auto* const mine = scene_.descriptors.data() + m.point * Descriptor::elements;
      expect(m.distance == Descriptor::distance(mine, target.view.descriptor_of(m.keypoint)),
             "distances are those of the descriptors");
      if (once) expect(seen.emplace(m.target, m.keypoint).second, "a keypoint goes to one point");
    }
  }
  template <class Targets>
  void duplicates(const Targets& targets, choices& c) {
    turbomap::duplicate_options o;
    o.scales = scene_.scales(), o.range_gate = c.flag(), o.keep_trials = c.flag();
    o.max_distance = draw_distance<Descriptor>(c);
    turbomap::duplicates<Descriptor, Camera, policy> found(ctx_);
    if (!allowed([&] { turbomap::find_duplicates(ctx_, scene_.points(), span(targets), o, found); })) return;
    check(targets, found.plan(ctx_), o.max_distance, false);
  }
  template <class Targets>
  void projections(const Targets& targets, choices& c) {
    turbomap::projection_options o;
    o.scales = scene_.scales(), o.range_gate = c.flag(), o.one_to_one = c.flag();
    o.max_distance = draw_distance<Descriptor>(c);
    o.gate = static_cast<turbomap::projection_gate>(c.below(3));
    o.max_ratio = c.flag() ? 1 : 0.8, o.radius = c.flag() ? 2.5 : 40, o.coarser_octaves = static_cast<int>(c.below(9));
    o.max_radius = c.flag() ? 40 : 1e30;
    turbomap::projections<Descriptor, Camera, policy> found(ctx_);
    if (!allowed([&] { turbomap::search_by_projection(ctx_, scene_.points(), span(targets), o, found); })) return;
    check(targets, found.plan(ctx_), o.max_distance, o.one_to_one);
  }
  /// Points with any observations.
  template <class Targets>
  void appearance(const Targets& targets, choices& c) {
    std::vector<turbomap::posed_keyframe<Descriptor, Camera>> keyframes;
    for (const auto& t : targets) keyframes.push_back({t.view, t.T_cw, {}});
    std::vector<std::int32_t> offset{0}, reference;
    std::vector<turbomap::point_observation> seen;
    for (std::size_t p = 0; p < scene_.position.size() && !keyframes.empty(); ++p) {
      reference.push_back(0);
      for (std::size_t n = c.below(5); n > 0; --n) {
        const std::size_t k = c.below(keyframes.size());
        const auto count = static_cast<std::size_t>(keyframes[k].view.keypoint_count);
        if (count == 0) continue;
        reference.back() = static_cast<std::int32_t>(k);
        seen.push_back({reference.back(), static_cast<std::int32_t>(c.below(count))});
      }
      offset.push_back(static_cast<std::int32_t>(seen.size()));
    }
    turbomap::appearance_view view;
    view.count = static_cast<int>(offset.size()) - 1, view.position = scene_.position.data();
    view.observation_offset = offset.data(), view.observations = seen.data(), view.reference = reference.data();
    turbomap::appearance_options o;
    o.scales = scene_.scales(), o.covariance = c.flag(), o.most_views = static_cast<int>(c.below(4));
    turbomap::appearances<Descriptor, Camera, policy> result(ctx_);
    if (!allowed([&] { turbomap::update_appearance(ctx_, view, span(keyframes), o, result); })) return;
    std::vector<turbomap::point_appearance> found;
    std::vector<typename Descriptor::element> descriptors;
    result.plan(ctx_, found, descriptors);
    for (std::size_t p = 0; p < found.size(); ++p)
      expect(found[p].medoid == medoid(keyframes, seen, offset[p], offset[p + 1], o.most_views),
             "the medoid is that of the definition");
  }
  /// By the definition, of the views that are chosen: at equal steps where there are too many; -1: there is none.
  template <class Keyframes>
  static int medoid(const Keyframes& keyframes, const std::vector<turbomap::point_observation>& seen, int begin,
                    int end, int most_views) {
    const int n = end - begin, take = most_views == 0 || most_views > n ? n : most_views;
    std::vector<int> chosen;
    std::vector<const typename Descriptor::element*> descriptors;
    for (int i = 0; i < take; ++i) {
      chosen.push_back(i * n / take);
      const auto& o = seen[static_cast<std::size_t>(begin + chosen.back())];
      descriptors.push_back(keyframes[static_cast<std::size_t>(o.keyframe)].view.descriptor_of(o.keypoint));
    }
    return take == 0 ? -1 : chosen[static_cast<std::size_t>(turbomap_test::oracle_medoid<Descriptor>(descriptors))];
  }
  template <class T>
  static turbomap::span<const T> span(const std::vector<T>& all) {
    return {all.data(), all.size()};
  }

  scene_type scene_;
  turbomap::context<policy> ctx_;
  bool sound_ = true;
};

}  // namespace turbomap_fuzz

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A matching problem of any descriptor and camera: search, filters, tracks and creation of points on hostile keyframes. The
/// ordered search must find what the exhaustive one finds, and filters must leave the same of both.

#include <thrust/execution_policy.h>

#include <cmath>
#include <memory>
#include <type_traits>
#include <vector>

#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/filters.hpp>
#include <turbomap/matching/point_creation.hpp>
#include <turbomap/matching/track_creation.hpp>
#include <turbomap/matching/tracks.hpp>
#include <turbomap/store/keyframe_store.hpp>

#include "hostile.hpp"
#include "hostile_descriptors.hpp"
#include "scenes/matching_scene.hpp"

namespace turbomap_fuzz {

inline turbomap_test::scene_recipe draw_scene(choices& c) {
  turbomap_test::scene_recipe r;
  r.seed = c.byte(), r.how = static_cast<turbomap_test::motion>(c.below(7));
  r.query_keypoints = static_cast<int>(c.below(24)), r.neighbour_keypoints = static_cast<int>(c.below(24));
  r.neighbours = static_cast<int>(c.below(4)), r.levels = 1 + static_cast<int>(c.below(8));
  r.stereo = static_cast<double>(c.below(3)) / 2, r.mapped = static_cast<double>(c.below(4)) / 4 - 0.25;
  r.prototypes = 1 + static_cast<int>(c.below(3)), r.noise = static_cast<int>(c.below(12));
  return r;
}

/// Another pose, keypoint or descriptor.
template <class Descriptor, class Camera>
void spoil(turbomap_test::scene_frame<Descriptor, Camera>& f, choices& c) {
  const unsigned what = c.byte() % 9;
  if (what == 0) return spoil(f.T_cw, c);
  if (f.keypoints.empty()) return;
  const std::size_t i = c.below(f.keypoints.size());
  auto& k = f.keypoints[i];
  if (what == 1) k.x = c.single(600);
  if (what == 2) k.y = c.single(600);
  if (what == 3) k.u_right = c.single(600);
  if (what == 4) k.depth = c.single(20);
  if (what == 5) k.octave = static_cast<std::uint8_t>(c.below(12)), k.angle = c.single(720);
  if (what == 6) k = f.keypoints[c.below(f.keypoints.size())];
  if (what == 7) k.group = c.flag() ? turbomap::keypoint::no_group : c.byte();
  if (what == 8) spoil_descriptor<Descriptor>(f.descriptors, i, c);
}

template <class Descriptor, class Camera>
class matching_problem {
  using policy = std::decay_t<decltype(thrust::seq)>;
  using posed = turbomap::posed_keyframe<Descriptor, Camera>;
  using matches_type = turbomap::correspondences<Descriptor, Camera, policy>;
  using plan_type = typename matches_type::plan_type;

 public:
  matching_problem(const turbomap_test::test_rig<Camera>& rig, choices& c)
      : scene_(rig, draw_scene(c)), matches_(ctx_) {
    options_.scales = scene_.scales();
    options_.max_distance = draw_distance<Descriptor>(c), options_.across_rig = c.flag();
    options_.ties = c.flag() ? turbomap::tie_rule::lowest_index : turbomap::tie_rule::highest_index;
    if (c.flag()) options_.line_chi2 = 60, options_.epipole_radius = 2, options_.reprojection_chi2 = 30;
    const unsigned again = c.byte();
    for (unsigned n = c.byte() % 12; n > 0; --n) spoil(scene_.frames[c.below(scene_.frames.size())], c);
    std::vector<turbomap::keyframe_handle> handles;
    turbomap::keyframe_store_options kept;
    kept.packing.pyramid = options_.scales, kept.packing.grid_columns = kept.packing.grid_rows = 0;
    kept.chunk_bytes = 1 << 12;
    store_ = std::make_unique<store_type>(kept);
    for (const auto& f : scene_.frames) {
      turbomap::keyframe_data<Descriptor, Camera> d;
      d.keypoint_count = static_cast<int>(f.keypoints.size());
      d.keypoints = f.keypoints.data(), d.descriptors = f.descriptors.data();
      d.cameras = f.cameras.data(), d.camera_count = static_cast<int>(f.cameras.size()), d.bounds = f.bounds;
      sound_ = allowed([&] { handles.push_back(store_->insert(d)); }) && sound_;
    }
    if (!sound_) return;
    pinned_ = store_->pin(ctx_, handles);
    for (std::size_t i = 0; i < handles.size(); ++i)
      all_.push_back({pinned_[i], scene_.frames[i].T_cw, scene_.frames[i].has_point});
    if (again % 4 == 1) all_.push_back(all_.front());
    if (again % 4 == 2) all_.push_back(all_.back());
  }
  void run(choices& c) {
    if (!sound_) return;
    const unsigned filters = c.byte();
    plan_type exhaustive, ordered, left, left_of_ordered;
    if (!search(turbomap::candidates::grouped)) return;
    filter(filters, left);
    expect(search(turbomap::candidates::exhaustive), "candidates do not decide what is refused");
    matches_.plan(ctx_, exhaustive);
    filter(filters, left);
    expect(search(turbomap::candidates::epipolar_ordered), "candidates do not decide what is refused");
    matches_.plan(ctx_, ordered);
    expect(same(exhaustive, ordered), "the ordered search finds what the exhaustive one finds");
    if (c.flag()) {
      filter(filters, left_of_ordered);
      expect(same(left, left_of_ordered), "filters leave the same of an ordered search");
    }
    create(c);
  }

 private:
  using store_type = turbomap::keyframe_store<Descriptor, Camera, turbomap::host_memory>;

  bool search(turbomap::candidates set) {
    options_.candidate_set = set;
    const turbomap::span<const posed> neighbours(all_.data() + 1, all_.size() - 1);
    if (!allowed([&] { turbomap::search_correspondences(ctx_, all_[0], neighbours, options_, matches_); }))
      return false;
    const auto& query = all_[0].view;
    for (const auto& m : matches_.plan(ctx_)) {
      // The query itself, across the rig, has the number after those of the neighbours.
      const auto n = static_cast<std::size_t>(m.neighbour);
      expect(n < neighbours.size() + (options_.across_rig ? 1 : 0), "neighbours are there");
      const auto& neighbour = (n == neighbours.size() ? all_[0] : neighbours[n]).view;
      expect(m.candidate >= 0 && m.candidate < neighbour.keypoint_count, "candidates are there");
      expect(m.query >= 0 && m.query < query.keypoint_count, "query keypoints are there");
      expect(m.distance >= 0 && static_cast<double>(m.distance) <= options_.max_distance,
             "distances are within the limit");
      expect(m.distance == Descriptor::distance(query.descriptor_of(m.query), neighbour.descriptor_of(m.candidate)),
             "distances are those of the descriptors");
    }
    return true;
  }
  static bool same(const plan_type& a, const plan_type& b) {
    if (a.size() != b.size()) return false;
    for (std::size_t i = 0; i < a.size(); ++i)
      if (a[i].neighbour != b[i].neighbour || a[i].query != b[i].query || a[i].candidate != b[i].candidate ||
          a[i].distance != b[i].distance)
        return false;
    return true;
  }
  /// \param left  what is left of the matches
  void filter(unsigned which, plan_type& left) {
    if (which & 1U) turbomap::filter(ctx_, matches_, turbomap::ratio_test{0.9});
    if (which & 2U) turbomap::filter(ctx_, matches_, turbomap::mutual_best{});
    if (which & 4U) allowed([&] { turbomap::filter(ctx_, matches_, turbomap::rotation_histogram{}); });
    if (which & 8U) turbomap::filter(ctx_, matches_, turbomap::one_to_one{});
    matches_.plan(ctx_, left);
  }
  void create(choices& c) {
    turbomap::creation_options o;
    o.scales = options_.scales;
    o.max_distance = c.flag() ? 0 : 100, o.fewest_keyframes = 1 + static_cast<int>(c.below(3));
    o.stereo_correlation = c.flag() ? 0 : 0.6, o.lookalike_ratio = static_cast<double>(c.below(6)) / 5;
    turbomap::point_creation<policy> pairs(ctx_);
    turbomap::create_points(ctx_, matches_, o, pairs);
    for (const auto& p : pairs.plan(ctx_, matches_))
      if (p.outcome == turbomap::creation_outcome::accepted)
        expect(finite({p.position.x, p.position.y, p.position.z}), "points of pairs are finite");
    turbomap::match_tracks<Descriptor, Camera, policy> tracks(ctx_);
    turbomap::join_tracks(ctx_, matches_, tracks);
    turbomap::track_creation<policy> creation(ctx_);
    turbomap::create_track_points(ctx_, matches_, tracks, o, creation);
    std::vector<turbomap::created_track> points;
    std::vector<std::uint8_t> kept;
    creation.plan(ctx_, points, kept);
    for (const auto& p : points) {
      if (p.outcome != turbomap::creation_outcome::accepted) continue;
      expect(p.views >= 2, "points of tracks have two views");
      expect(finite({p.position.x, p.position.y, p.position.z}), "points of tracks are finite");
      expect(finite({p.covariance.xx, p.covariance.yy, p.covariance.zz}) && p.covariance.xx >= 0 &&
                 p.covariance.yy >= 0 && p.covariance.zz >= 0,
             "variances of points are finite");
    }
  }

  turbomap_test::scene<Descriptor, Camera> scene_;
  turbomap::context<policy> ctx_;
  turbomap::search_options options_;
  std::unique_ptr<store_type> store_;
  typename store_type::pinned_type pinned_;
  std::vector<posed> all_;  ///< the query first
  matches_type matches_;
  bool sound_ = true;  ///< every keyframe is in the store
};

}  // namespace turbomap_fuzz

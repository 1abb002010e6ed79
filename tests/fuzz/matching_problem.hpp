// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A matching problem of any descriptor and camera: search, filters, tracks and creation of points on hostile
/// keyframes. The ordered search must find what the exhaustive one finds, and filters must leave the same of both, and
/// of the same matches given by a user. Given matches that are wrong are refused.

#include <thrust/execution_policy.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <set>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/filters.hpp>
#include <turbomap/matching/given_correspondences.hpp>
#include <turbomap/matching/point_creation.hpp>
#include <turbomap/matching/track_creation.hpp>
#include <turbomap/matching/tracks.hpp>
#include <turbomap/store/keyframe_store.hpp>

#include "hostile.hpp"
#include "hostile_descriptors.hpp"
#include "reference/same_plans.hpp"
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

/// Keypoint i becomes what the next camera of the rig sees of another keypoint, at some depth: two such look alike.
template <class Descriptor, class Camera>
void see_twice(turbomap_test::scene_frame<Descriptor, Camera>& f, std::size_t i, choices& c) {
  const std::size_t other = c.below(f.keypoints.size()), length = Descriptor::elements;
  const double depth = 0.2 * static_cast<double>(1 + c.below(32));
  turbomap::keypoint k = f.keypoints[other];
  if (other == i || f.cameras.size() < 2 || k.camera >= f.cameras.size()) return;
  const auto& from = f.cameras[k.camera];
  k.camera = static_cast<std::uint8_t>((k.camera + 1U) % f.cameras.size());
  const auto& to = f.cameras[k.camera];
  turbomap::vec3<double> ray{};
  turbomap::vec2<double> pixel{};
  const turbomap::vec2<double> seen{static_cast<double>(k.x), static_cast<double>(k.y)};
  if (!from.camera.unproject(seen, ray)) return;
  using turbomap::operator*;
  const auto in_body = turbomap::inverse(turbomap::to_isometry<double>(from.T_camera_body)) * (depth * ray);
  if (!to.camera.project(turbomap::to_isometry<double>(to.T_camera_body) * in_body, pixel)) return;
  const auto& b = f.bounds;
  if (!(pixel.x >= b.min_x && pixel.x < b.max_x && pixel.y >= b.min_y && pixel.y < b.max_y)) return;
  k.x = static_cast<float>(pixel.x), k.y = static_cast<float>(pixel.y);
  f.keypoints[i] = k;
  std::copy_n(f.descriptors.data() + other * length, length, f.descriptors.data() + i * length);
}

/// Another pose, keypoint or descriptor.
template <class Descriptor, class Camera>
void spoil(turbomap_test::scene_frame<Descriptor, Camera>& f, choices& c) {
  const unsigned what = c.byte() % 11;
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
  if (what > 8) see_twice(f, i, c);
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
    expect(turbomap_test::same(exhaustive, ordered), "the ordered search finds what the exhaustive one finds");
    if (c.flag()) {
      filter(filters, left_of_ordered);
      expect(turbomap_test::same(left, left_of_ordered), "filters leave the same of an ordered search");
    }
    create(c);
    if (c.flag()) {
      std::reverse(exhaustive.begin(), exhaustive.end());  // in any order
      expect(give(exhaustive), "what was found may be given");
      expect(turbomap_test::same(ordered, matches_.plan(ctx_)), "what was given is there");
      filter(filters, left_of_ordered);
      expect(turbomap_test::same(left, left_of_ordered), "filters leave the same of matches that were given");
    }
    if (c.flag()) give_any(filters, c);
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
  bool give(const plan_type& matches) {
    const turbomap::span<const posed> neighbours(all_.data() + 1, all_.size() - 1);
    return allowed([&] {
      turbomap::given_correspondences(
          ctx_, all_[0], neighbours, turbomap::span<const typename plan_type::value_type>(matches), options_, matches_);
    });
  }
  /// Matches as a search would never find them, one or two of which may be wrong.
  void give_any(unsigned filters, choices& c) {
    const std::size_t neighbours = all_.size() - 1 + (options_.across_rig && all_[0].view.camera_count > 1 ? 1 : 0);
    const auto count = [&](std::int32_t n) {
      return (static_cast<std::size_t>(n) + 1 < all_.size() ? all_[static_cast<std::size_t>(n) + 1] : all_[0])
          .view.keypoint_count;
    };
    const auto any = [&c](std::size_t n, unsigned wrong) {  // 0: an index below n
      return wrong == 0 ? static_cast<std::int32_t>(c.below(n)) : static_cast<std::int32_t>(wrong == 1 ? n : -1);
    };
    const auto queries = static_cast<std::size_t>(all_[0].view.keypoint_count);
    const bool careful = c.byte() % 4 != 3;  // what is wrong is left out
    bool sound = true;
    plan_type given;
    std::set<std::pair<std::int32_t, std::int32_t>> pairs;
    for (std::size_t left = c.below(24); left > 0 && neighbours > 0; --left) {
      const unsigned wrong = c.byte() % 32 == 31 ? 1 + c.byte() % 6 : 0;  // which index, and beyond which end
      typename plan_type::value_type m{};
      m.neighbour = any(neighbours, wrong < 3 ? wrong : 0);
      m.query = any(queries, wrong == 3 || wrong == 4 ? wrong - 2 : 0);
      const bool there = wrong == 0 || wrong > 2;
      m.candidate = any(there ? static_cast<std::size_t>(count(m.neighbour)) : 1, wrong > 4 ? wrong - 4 : 0);
      m.distance = draw_given_distance(c);
      const bool good = may_be_given(m, neighbours) && pairs.insert({m.neighbour, m.query}).second;
      if (careful && !good) continue;
      given.push_back(m), sound = sound && good;
    }
    const plan_type before = matches_.plan(ctx_);
    expect(give(given) == sound, "wrong matches are refused, and no others");
    if (sound)
      std::sort(given.begin(), given.end(), [](const auto& a, const auto& b) {
        return std::tie(a.neighbour, a.query) < std::tie(b.neighbour, b.query);
      });
    expect(turbomap_test::same(matches_.plan(ctx_), sound ? given : before),
           "what was given is there, and what was there else");
    if (!sound) return;
    plan_type left;
    filter(filters, left);
    for (const auto& m : left)
      expect(std::any_of(given.begin(), given.end(), [&m](const auto& g) { return turbomap_test::same(g, m); }),
             "filters add nothing");
    create(c);
  }
  /// As the documentation says.
  bool may_be_given(const typename plan_type::value_type& m, std::size_t neighbours) const {
    const auto is_free = [](const posed& k, std::int32_t i) {
      return i >= 0 && i < k.view.keypoint_count &&
             (k.has_point.empty() || k.has_point[static_cast<std::size_t>(i)] == 0);
    };
    if (m.neighbour < 0 || static_cast<std::size_t>(m.neighbour) >= neighbours) return false;
    const auto n = static_cast<std::size_t>(m.neighbour) + 1;
    return is_free(all_[0], m.query) && is_free(n < all_.size() ? all_[n] : all_[0], m.candidate) && m.distance >= 0;
  }
  static auto draw_given_distance(choices& c) {
    using distance = typename Descriptor::distance_type;
    const unsigned kind = c.byte();
    if constexpr (std::is_floating_point_v<distance>) {
      if (kind % 64 == 63) return static_cast<distance>(c.single(2));
    } else if (kind % 64 == 63) {
      return c.flag() ? distance{-1} : std::numeric_limits<distance>::max();
    }
    return static_cast<distance>(kind);
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
    std::vector<turbomap::created_track> points, of_all;
    std::vector<std::uint8_t> kept, kept_of_all;
    creation.plan(ctx_, points, kept);
    const double ratio = o.lookalike_ratio;
    o.lookalike_ratio = 0;
    turbomap::create_track_points(ctx_, matches_, tracks, o, creation);
    creation.plan(ctx_, of_all, kept_of_all);
    for (std::size_t t = 0; t < points.size(); ++t) {
      const auto& p = points[t];
      const bool alike = p.outcome == turbomap::creation_outcome::lookalike;
      expect(of_all[t].outcome == (alike ? turbomap::creation_outcome::accepted : p.outcome),
             "nothing but lookalikes is left out for what looks as similar");
      const auto [views, keyframes] = count_kept(tracks.tracks(), t, kept_of_all);
      expect(!alike || (ratio > 0 && views == 2 && keyframes == 1), "lookalikes are of two cameras of one keyframe");
      if (p.outcome != turbomap::creation_outcome::accepted) continue;
      expect(p.views >= 2 && p.views == views, "points of tracks have two views");
      expect(keyframes >= o.fewest_keyframes, "points of tracks are seen by as many keyframes as were asked for");
      expect(finite({p.position.x, p.position.y, p.position.z}), "points of tracks are finite");
      expect(finite({p.covariance.xx, p.covariance.yy, p.covariance.zz}) && p.covariance.xx >= 0 &&
                 p.covariance.yy >= 0 && p.covariance.zz >= 0,
             "variances of points are finite");
    }
  }
  /// The views of track t that are kept, and how many keyframes they are of.
  static std::pair<int, int> count_kept(const turbomap::track_list& tracks, std::size_t t,
                                        const std::vector<std::uint8_t>& kept) {
    std::set<std::int32_t> keyframes;
    int views = 0;
    for (auto v = static_cast<std::size_t>(tracks.offsets[t]); v < static_cast<std::size_t>(tracks.offsets[t + 1]); ++v)
      if (kept[v] != 0) keyframes.insert(tracks.views[v].keyframe), ++views;
    return {views, static_cast<int>(keyframes.size())};
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

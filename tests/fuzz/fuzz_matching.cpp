// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Search, filters, tracks and creation of points on hostile keyframes: any pixels, equal descriptors, the query as its own
// neighbour, the same neighbour twice, rigs. The ordered search must find what the exhaustive one finds.

#include <thrust/execution_policy.h>

#include <memory>
#include <type_traits>
#include <vector>

#include <turbomap/descriptor/binary.hpp>
#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/filters.hpp>
#include <turbomap/matching/point_creation.hpp>
#include <turbomap/matching/track_creation.hpp>
#include <turbomap/matching/tracks.hpp>
#include <turbomap/store/keyframe_store.hpp>

#include "hostile.hpp"
#include "scenes/matching_scene.hpp"

using namespace turbomap_fuzz;

namespace {

using orb = turbomap::binary_descriptor<256>;
using policy = std::decay_t<decltype(thrust::seq)>;

turbomap_test::scene_recipe recipe(choices& c) {
  turbomap_test::scene_recipe r;
  r.seed = c.byte(), r.how = static_cast<turbomap_test::motion>(c.below(7));
  r.query_keypoints = static_cast<int>(c.below(24)), r.neighbour_keypoints = static_cast<int>(c.below(24));
  r.neighbours = static_cast<int>(c.below(4)), r.levels = 1 + static_cast<int>(c.below(8));
  r.stereo = static_cast<double>(c.below(3)) / 2, r.mapped = static_cast<double>(c.below(4)) / 4 - 0.25;
  r.prototypes = 1 + static_cast<int>(c.below(3)), r.noise = static_cast<int>(c.below(12));
  return r;
}

template <class Frame>
void spoil_frame(Frame& f, choices& c) {
  const unsigned what = c.byte() % 8;
  if (what == 0) return spoil(f.T_cw, c);
  if (f.keypoints.empty()) return;
  auto& k = f.keypoints[c.below(f.keypoints.size())];
  if (what == 1) k.x = c.single(600);
  if (what == 2) k.y = c.single(600);
  if (what == 3) k.u_right = c.single(600);
  if (what == 4) k.depth = c.single(20);
  if (what == 5) k.octave = static_cast<std::uint8_t>(c.below(12)), k.angle = c.single(720);
  if (what == 6) k = f.keypoints[c.below(f.keypoints.size())];
  if (what == 7) k.group = c.flag() ? turbomap::keypoint::no_group : c.byte();
}

template <class Camera>
class problem {
  using posed = turbomap::posed_keyframe<orb, Camera>;
  using matches_type = turbomap::correspondences<orb, Camera, policy>;
  using plan_type = typename matches_type::plan_type;

 public:
  problem(const turbomap_test::test_rig<Camera>& rig, choices& c) : scene_(rig, recipe(c)), matches_(ctx_) {
    options_.scales = scene_.scales();
    options_.max_distance = c.flag() ? 50 : 255, options_.across_rig = c.flag();
    options_.ties = c.flag() ? turbomap::tie_rule::lowest_index : turbomap::tie_rule::highest_index;
    if (c.flag()) options_.line_chi2 = 60, options_.epipole_radius = 2, options_.reprojection_chi2 = 30;
    const unsigned again = c.byte();
    for (unsigned n = c.byte() % 12; n > 0; --n) spoil_frame(scene_.frames[c.below(scene_.frames.size())], c);
    std::vector<turbomap::keyframe_handle> handles;
    turbomap::keyframe_store_options kept;
    kept.packing.pyramid = options_.scales, kept.packing.grid_columns = kept.packing.grid_rows = 0;
    kept.chunk_bytes = 1 << 12;
    store_ = std::make_unique<turbomap::keyframe_store<orb, Camera, turbomap::host_memory>>(kept);
    for (const auto& f : scene_.frames) {
      turbomap::keyframe_data<orb, Camera> d;
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
    plan_type exhaustive, ordered, grouped;
    if (!search(turbomap::candidates::exhaustive, exhaustive)) return;
    search(turbomap::candidates::grouped, grouped);
    filter(c);
    expect(search(turbomap::candidates::epipolar_ordered, ordered), "candidates do not decide what is refused");
    expect(same(exhaustive, ordered), "the ordered search finds what the exhaustive one finds");
    if (c.flag()) filter(c);
    create(c);
  }

 private:
  bool search(turbomap::candidates set, plan_type& plan) {
    options_.candidate_set = set;
    const turbomap::span<const posed> neighbours(all_.data() + 1, all_.size() - 1);
    if (!allowed([&] { turbomap::search_correspondences(ctx_, all_[0], neighbours, options_, matches_); }))
      return false;
    matches_.plan(ctx_, plan);
    for (const auto& m : plan) {
      // The query itself, across the rig, has the number after those of the neighbours.
      const auto n = static_cast<std::size_t>(m.neighbour);
      expect(n < neighbours.size() + (options_.across_rig ? 1 : 0), "neighbours are there");
      const auto& neighbour = (n == neighbours.size() ? all_[0] : neighbours[n]).view;
      expect(m.candidate >= 0 && m.candidate < neighbour.keypoint_count, "candidates are there");
      expect(m.query >= 0 && m.query < all_[0].view.keypoint_count, "query keypoints are there");
      expect(m.distance >= 0 && m.distance <= options_.max_distance, "distances are within the limit");
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
  void filter(choices& c) {
    const unsigned which = c.byte();
    if (which & 1U) turbomap::filter(ctx_, matches_, turbomap::ratio_test{0.9});
    if (which & 2U) turbomap::filter(ctx_, matches_, turbomap::mutual_best{});
    if (which & 4U) allowed([&] { turbomap::filter(ctx_, matches_, turbomap::rotation_histogram{}); });
    if (which & 8U) turbomap::filter(ctx_, matches_, turbomap::one_to_one{});
  }
  void create(choices& c) {
    turbomap::creation_options o;
    o.scales = options_.scales;
    o.max_distance = c.flag() ? 0 : 100, o.fewest_keyframes = 1 + static_cast<int>(c.below(3));
    o.stereo_correlation = c.flag() ? 0 : 0.6;
    turbomap::point_creation<policy> pairs(ctx_);
    turbomap::create_points(ctx_, matches_, o, pairs);
    for (const auto& p : pairs.plan(ctx_, matches_))
      if (p.outcome == turbomap::creation_outcome::accepted)
        expect(finite({p.position.x, p.position.y, p.position.z}), "points of pairs are finite");
    turbomap::match_tracks<orb, Camera, policy> tracks(ctx_);
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

  turbomap_test::scene<orb, Camera> scene_;
  turbomap::context<policy> ctx_;
  turbomap::search_options options_;
  std::unique_ptr<turbomap::keyframe_store<orb, Camera, turbomap::host_memory>> store_;
  turbomap::pinned_keyframes<orb, Camera, turbomap::host_memory> pinned_;
  std::vector<posed> all_;
  matches_type matches_;
  bool sound_ = true;
};

template <class Camera>
void run(const turbomap_test::test_rig<Camera>& rig, choices& c) {
  problem<Camera>(rig, c).run(c);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  const unsigned rig = c.byte() % 5;
  if (rig < 2)
    run(turbomap_test::pinhole_rig(rig == 0 ? 0 : 50), c);
  else
    run(turbomap_test::fisheye_rig(static_cast<int>(rig) - 1), c);
  return 0;
}

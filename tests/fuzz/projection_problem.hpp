// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A problem of points and keyframes that see them, of any descriptor and camera: the duplicate search, the search by
/// projection and the appearance of points, on hostile points and keyframes. Both searches are compared with the oracle, trial by
/// trial: what they found is right, and they found all.

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstring>
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
#include "reference/projection_oracle.hpp"
#include "reference/same_plans.hpp"
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
      if (what == 1) spoil_normal(scene_.normal[p], c);
      if (what == 2) (c.flag() ? scene_.min_distance : scene_.max_distance)[p] = c.single(20);
      if (what == 3) spoil_covariance(p, c);
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

  /// One number, or the length of the whole normal.
  static void spoil_normal(turbomap::vec3<float>& n, choices& c) {
    float* const all[] = {&n.x, &n.y, &n.z};
    const std::size_t which = c.below(4);
    const float x = c.single(1);
    if (which < 3)
      *all[which] = x;
    else
      n.x *= x, n.y *= x, n.z *= x;
  }
  /// Points that are exact in every direction, in one, or in none; or one number, so that it need not be a covariance.
  void spoil_covariance(std::size_t p, choices& c) {
    scene_.covariance.resize(scene_.position.size());
    auto& C = scene_.covariance[p];
    float* const all[] = {&C.xx, &C.yx, &C.yy, &C.zx, &C.zy, &C.zz};
    if (c.flag()) {
      *all[c.below(6)] = c.single(1);
      return;
    }
    const float x = c.single(0.3), y = c.single(0.3), z = c.single(0.3), least = c.flag() ? 1e-4F : 0;
    C = {x * x + least, y * x, y * y + least, z * x, z * y, z * z + least};
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
  using distance_type = typename Descriptor::distance_type;
  using trial_type = turbomap::projection_trial<distance_type>;

  /// Whether the oracle's answer is the same for a point a little beside. Lenses and poses as here may magnify a rounding
  /// error by any factor, which the oracle's own close calls do not know: they are made for lenses that exist. Its derivatives
  /// are numeric, and it asks no Cholesky factor: gates of points with a covariance are a little wider and narrower, too.
  template <class Target>
  bool is_firm(const Target& target, int camera, int p, const turbomap::projection_options& options,
               const trial_type& expected) {
    const auto order = turbomap_test::keypoints_by_cell(target.view, camera);
    const auto holds = [&](const turbomap::projection_options& o) {
      const auto again = turbomap_test::oracle_projection(scene_.points(), p, target, camera, order, o);
      return !again.doubtful && turbomap_test::same(again.trial, expected);
    };
    const auto& mount = target.view.cameras[camera].T_camera_body;
    auto& X = scene_.position[static_cast<std::size_t>(p)];
    const turbomap::vec3<double> was = X;
    double far = std::abs(X.x) + std::abs(X.y) + std::abs(X.z);
    for (const auto& T : {mount, target.T_cw}) far += std::abs(T.tx) + std::abs(T.ty) + std::abs(T.tz);
    bool firm = true;
    for (double* const x : {&X.x, &X.y, &X.z})
      for (const double by : {-1e-9, 1e-9}) {
        *x += by * far;
        firm = firm && holds(options);
        X = was;
      }
    if (scene_.covariance.empty()) return firm;
    for (const double by : {0.97, 1.03}) {
      turbomap::projection_options o = options;
      o.mono_chi2 *= by, o.stereo_chi2 *= by, o.window_sigmas *= by, o.max_radius *= by;
      firm = firm && holds(o);
    }
    return firm;
  }
  /// The trials are the oracle's, but for close calls; without options.one_to_one, which the oracle does not know.
  template <class Targets, class Trials>
  void compare(const Targets& targets, const turbomap::projection_options& options, const Trials& trials) {
    const auto points = scene_.points();
    std::size_t at = 0;
    const auto oracle = turbomap_test::projection_oracle<Descriptor, Camera>(points, span(targets), options);
    expect(trials.size() == oracle.size(), "every point has a trial in every camera");
    for (const auto& target : targets)
      for (int camera = 0; camera < target.view.camera_count; ++camera)
        for (int p = 0; p < points.count; ++p, ++at)
          if (!oracle[at].doubtful && !turbomap_test::same(trials[at], oracle[at].trial))
            expect(!is_firm(target, camera, p, options, oracle[at].trial), "trials are those of the oracle");
  }
  /// The plan has every trial that matched, and nothing else.
  template <class Targets, class Trials, class Plan>
  void expect_all(const Targets& targets, const Trials& trials, const Plan& plan) {
    std::size_t trial = 0, found = 0;
    for (std::size_t t = 0; t < targets.size(); ++t)
      for (int camera = 0; camera < targets[t].view.camera_count; ++camera)
        for (int p = 0; p < scene_.points().count; ++p, ++trial) {
          const auto& a = trials[trial];
          if (a.outcome != turbomap::projection_outcome::matched) continue;
          expect(found < plan.size() &&
                     turbomap_test::same(plan[found], {static_cast<int>(t), camera, p, a.keypoint, a.distance}),
                 "what matches is in the plan");
          ++found;
        }
    expect(found == plan.size(), "what is in the plan matches");
  }
  template <class Targets>
  void duplicates(const Targets& targets, choices& c) {
    turbomap::duplicate_options o;
    o.scales = scene_.scales(), o.range_gate = c.flag(), o.coarser_octaves = static_cast<int>(c.below(3));
    o.max_distance = draw_distance<Descriptor>(c);
    turbomap::duplicates<Descriptor, Camera, policy> found(ctx_);
    o.keep_trials = true;
    if (!allowed([&] { turbomap::find_duplicates(ctx_, scene_.points(), span(targets), o, found); })) return;
    const auto trials = found.trials(ctx_);
    compare(targets, o, trials);
    expect_all(targets, trials, found.plan(ctx_));
    o.keep_trials = false;  // points that certainly match nothing are passed over then
    turbomap::find_duplicates(ctx_, scene_.points(), span(targets), o, found);
    const auto plan = found.plan(ctx_);
    check(targets, plan, o.max_distance, false);
    expect_all(targets, trials, plan);
  }
  turbomap::projection_options draw_projection(choices& c) const {
    turbomap::projection_options o;
    o.scales = scene_.scales(), o.range_gate = c.flag(), o.one_to_one = c.flag();
    o.max_distance = draw_distance<Descriptor>(c);
    o.gate = static_cast<turbomap::projection_gate>(c.below(3));
    o.max_ratio = c.flag() ? 1 : 0.8, o.radius = c.flag() ? 2.5 : 40, o.coarser_octaves = static_cast<int>(c.below(9));
    o.max_radius = c.flag() ? 40 : 1e30;
    const unsigned more = c.byte();
    static constexpr double factors[] = {1.6, 1, 0.5, 3}, cosines[] = {0.5, -1, 0, 0.9}, sigmas[] = {3, 0, 1, 30};
    o.oblique_factor = factors[more % 4], o.min_view_cosine = cosines[more / 4 % 4];
    o.window_sigmas = sigmas[more / 16 % 4], o.stereo_correlation = more / 64 % 2 == 0 ? 0 : 0.75;
    o.window_octave = more / 128 == 0 ? 0 : o.scales.levels - 1;
    return o;
  }
  template <class Targets>
  void projections(const Targets& targets, choices& c) {
    const turbomap::projection_options o = draw_projection(c);
    turbomap::projections<Descriptor, Camera, policy> found(ctx_);
    turbomap::projection_options plain = o;
    plain.keep_trials = true, plain.one_to_one = false;
    if (!allowed([&] { turbomap::search_by_projection(ctx_, scene_.points(), span(targets), plain, found); })) return;
    auto trials = found.trials(ctx_);
    compare(targets, plain, trials);
    if (o.one_to_one) {  // of these matches, each keypoint's best
      const std::size_t points = scene_.position.size();
      for (std::size_t i = 0; i < trials.size(); i += points)
        turbomap_test::settle_oracle(trials.data() + i, static_cast<int>(points));
      plain.one_to_one = true;
      turbomap::search_by_projection(ctx_, scene_.points(), span(targets), plain, found);
      const auto settled = found.trials(ctx_);
      for (std::size_t i = 0; i < trials.size(); ++i)
        expect(turbomap_test::same(settled[i], trials[i]), "a keypoint goes to the most similar point");
    }
    expect_all(targets, trials, found.plan(ctx_));
    turbomap::search_by_projection(ctx_, scene_.points(), span(targets), o, found);
    const auto plan = found.plan(ctx_);
    check(targets, plan, o.max_distance, o.one_to_one);
    expect_all(targets, trials, plan);
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

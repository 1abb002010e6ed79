// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Replay mode: the keyframe log of a recording through the stages that there are, on a map of our own: insert, associate,
/// search, create. Only what tracking handed over is read, never the recorded results.

#include <algorithm>
#include <cstdint>
#include <vector>

#include <turbomap/io/trajectory_error.hpp>
#include <turbomap/map/simple_map.hpp>
#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/neighbour_rules.hpp>
#include <turbomap/matching/point_creation.hpp>

#include "arguments.hpp"
#include "recorded_keyframes.hpp"
#include "stage_times.hpp"

namespace turbomap_replay {

/// What a replay leaves behind.
struct replay_result {
  stage_samples process{"process", -1, {}}, search{"search", -1, {}}, creation{"creation", -1, {}},
      total{"total", -1, {}};
  std::vector<turbomap::rigid_transform<double>> T_cw;
  std::size_t map_points = 0, matches = 0, correct_matches = 0;
  std::size_t pairs = 0, grouped_queries_lost = 0;  ///< of --check
  std::size_t grouped_pairs = 0, grouped_correct = 0;
  bool ordered_equals_exhaustive = true;
  turbomap::keyframe_store_statistics store;
};

template <class Camera, class Policy>
class replayer {
 public:
  using memory = turbomap::memory_of_t<Policy>;
  using posed = turbomap::posed_keyframe<orb, Camera>;
  using matches = turbomap::correspondences<orb, Camera, Policy>;

  replayer(const turbomap::recording& recording, const Policy& policy, const arguments& arguments)
      : recording_(recording),
        arguments_(arguments),
        rig_(recorded_rig<Camera>(recording.meta)),
        ctx_(policy),
        store_(recorded_store_options(recording.meta)),
        matches_(ctx_),
        creation_(ctx_) {
    options_.scales = recording.meta.pyramid();
    options_.candidate_set = arguments.candidates == "grouped"      ? turbomap::candidates::grouped
                             : arguments.candidates == "exhaustive" ? turbomap::candidates::exhaustive
                                                                    : turbomap::candidates::epipolar_ordered;
    creation_options_.scales = recording.meta.pyramid();
    if (recording.meta.sensor == "inertial") creation_options_.max_parallax_cosine = 0.9996;
  }

  replay_result run() {
    for (std::size_t i = 0; i < recording_.keyframe_count(); ++i) step(static_cast<std::int32_t>(i));
    for (std::size_t i = 0; i < recording_.keyframe_count(); ++i)
      result_.T_cw.push_back(map_.T_cw(static_cast<std::int32_t>(i)));
    result_.map_points = map_.point_count();
    result_.store = store_.statistics();
    return result_;
  }

 private:
  static constexpr std::int32_t warm_up = 10;  ///< keyframes left out of the statistics, as in the recorded ones

  void step(std::int32_t i) {
    const auto keyframe = static_cast<std::size_t>(i);
    const auto data = recorded_keyframe(recording_, keyframe, rig_, keypoints_);  // what tracking hands over: not timed
    const double begin = now_ms();
    handles_.push_back(store_.insert(data));
    map_.add_keyframe(data.keypoint_count, own_pose(keyframe));
    associate(i);
    covisible_ = map_.covisible(i);
    const double inserted = now_ms();
    double searched = inserted, created = inserted;
    if (arguments_.search) {
      gather_neighbours(i);
      search(options_.candidate_set);
      ctx_.synchronize();
      searched = created = now_ms();
      if (arguments_.creation) {
        turbomap::create_points(ctx_, matches_, creation_options_, creation_);
        creation_.plan(ctx_, matches_, plan_);
        commit(i);
        created = now_ms();
      }
      judge(i);
    }
    if (i <= warm_up) return;
    result_.process.ms.push_back(inserted - begin);
    if (arguments_.search) result_.search.ms.push_back(searched - inserted);
    if (arguments_.search && arguments_.creation) result_.creation.ms.push_back(created - searched);
    result_.total.ms.push_back(created - begin);
  }

  /// Until there is an adjustment of our own, tracking's recorded pose serves. Inertial systems move their whole world a few
  /// times (events): there, poses are chained by recorded motion, and across a jump by the motion the run ended with.
  turbomap::rigid_transform<double> own_pose(std::size_t i) {
    const auto recorded = turbomap::cast<double>(recording_.T_cw[i]);
    if (recording_.meta.events.empty() || i == 0) return recorded;
    bool jumped = false;
    for (const auto& event : recording_.meta.events)
      jumped = jumped || event.iteration + 1 == static_cast<std::int32_t>(i);
    const bool by_end = jumped && recording_.has_final();
    const auto& now = by_end ? recording_.final_T_cw[i] : recording_.T_cw[i];
    const auto& before = by_end ? recording_.final_T_cw[i - 1] : recording_.T_cw[i - 1];
    const auto motion = compose(turbomap::cast<double>(now), invert(turbomap::cast<double>(before)));
    return compose(motion, map_.T_cw(static_cast<std::int32_t>(i) - 1));
  }

  bool same_camera(std::int32_t keyframe, std::int32_t a, std::int32_t b) const {
    const std::int32_t left = recording_.nleft[static_cast<std::size_t>(keyframe)];
    return left < 0 || (a < left) == (b < left);
  }
  bool observe(std::int32_t point, std::int32_t keyframe, std::int32_t keypoint) {
    return map_.observe(point, keyframe, keypoint,
                        [&](std::int32_t a, std::int32_t b) { return same_camera(keyframe, a, b); });
  }

  /// Tracking's associations: keypoints that see a point of the map, and new stereo points.
  void associate(std::int32_t i) {
    const auto range = recording_.associations(static_cast<std::size_t>(i));
    for (std::size_t row = range.begin; row < range.end; ++row) {
      const std::int32_t keypoint = recording_.assoc_kp[row];
      const auto& ref = recording_.assoc_ref[row];
      if (recording_.assoc_new[row] != 0 && ref.keypoint == keypoint) {
        const auto T_log = turbomap::to_isometry<double>(recording_.T_cw[static_cast<std::size_t>(i)]);
        const auto in_camera = T_log * turbomap::cast<double>(recording_.assoc_pos[row]);
        const auto position = turbomap::inverse(turbomap::to_isometry<double>(map_.T_cw(i))) * in_camera;
        if (map_.point_at(i, keypoint) == turbomap::simple_map::none) observe(map_.add_point(position), i, keypoint);
        continue;
      }
      std::int32_t point = point_of(ref);
      if (point == turbomap::simple_map::none) point = point_of(recording_.assoc_ref2[row]);
      if (point != turbomap::simple_map::none) observe(point, i, keypoint);
    }
  }
  std::int32_t point_of(const turbomap::keypoint_reference& ref) const {
    return ref.keyframe < 0 ? turbomap::simple_map::none : map_.point_at(ref.keyframe, ref.keypoint);
  }

  bool is_monocular() const { return recording_.meta.sensor == "monocular"; }

  /// The neighbours of keyframe i, those with too short a baseline left out.
  void gather_neighbours(std::int32_t i) {
    const turbomap::neighbour_options rules;
    std::vector<std::int32_t> chosen;
    const auto limit = static_cast<std::size_t>(is_monocular() ? rules.monocular_neighbours : rules.stereo_neighbours);
    for (const auto& c : covisible_)
      if (chosen.size() < limit && (c.shared_points >= rules.min_shared_points || chosen.empty()))
        chosen.push_back(c.keyframe);
    if (recording_.meta.sensor == "inertial")
      for (std::int32_t p = recording_.prev_kf[static_cast<std::size_t>(i)];
           p >= 0 && chosen.size() < static_cast<std::size_t>(rules.inertial_neighbours);
           p = recording_.prev_kf[static_cast<std::size_t>(p)])
        if (std::find(chosen.begin(), chosen.end(), p) == chosen.end()) chosen.push_back(p);
    neighbours_.clear();
    for (const std::int32_t k : chosen)
      if (baseline_suffices(i, k)) neighbours_.push_back(k);
    call_.clear();
    for (const std::int32_t k : neighbours_) call_.push_back(handles_[static_cast<std::size_t>(k)]);
    call_.push_back(handles_[static_cast<std::size_t>(i)]);
    masks_.resize(call_.size());
    for (std::size_t k = 0; k < neighbours_.size(); ++k) map_.has_point(neighbours_[k], masks_[k]);
    map_.has_point(i, masks_.back());
    query_ = i;
  }
  bool baseline_suffices(std::int32_t i, std::int32_t k) {
    if (!is_monocular())
      return turbomap::baseline_suffices_stereo(map_.T_cw(i), map_.T_cw(k), recording_.meta.baseline);
    points_.clear();
    for (const std::int32_t p : map_.slots(k))
      if (p != turbomap::simple_map::none) points_.push_back(map_.position(p));
    return turbomap::baseline_suffices_monocular(map_.T_cw(i), map_.T_cw(k),
                                                 turbomap::median_depth(map_.T_cw(k), points_, depths_));
  }

  void search(turbomap::candidates set) {
    pinned_.clear();
    pinned_.push_back(store_.pin(ctx_, call_));
    posed_.clear();
    for (std::size_t k = 0; k < neighbours_.size(); ++k)
      posed_.push_back({pinned_[0][k], map_.T_cw(neighbours_[k]), masks_[k]});
    const posed query{pinned_[0][neighbours_.size()], map_.T_cw(query_), masks_.back()};
    auto options = options_;
    options.candidate_set = set;
    turbomap::search_correspondences(ctx_, query, turbomap::span<const posed>(posed_), options, matches_);
  }

  void commit(std::int32_t i) {
    std::vector<int> sizes;
    for (const std::int32_t k : neighbours_) sizes.push_back(static_cast<int>(map_.slots(k).size()));
    for (const auto& p : turbomap::first_claims(plan_, static_cast<int>(map_.slots(i).size()), sizes)) {
      const std::int32_t point = map_.add_point(p.position);
      observe(point, i, p.query);
      observe(point, neighbours_[static_cast<std::size_t>(p.neighbour)], p.candidate);
    }
  }

  /// Not timed: right matches by the simulator's ids, and the properties that --check asks for.
  void judge(std::int32_t i) {
    if (!recording_.is_simulated() && !arguments_.check) return;
    using plan = typename matches::plan_type;
    const plan found = matches_.plan(ctx_);
    result_.matches += found.size();
    result_.correct_matches += count_correct(i, found);
    if (!arguments_.check || neighbours_.empty()) return;
    const auto again = [&](turbomap::candidates set) {
      search(set);
      return matches_.plan(ctx_);
    };
    const plan exhaustive = again(turbomap::candidates::exhaustive),
               ordered = again(turbomap::candidates::epipolar_ordered), grouped = again(turbomap::candidates::grouped);
    result_.pairs += exhaustive.size();
    result_.grouped_pairs += grouped.size();
    result_.grouped_correct += count_correct(i, grouped);
    result_.ordered_equals_exhaustive =
        result_.ordered_equals_exhaustive && exhaustive.size() == ordered.size() &&
        std::equal(ordered.begin(), ordered.end(), exhaustive.begin(), [](const auto& a, const auto& b) {
          return a.neighbour == b.neighbour && a.query == b.query && a.candidate == b.candidate &&
                 a.distance == b.distance;
        });
    for (const auto& g : grouped) {
      const auto at = std::lower_bound(exhaustive.begin(), exhaustive.end(), g, [](const auto& a, const auto& b) {
        return a.neighbour != b.neighbour ? a.neighbour < b.neighbour : a.query < b.query;
      });
      const bool kept =
          at != exhaustive.end() && at->neighbour == g.neighbour && at->query == g.query && at->distance <= g.distance;
      result_.grouped_queries_lost += kept ? 0 : 1;
    }
  }
  template <class Plan>
  std::size_t count_correct(std::int32_t i, const Plan& plan) const {
    if (!recording_.is_simulated()) return 0;
    std::size_t correct = 0;
    for (const auto& m : plan) {
      const auto id = [&](std::int32_t keyframe, std::int32_t keypoint) {
        return recording_.sim_point_id[static_cast<std::size_t>(recording_.kp_off[static_cast<std::size_t>(keyframe)]) +
                                       static_cast<std::size_t>(keypoint)];
      };
      const std::int32_t a = id(i, m.query), b = id(neighbours_[static_cast<std::size_t>(m.neighbour)], m.candidate);
      correct += a >= 0 && a == b ? 1 : 0;
    }
    return correct;
  }

  static turbomap::rigid_transform<double> compose(const turbomap::rigid_transform<double>& a,
                                                   const turbomap::rigid_transform<double>& b) {
    turbomap::rigid_transform<double> c;
    c.qw = a.qw * b.qw - a.qx * b.qx - a.qy * b.qy - a.qz * b.qz;
    c.qx = a.qw * b.qx + a.qx * b.qw + a.qy * b.qz - a.qz * b.qy;
    c.qy = a.qw * b.qy - a.qx * b.qz + a.qy * b.qw + a.qz * b.qx;
    c.qz = a.qw * b.qz + a.qx * b.qy - a.qy * b.qx + a.qz * b.qw;
    const auto t = turbomap::to_isometry<double>(a) * turbomap::vec3<double>{b.tx, b.ty, b.tz};
    c.tx = t.x, c.ty = t.y, c.tz = t.z;
    return c;
  }
  static turbomap::rigid_transform<double> invert(const turbomap::rigid_transform<double>& a) {
    turbomap::rigid_transform<double> b;
    b.qx = -a.qx, b.qy = -a.qy, b.qz = -a.qz, b.qw = a.qw;
    const auto t = turbomap::inverse(turbomap::to_isometry<double>(a)).t;
    b.tx = t.x, b.ty = t.y, b.tz = t.z;
    return b;
  }

  const turbomap::recording& recording_;
  const arguments& arguments_;
  std::vector<turbomap::rig_camera<Camera>> rig_;
  turbomap::context<Policy> ctx_;
  turbomap::keyframe_store<orb, Camera, memory> store_;
  turbomap::simple_map map_;
  matches matches_;
  turbomap::point_creation<Policy> creation_;
  turbomap::search_options options_;
  turbomap::creation_options creation_options_;
  replay_result result_;

  // Reused from keyframe to keyframe.
  std::vector<turbomap::keyframe_handle> handles_, call_;
  std::vector<turbomap::pinned_keyframes<orb, Camera, memory>> pinned_;
  std::vector<turbomap::keypoint> keypoints_;
  std::vector<turbomap::covisible_keyframe> covisible_;
  std::vector<std::int32_t> neighbours_;
  std::vector<std::vector<std::uint8_t>> masks_;
  std::vector<posed> posed_;
  std::vector<turbomap::created_point> plan_;
  std::vector<turbomap::vec3<double>> points_;
  std::vector<double> depths_;
  std::int32_t query_ = 0;
};

}  // namespace turbomap_replay

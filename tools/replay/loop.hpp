// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Replay mode: the keyframe log of a recording through the local mapper, on a map of our own.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/camera/full_image_keypoint.hpp>
#include <turbomap/local_mapper.hpp>

#include "arguments.hpp"
#include "error_parts.hpp"
#include "local_map_search.hpp"
#include "map_digest.hpp"
#include "match_judge.hpp"
#include "merge_causes.hpp"
#include "points_judge.hpp"
#include "progress.hpp"
#include "recorded_keyframes.hpp"
#include "replayed_map.hpp"
#include "stage_times.hpp"
#include "tracking.hpp"

namespace turbomap_replay {

/// One keyframe of a replay.
struct replay_row {
  turbomap::mapping_report report;
  double insertion_ms = 0;  ///< into the store, and tracking's edits of the map: part of 'process'
  double edits_ms = 0;      ///< of that, the edits: the keyframe, its associations, new points
  double total_ms = 0;
  double latency_ms = 0;                                    ///< from its arrival, in recorded time, to its end
  std::size_t points = 0, keyframes = 0, observations = 0;  ///< in the map afterwards
  std::size_t points_seen = 0, views = 0;                   ///< the keyframe's points, and all their observations

  /// Of a stage, 'process' with the insertion.
  double ms(turbomap::mapping_stage stage) const {
    return report.ms[stage] + (stage == turbomap::mapping_stage::process ? insertion_ms : 0);
  }
  /// Whether a stage did something, to its end or until it was cut.
  bool ran(turbomap::mapping_stage stage) const {
    const auto outcome = report.outcome[stage];
    return outcome == turbomap::stage_outcome::done || outcome == turbomap::stage_outcome::cut;
  }
};

/// Adjustments of the whole map.
struct global_result {
  std::vector<turbomap::rigid_transform<double>> T_cw_before;  ///< the last one; by keyframe, as replay_result::T_cw
  turbomap::local_adjustment_summary last;
  turbomap::fusion_summary fused;           ///< in the rounds between them
  std::vector<double> ms;                   ///< each, with rounds and appearances
  turbomap::guard_times adjusting, fusing;  ///< for how long adjust_globally() and fuse_around() held the map's guard
};

/// The times that came after `before`. Where `before` has a longer one, the longest is that of its bin, too large by an eighth
/// at most.
inline turbomap::guard_times since(const turbomap::guard_times& before, turbomap::guard_times all) {
  const bool known = all.longest_ms > before.longest_ms;
  all.count -= before.count, all.over_1_ms -= before.over_1_ms;
  all.total_ms -= before.total_ms, all.commit_ms -= before.commit_ms;
  for (int b = 0; b < turbomap::guard_times::bins; ++b) all.times[b] -= before.times[b];
  if (!known) all.longest_ms = all.quantile(1);
  return all;
}

/// What a replay leaves behind. Vectors by keyframe of the recording.
struct replay_result {
  std::vector<replay_row> rows;
  std::vector<turbomap::rigid_transform<double>> T_cw;  ///< of culled keyframes, the last
  std::vector<std::uint8_t> alive;
  std::vector<turbomap::vec3<double>> points;
  std::vector<std::int32_t> point_observations;
  std::size_t associations = 0, associations_kept = 0;  ///< of tracking
  global_result global;
  std::size_t keyframes_left = 0, faults = 0;                 ///< faults: of validate() on the final map
  std::string map_digest;                                     ///< of the final map
  std::size_t projected = 0, projected_kept = 0;              ///< associations by projection; not forgotten as outliers
  std::size_t projected_right = 0, projected_kept_right = 0;  ///< by the simulator's ids
  match_verdict matches;
  map_observations observations;  ///< with gather_observations
  points_verdict true_points;     ///< of a simulated recording
  merge_counts merges;            ///< with --merge-causes
  turbomap::keyframe_store_statistics store;
  nlohmann::json imu;  ///< what became of it; null: not used
};

/// Options of the mapper for a recording.
inline turbomap::local_mapper_options mapper_options(const turbomap::recording& recording, const arguments& a) {
  using turbomap::mapping_stage;
  const turbomap::recording_meta& meta = recording.meta;
  auto o = meta.sensor == "inertial" && !(meta.baseline > 0)
               ? turbomap::local_mapper_options::monocular_inertial(meta.pyramid())
           : meta.sensor == "inertial"
               ? turbomap::local_mapper_options::stereo_inertial(meta.baseline, meta.close_depth, meta.pyramid())
           : meta.sensor == "monocular"
               ? turbomap::local_mapper_options::monocular(meta.pyramid())
               : turbomap::local_mapper_options::stereo(meta.baseline, meta.close_depth, meta.pyramid());
  if (a.balanced) o = o.balanced();
  if (a.accurate) o = o.accurate();
  o.search.candidate_set = a.candidates == "grouped"      ? turbomap::candidates::grouped
                           : a.candidates == "exhaustive" ? turbomap::candidates::exhaustive
                                                          : turbomap::candidates::epipolar_ordered;
  o.creation.rule = a.rule == "tracks" && !a.check ? turbomap::creation_rule::tracks : turbomap::creation_rule::pairs;
  o.creation.stereo_correlation = a.correlation(recording);
  o.neighbours.across_rig = a.across_rig;
  if (a.known_octaves >= 0) o.creation.known_octaves = a.known_octaves;
  o.creation.lookalike_ratio = a.lookalike_ratio;
  if (a.fewest_keyframes > 0) o.creation.fewest_keyframes = a.fewest_keyframes;
  o.fusion.mode = a.serial_fusion ? turbomap::fusion_mode::serial_exact : turbomap::fusion_mode::snapshot;
  o.fusion.commit.merges = a.merges == "drop"     ? turbomap::merge_rule::drop
                           : a.merges == "refuse" ? turbomap::merge_rule::refuse
                                                  : turbomap::merge_rule::refuse_apart;
  o.adjustment.solve.numbers = a.precision();
  o.inertial.marginal_prior = a.marginal_prior;
  if (a.published_steps) o.use_published_steps();
  o.adjustment.stereo_correlation = a.correlation(recording);
  o.adjustment.second_min_shared_points = a.second_shared;
  if (a.temporal_neighbours >= 0) o.neighbours.neighbourhood.temporal_neighbours = a.temporal_neighbours;
  if (a.culling_observers >= 0) o.keyframe_culling.observers = a.culling_observers;
  bool culling = a.culling && o.enabled[mapping_stage::keyframe_culling];
  if (a.culling_share >= 0) o.keyframe_culling.redundant_share = a.culling_share, culling = a.culling;
  o.covariances = o.covariances || a.uncertain_tracking || a.uncertain_fusion;
  o.fusion.covariances = o.fusion.covariances || a.uncertain_fusion;
  o.deadline_ms = a.deadline_ms;
  if (a.most_views >= 0) o.most_views = a.most_views;
  o.enabled[mapping_stage::point_culling] = a.point_culling;
  o.enabled[mapping_stage::search] = a.search;
  o.enabled[mapping_stage::creation] = a.creation;
  o.enabled[mapping_stage::fusion] = a.fusion;
  o.enabled[mapping_stage::adjustment] = a.adjustment;
  o.enabled[mapping_stage::keyframe_culling] = culling;
  return o;
}

/// A replay without the recording's IMU. See recorded_imu.hpp.
template <class Map, class Policy>
struct no_imu {
  using keyframe = typename turbomap::map_traits<Map>::keyframe;
  using adjustment = turbomap::local_adjustment<Map, Policy, turbomap::every_adjustment_method>;

  no_imu(const turbomap::recording&, const arguments&, turbomap::context<Policy>&, Map&) {}
  void arrived(Map&, const keyframe&, std::int32_t) {}
  void tracked(Map&, const keyframe&) {}
  template <class Mapper, class Scope>
  double mapped(Mapper&, const Scope&, const keyframe&, std::int32_t) {
    return 1;
  }
  nlohmann::json json() const { return {}; }
};

/// \tparam Imu  what is done with the IMU of the recording: no_imu, recorded_imu
template <class Map, class Policy, template <class, class> class Imu = no_imu>
class replayer {
 public:
  using world = replayed_map<Map>;
  using map_type = typename world::map_type;
  using traits = turbomap::map_traits<map_type>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using camera = typename traits::camera;

  using imu_type = Imu<map_type, Policy>;
  using adjustment = typename imu_type::adjustment;
  using mapper_type = turbomap::local_mapper<map_type, Policy, adjustment>;

  replayer(const turbomap::recording& recording, const Policy& policy, const arguments& arguments)
      : recording_(recording),
        arguments_(arguments),
        rig_(recorded_rig<camera>(recording.meta)),
        ctx_(policy),
        store_(recorded_store_options(recording.meta)),
        world_(recording, arguments.adjustment),
        tracker_(ctx_, rig_, recording.meta.pyramid(), arguments.correlation(recording), arguments.uncertain_tracking),
        local_map_(ctx_),
        judge_(recording, ctx_),
        points_(recording),
        imu_(recording, arguments, ctx_, world_.map()),
        mapper_(ctx_, world_.map(), store_, mapper_options(recording, arguments), hooks()) {}
  replayer(const replayer&) = delete;
  replayer& operator=(const replayer&) = delete;

  replay_result run() {
    {
      const std::size_t count = std::min(recording_.keyframe_count(), arguments_.most_keyframes);
      turbomap_program::progress bar(arguments_.work + " under " + arguments_.policy, count);
      for (std::size_t i = 0; i < count; ++i, bar.advance()) step(static_cast<std::int32_t>(i));
    }
    if (arguments_.global_end && world_.size() != 0) adjust_globally();
    const auto& map = world_.map();
    result_.T_cw = poses();
    for (std::size_t i = 0; i < world_.size(); ++i) {
      result_.alive.push_back(world_.alive(static_cast<std::int32_t>(i)) ? 1 : 0);
    }
    traits::for_each_point(map, [&](const point& p) {
      result_.points.push_back(map.position(p));
      result_.point_observations.push_back(static_cast<std::int32_t>(map.observations(p).size()));
    });
    result_.keyframes_left = map.keyframe_count();
    result_.associations = world_.associations(), result_.associations_kept = world_.associations_kept();
    result_.faults = turbomap::validate(map).size();
    result_.map_digest = map_digest(map);
    result_.matches = judge_.verdict();
    if (recording_.is_simulated()) result_.true_points = points_.verdict(map);
    result_.merges = merges_.counts();
    if (arguments_.gather_observations) result_.observations = gather_map_observations(map);
    result_.store = store_.statistics();
    result_.imu = imu_.json();
    return std::move(result_);
  }

 private:
  void step(std::int32_t i) {
    const auto data = recorded_keyframe(recording_, static_cast<std::size_t>(i), rig_, keypoints_);  // not timed
    if (arguments_.pixel_centres == choice::yes) centre(keypoints_);
    // In recorded time: a keyframe is begun when it has come and the one before is done.
    const double arrival = arrival_ms(i);
    clock_ms_ = clock_ms_ > arrival ? clock_ms_ : arrival;
    replay_row row;
    double begin = now_ms();
    began_ = begin;
    query_ = i;
    const auto current = world_.add(i, keypoints_);
    imu_.arrived(world_.map(), current, i);
    const double inserting = now_ms();
    mapper_.insert(current, data);
    const double insert_ms = now_ms() - inserting;
    world_.associate(i);
    const double paused = now_ms();  // tracking's time, not mapping's
    if (arguments_.adjustment) tracker_(world_.map(), current);
    if (arguments_.projected) project_local_map(current);
    imu_.tracked(world_.map(), current);
    const double tracking_ms = now_ms() - paused;
    begin += tracking_ms, began_ += tracking_ms;
    mapper_.watch(world_.create(i));
    world_.count_tracking(i);
    row.insertion_ms = now_ms() - begin;
    row.edits_ms = row.insertion_ms - insert_ms;
    if (arguments_.merge_causes) merges_.begin(world_.map());
    row.report = mapper_.process(current);
    row.total_ms = row.insertion_ms;
    for (const double ms : row.report.ms.values) row.total_ms += ms;
    clock_ms_ += row.total_ms;
    row.latency_ms = clock_ms_ - arrival;
    turbomap::guard_times held;
    const turbomap::mapping_scope<map_type, Policy> scope{ctx_, world_.map(), store_, mapper_.stored(), held};
    world_.scaled(imu_.mapped(mapper_, scope, current, i));
    row.points = world_.map().point_count();
    row.keyframes = world_.map().keyframe_count();
    row.observations = world_.map().observation_count();
    for (std::size_t k = 0; k < keypoints_.size(); ++k) {
      const auto p = traits::point_at(world_.map(), current, k);
      if (p == typename traits::point{}) continue;
      ++row.points_seen;
      traits::for_each_observation(world_.map(), p, [&](const auto&, std::size_t) { ++row.views; });
    }
    result_.rows.push_back(std::move(row));
    if (arguments_.global_every > 0 && (i + 1) % arguments_.global_every == 0) adjust_globally();
  }
  /// The recorded system multiplied the pixels of a level by its scale.
  void centre(std::vector<turbomap::keypoint>& keypoints) const {
    const turbomap::recording_meta& meta = recording_.meta;
    for (auto& k : keypoints) k = turbomap::in_full_image(k, meta.width, meta.height, meta.scale_factor);
  }
  /// All of the map that the last keyframe is part of.
  void adjust_globally() {
    turbomap::global_adjustment_options options;
    static_cast<turbomap::local_adjustment_options&>(options) = mapper_.options().adjustment;
    options.solve = turbomap::global_adjustment_options().solve;
    options.solve.numbers = arguments_.precision();
    result_.global.T_cw_before = poses();
    const double begin = now_ms();
    const auto adjust = [&] {
      const turbomap::guard_times before = mapper_.report().held[turbomap::mapping_stage::adjustment];
      result_.global.last = mapper_.adjust_globally(world_.id(query_), options);
      result_.global.adjusting += since(before, mapper_.report().held[turbomap::mapping_stage::adjustment]);
    };
    adjust();
    for (int round = 0; round < arguments_.global_rounds; ++round) {
      const turbomap::guard_times before = mapper_.report().held[turbomap::mapping_stage::fusion];
      for (std::int32_t k = 0; k <= query_; ++k)
        if (world_.alive(k)) result_.global.fused += mapper_.fuse_around(world_.id(k));
      result_.global.fusing += since(before, mapper_.report().held[turbomap::mapping_stage::fusion]);
      adjust();
    }
    result_.global.ms.push_back(now_ms() - begin);
  }
  std::vector<turbomap::rigid_transform<double>> poses() const {
    std::vector<turbomap::rigid_transform<double>> T_cw;
    for (std::size_t i = 0; i < world_.size(); ++i) T_cw.push_back(world_.T_cw(static_cast<std::int32_t>(i)));
    return T_cw;
  }

  /// What the recorded associations left out, and the pose again.
  void project_local_map(const keyframe& current) {
    auto& map = world_.map();
    local_map_options options;
    options.projection.scales = recording_.meta.pyramid();
    options.projection.stereo_correlation = arguments_.correlation(recording_);
    options.covariances = arguments_.uncertain_tracking;
    const auto& added = local_map_(map, current, store_, mapper_.stored(), options);
    const auto right = [&](const auto& a) {
      if (!recording_.is_simulated()) return false;
      const auto scene = points_.truth(map, current, a.keypoint);
      return scene != points_.clutter && scene == points_.truth(map, a.shown, current);
    };
    std::vector<bool> is_right;  // before views are forgotten
    for (const auto& a : added) is_right.push_back(right(a));
    if (arguments_.adjustment) tracker_(map, current);
    result_.projected += added.size();
    for (std::size_t n = 0; n < added.size(); ++n) {
      const bool kept = map.point_at(current, added[n].keypoint) == added[n].shown;
      result_.projected_kept += kept ? 1 : 0;
      result_.projected_right += is_right[n] ? 1 : 0;
      result_.projected_kept_right += kept && is_right[n] ? 1 : 0;
    }
  }

  double arrival_ms(std::int32_t i) const {
    return 1e-6 * static_cast<double>(recording_.t_ns[static_cast<std::size_t>(i)] - recording_.t_ns[0]) /
           arguments_.rate;
  }

  turbomap::local_mapper_hooks<map_type> hooks() {
    turbomap::local_mapper_hooks<map_type> hooks;
    hooks.erasing = [this](const keyframe& k) { world_.remember(k); };
    if (arguments_.queue || arguments_.behind > 0)
      hooks.keyframes_wait = [this] {
        if (query_ < arguments_.behind) return true;
        if (!arguments_.queue) return false;
        const auto next = static_cast<std::size_t>(query_) + 1;
        return next < recording_.keyframe_count() && arrival_ms(query_ + 1) <= clock_ms_ + (now_ms() - began_);
      };
    if (recording_.is_simulated() || arguments_.check || arguments_.merge_causes)
      hooks.stage_done = [this](turbomap::mapping_stage stage, const turbomap::mapping_report&) {
        const double paused = now_ms();  // the judges' time, not mapping's
        if (stage == turbomap::mapping_stage::search && (recording_.is_simulated() || arguments_.check)) judge();
        if (recording_.is_simulated()) points_.stage_done(world_.map(), world_.id(query_), stage);
        if (arguments_.merge_causes) merges_.stage_done(world_.map(), stage, searched());
        began_ += now_ms() - paused;
      };
    return hooks;
  }
  /// The query of the last search, and its neighbours.
  std::vector<keyframe> searched() const {
    std::vector<keyframe> keyframes;
    for (const std::uint64_t id : mapper_.last_search().selection().ids())
      keyframes.push_back(world_.id(static_cast<std::int32_t>(id)));
    return keyframes;
  }
  void judge() {
    std::vector<std::int32_t> keyframes;
    for (const std::uint64_t id : mapper_.last_search().selection().ids())
      keyframes.push_back(static_cast<std::int32_t>(id));  // ids ascend as the keyframes of the log do
    judge_(mapper_.last_search(), keyframes, mapper_.options().search, arguments_.check);
  }

  const turbomap::recording& recording_;
  const arguments& arguments_;
  std::vector<turbomap::rig_camera<camera>> rig_;
  turbomap::context<Policy> ctx_;
  turbomap::keyframe_store<orb, camera, turbomap::memory_of_t<Policy>> store_;
  world world_;
  pose_tracker<map_type, Policy> tracker_;
  local_map_search<map_type, Policy> local_map_;
  match_judge<typename mapper_type::stage_map, Policy> judge_;
  points_judge<map_type> points_;
  merge_causes<map_type> merges_;
  imu_type imu_;
  mapper_type mapper_;
  replay_result result_;
  std::vector<turbomap::keypoint> keypoints_;
  double clock_ms_ = 0, began_ = 0;
  std::int32_t query_ = 0;
};

}  // namespace turbomap_replay

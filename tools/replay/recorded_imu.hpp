// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Tracking's part of a replay with the recording's IMU: motions between keyframes from the raw samples, velocities by
/// prediction, and the initialisation at its times. Recorded velocities, biases and events are not read.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/inertial/initialisation_schedule.hpp>
#include <turbomap/inertial/predict.hpp>
#include <turbomap/io/recording.hpp>
#include <turbomap/map/simple_map/simple_inertial_map.hpp>
#include <turbomap/mapping/inertial_adjustment.hpp>
#include <turbomap/mapping/inertial_initialisation.hpp>

#include "arguments.hpp"
#include "stage_times.hpp"

namespace turbomap_replay {

/// The noise of a recording's IMU. Recorded variances are those of one step.
inline turbomap::preintegration_options imu_options(const turbomap::recording_meta& meta) {
  turbomap::preintegration_options o;
  if (meta.imu_noise_variance.size() != 6 || meta.imu_walk_variance.size() != 6) return o;
  o.noise = {std::sqrt(meta.imu_noise_variance[0]), std::sqrt(meta.imu_noise_variance[3]),
             std::sqrt(meta.imu_walk_variance[0]), std::sqrt(meta.imu_walk_variance[3]), 1};
  return o;
}

template <class Map, class Policy>
class recorded_imu {
 public:
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using adjustment = turbomap::inertial_adjustment<Map, Policy, turbomap::every_adjustment_method>;

  recorded_imu(const turbomap::recording& recording, const arguments& arguments, turbomap::context<Policy>& ctx,
               Map& map)
      : recording_(recording), options_(imu_options(recording.meta)), schedule_(is_monocular()), adjust_(ctx) {
    options_.noise.gyro *= arguments.imu_noise, options_.noise.acceleration *= arguments.imu_noise;
    if (!recording.has_imu()) throw std::invalid_argument("--imu: the recording has no samples of an IMU");
    map.set_imu(turbomap::normalised(turbomap::cast<double>(recording.meta.T_bc)), options_);
    map.set_refined(false);
  }

  /// Keyframe i has entered the map: what the IMU measured since the one before.
  void arrived(Map& map, const keyframe& current, std::int32_t i) {
    const keyframe before = traits::previous(map, current);
    if (before == keyframe{}) return;
    map.set_bias(current, map.bias(before));
    const std::int64_t from = time_ns(map, before);
    try {
      turbomap::imu_history h = samples(from, recording_.t_ns[static_cast<std::size_t>(i)]);
      // Before it is initialised, at the bias of the motion before: attempts find it, and culling merges the two.
      const auto last = map.motion(before);  // a pointer, or a copy
      const bool known = map.initialised() || !last;
      const auto motion = turbomap::preintegrate(h, known ? map.bias(before) : last->bias, options_);
      map.set_motion(current, motion, std::move(h));
    } catch (const std::invalid_argument& error) {
      if (holes_++ == 0) first_hole_ = error.what();
    }
    times_ns_.push_back({traits::id(map, current), recording_.t_ns[static_cast<std::size_t>(i)]});
  }
  /// Tracking has found its pose.
  void tracked(Map& map, const keyframe& current) {
    const keyframe before = traits::previous(map, current);
    const auto motion = map.motion(current);
    if (!map.initialised() || !motion) return;
    const turbomap::inertial_state<double> from{map.T_cw(before), map.velocity(before), map.bias(before)};
    const auto to = turbomap::predict(from, *motion, map.gravity(), turbomap::to_isometry<double>(map.T_bc()));
    map.set_velocity(current, to.velocity);
  }
  /// Mapping has done its part.
  /// \return by which factor the map was scaled
  template <class Mapper, class Scope>
  double mapped(Mapper& mapper, const Scope& s, const keyframe& current, std::int32_t i) {
    const std::int64_t now = recording_.t_ns[static_cast<std::size_t>(i)];
    const auto step = schedule_.due(now);
    if (step == turbomap::initialisation_step::none) return 1;
    const double begin = now_ms();
    turbomap::initialisation_options how;
    how.monocular = is_monocular();
    if (!how.monocular) how.min_seconds = 1;  // [ORB-SLAM3]
    const auto& found = initialise_(s.map, current, how);
    last_end_ = static_cast<int>(found.end);
    if (!found || initialise_.stale()) return 1;
    if (step != turbomap::initialisation_step::refine_scale) {
      turbomap::inertial_adjustment_options all = mapper.options().inertial;
      all.strong_points = -1, all.window.keyframes = 1 << 20;
      const auto summary = adjust_(s, current, mapper.options().adjustment, all);
      mapper.refresh();  // a mirror of the map: all of it may have moved, before appearances are computed from it
      mapper.update_geometry(adjust_.points());
      mapper.update_appearance(adjust_.points_that_lost_views());
      if (summary.stale) return found.scale;  // once more, at the next keyframe
    } else {
      mapper.refresh();
    }
    schedule_.done(step, now);
    refinements_ += step == turbomap::initialisation_step::refine ? 1 : 0;
    s.map.set_refined(refinements_ >= 2);
    events_.push_back({{"keyframe", i},
                       {"step", static_cast<int>(step)},
                       {"seconds", 1e-9 * static_cast<double>(now - recording_.t_ns[0])},
                       {"scale", found.scale},
                       {"scale_sigma", found.scale_sigma},
                       {"gravity_sigma", found.gravity_sigma},
                       {"ms", now_ms() - begin}});
    return found.scale;
  }
  nlohmann::json json() const {
    nlohmann::json json{{"events", events_}, {"intervals_without_motion", holes_}};
    if (events_.empty()) json["not_initialised"] = last_end_;
    if (holes_ != 0) json["first_refusal"] = first_hole_;
    return json;
  }

 private:
  bool is_monocular() const { return !(recording_.meta.baseline > 0); }
  std::int64_t time_ns(const Map& map, const keyframe& k) const {
    for (std::size_t i = times_ns_.size(); i-- > 0;)
      if (times_ns_[i].first == traits::id(map, k)) return times_ns_[i].second;
    return recording_.t_ns[0];
  }
  turbomap::imu_history samples(std::int64_t from, std::int64_t to) const {
    const turbomap::imu_samples all{recording_.imu_t_ns, recording_.imu};
    turbomap::imu_interval in = turbomap::find_interval(all, from, to);
    turbomap::imu_history h;
    h.t_ns.assign(recording_.imu_t_ns.begin() + in.first, recording_.imu_t_ns.begin() + in.last + 1);
    h.sample.assign(recording_.imu.begin() + in.first, recording_.imu.begin() + in.last + 1);
    in.last -= in.first, in.first = 0;
    h.pieces.push_back(in);
    return h;
  }

  const turbomap::recording& recording_;
  turbomap::preintegration_options options_;
  turbomap::initialisation_schedule schedule_;
  turbomap::inertial_initialisation<Map> initialise_;
  adjustment adjust_;
  std::vector<std::pair<std::uint64_t, std::int64_t>> times_ns_;  ///< of keyframes but the first, by id
  std::size_t holes_ = 0;
  std::string first_hole_;
  int refinements_ = 0, last_end_ = 0;
  nlohmann::json events_ = nlohmann::json::array();
};

}  // namespace turbomap_replay

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that makes a visual map an inertial one: it compares the poses of the keyframes with what the IMU measured between
/// them (initialise_inertial), and writes gravity, velocities, biases and, for one camera, the scale to the user's map. Called
/// again it refines them. Meant for the keyframes' thread, between two keyframes; initialisation_schedule says when.

#include <cstddef>
#include <exception>
#include <utility>

#include "../config.hpp"
#include "../error.hpp"
#include "../inertial/initialise.hpp"
#include "../map/inertial_traits.hpp"
#include "../map/map_traits.hpp"
#include "../math/rotation.hpp"
#include "../plain_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Needs inertial_traits with
///
///     static void set_gravity(my::Map&, const turbomap::vec3<double>&);
///     static void set_initialised(my::Map&, bool);
///
/// and, for one camera, map_traits with for_each_keyframe, for_each_point, set_pose and set_position: the map is scaled. The world
/// is not turned: gravity points where it does.
template <class Map>
class inertial_initialisation {
 public:
  /// @{
  /// Types of the map, as its traits name them.
  using traits = map_traits<Map>;
  using inertial = inertial_traits<Map>;
  using keyframe = typename traits::keyframe;
  /// @}

  /// Looks back in time from a keyframe, as far as motions are known, options.most_seconds at most. With bias_changed() of the
  /// traits the samples are integrated again at the biases that were found, and the estimate is repeated; where a repetition finds
  /// nothing, what was found before it stands.
  /// \return what was found; its scale is that by which the map was scaled. The map is as it was where it is not initialised,
  ///         or `stale()`
  /// \throws std::invalid_argument  an option, T_bc, a pose or a motion that cannot be, or whose duration is not the time between
  ///         its keyframes (options.max_time_error): nothing is changed
  /// Takes the map's guard to read, and again to write; O(keyframes), with a scale O(map).
  const initialisation& operator()(Map& map, const keyframe& current, const initialisation_options& options = {}) {
    static_assert(require_inertial_traits<Map>());
    static_assert(detail::inertial_has_v<Map, detail::inertial_initialise_member>,
                  "turbomap: inertial_initialisation needs inertial_traits with set_gravity and set_initialised; see "
                  "docs/inertial.md");
    detail::check_initialisation_options(options);
    require(options.most_seconds >= options.min_seconds, "options.most_seconds", options.most_seconds,
            "must not be below min_seconds");
    detail::require_not_negative("options.max_time_error", options.max_time_error);
    found_ = estimate(map, current, options);
    if (!found_ || !commit(map, found_, options.monocular)) return found_;
    if constexpr (detail::inertial_has_v<Map, detail::inertial_bias_member>) {
      constexpr int most = 2;  // each time the motions are integrated at a better bias
      for (int again = 0; again < most && found_.integrate_again; ++again)
        if (!repeat(map, current, options)) break;
      stale_ = false;  // the first one was written
    }
    return found_;
  }
  /// Whether somebody changed the keyframes meanwhile, so that nothing was written.
  bool stale() const { return stale_; }

 private:
  initialisation estimate(Map& map, const keyframe& current, const initialisation_options& options) {
    snapshot(map, current, options);
    return initialise_inertial(T_cw_, motions_, T_bc_, options);
  }
  /// Once more on the map as it is now, in metres. \return whether that is the better estimate, and was written
  bool repeat(Map& map, const keyframe& current, initialisation_options options) {
    options.monocular = false;
    try {
      initialisation better = estimate(map, current, options);
      if (!better || !commit(map, better, false)) return false;
      better.scale = found_.scale, better.scale_sigma = found_.scale_sigma;
      found_ = std::move(better);
      return true;
    } catch (const std::exception&) {  // no memory, or somebody made the map one that cannot be used
      return false;
    }
  }

  void snapshot(Map& map, const keyframe& current, const initialisation_options& options) {
    [[maybe_unused]] const auto guard = map_guard(map);
    keyframes_.clear(), T_cw_.clear(), motions_.clear();
    stale_ = current == keyframe{} || !traits::alive(map, current);
    if (stale_) return;
    T_bc_ = to_isometry<double>(normalised(inertial::T_bc(map)));
    preintegration<double> motion;
    const double newest = traits::time(map, current);
    double time = newest;
    for (keyframe k = current;;) {
      keyframes_.push_back(k), T_cw_.push_back(pose_of(map, k));
      const keyframe before = traits::previous(map, k);
      if (before == keyframe{}) break;
      const double earlier = traits::time(map, before);
      if (!(earlier < time)) break;  // no time: the keyframes may run in a circle
      if (!(newest - earlier <= options.most_seconds) || !inertial::motion(map, k, motion)) break;
      const double error = motion.dt - (time - earlier);
      require(error <= options.max_time_error && -error <= options.max_time_error, "motion.dt", motion.dt,
              "must be the time between its keyframes");
      motions_.push_back(motion);
      k = before, time = earlier;
    }
    reverse(keyframes_), reverse(T_cw_), reverse(motions_);
  }
  template <class List>
  static void reverse(List& list) {
    for (std::size_t i = 0, j = list.size(); i + 1 < j; ++i) {
      --j;
      const auto x = list[i];
      list[i] = list[j], list[j] = x;
    }
  }

  bool commit(Map& map, const initialisation& found, bool scale) {
    [[maybe_unused]] const auto guard = map_guard(map);
    for (std::size_t i = 0; i < keyframes_.size(); ++i) {
      const keyframe& k = keyframes_[i];
      stale_ = stale_ || !traits::alive(map, k) || (i > 0 && !(traits::previous(map, k) == keyframes_[i - 1]));
      if (stale_) return false;
      const auto now = pose_of(map, k);
      const auto& then = T_cw_[i];
      stale_ = now.tx != then.tx || now.ty != then.ty || now.tz != then.tz || now.qx != then.qx || now.qy != then.qy ||
               now.qz != then.qz || now.qw != then.qw;
    }
    if (stale_) return false;
    if (scale) {
      if constexpr (detail::map_has_v<Map, detail::map_all_member>)
        scale_map(map, found.scale);
      else
        require(false, "options.monocular", scale, "needs map_traits with for_each_keyframe and for_each_point");
    }
    inertial::set_gravity(map, found.gravity);
    for (std::size_t i = 0; i < keyframes_.size(); ++i) {
      inertial::set_velocity(map, keyframes_[i], found.velocity[i]);
      inertial::set_bias(map, keyframes_[i], found.bias);
      if (i > 0) tell(map, keyframes_[i], found.bias);
    }
    tell(map, traits::next(map, keyframes_.back()), found.bias);
    inertial::set_initialised(map, true);
    return true;
  }
  /// The bias before the interval of a keyframe is another now.
  static void tell([[maybe_unused]] Map& map, [[maybe_unused]] const keyframe& after,
                   [[maybe_unused]] const imu_bias<double>& bias) {
    if constexpr (detail::inertial_has_v<Map, detail::inertial_bias_member>)
      if (!(after == keyframe{})) inertial::bias_changed(map, after, bias);
  }
  static void scale_map(Map& map, double scale) {
    list_of<keyframe> keyframes;
    list_of<typename traits::point> points;
    traits::for_each_keyframe(map, [&](const keyframe& k) { keyframes.push_back(k); });
    traits::for_each_point(map, [&](const typename traits::point& p) { points.push_back(p); });
    for (const keyframe& k : keyframes) {
      auto T = pose_of(map, k);
      T.tx *= scale, T.ty *= scale, T.tz *= scale;
      traits::set_pose(map, k, T);
      const vec3<double> v = inertial::velocity(map, k);  // of a keyframe before those that are initialised
      inertial::set_velocity(map, k, {scale * v.x, scale * v.y, scale * v.z});
    }
    for (const auto& p : points) scale_point(map, p, scale);
  }
  static vec3<double> position_of(const Map& map, const typename traits::point& p) {
    const auto& x = traits::position(map, p);
    return {x.x, x.y, x.z};
  }
  static void scale_point(Map& map, const typename traits::point& p, double scale) {
    const auto s = static_cast<float>(scale);
    const vec3<double> x = position_of(map, p);
    const auto n = traits::normal(map, p);
    const float nearest = s * traits::min_distance(map, p), farthest = s * traits::max_distance(map, p);
    traits::set_position(map, p, {scale * x.x, scale * x.y, scale * x.z});
    const auto& given = traits::descriptor_data(map, p);  // valid until the next call: asked for last
    const auto* const kept = detail::elements_of<typename traits::descriptor>(given);
    if (kept != nullptr)  // else it has no appearance yet
      traits::set_appearance(map, p, {n.x, n.y, n.z}, nearest, farthest, kept);
    if constexpr (detail::map_has_v<Map, detail::map_covariance_member>) {
      const point_covariance c = traits::covariance(map, p);
      const float q = s * s;
      traits::set_covariance(map, p, {q * c.xx, q * c.yx, q * c.yy, q * c.zx, q * c.zy, q * c.zz});
    }
  }

  initialisation found_;
  bool stale_ = false;
  list_of<keyframe> keyframes_;
  plain_vector<rigid_transform<double>> T_cw_;
  plain_vector<preintegration<double>> motions_;
  isometry<double> T_bc_;
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that makes a visual map an inertial one: it compares the poses of the keyframes with what the IMU measured between
/// them (initialise_inertial), and writes gravity, velocities, biases and, for one camera, the scale to the user's map. Called
/// again it refines them. Meant for the keyframes' thread, between two keyframes; initialisation_schedule says when.

#include <cstddef>

#include "../config.hpp"
#include "../error.hpp"
#include "../inertial/bias_update.hpp"
#include "../inertial/initialise.hpp"
#include "../map/inertial_traits.hpp"
#include "../map/map_traits.hpp"
#include "../math/number_checks.hpp"
#include "../math/rotation.hpp"
#include "../plain_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Keyframes before those that it takes get the bias, and velocities by their poses, the first time.
///
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
  /// traits the samples are integrated again at the biases that were found, and the estimate is repeated, before it is judged: over
  /// some seconds of rest a bias that nobody knew turns the motion by so much that the first order says little of it.
  /// \return what was found; its scale is that by which the map was scaled. The map is as it was where it is not initialised,
  ///         or `stale()`, but for the biases at which motions are integrated
  /// \throws std::invalid_argument  an option, T_bc, a pose or a motion that cannot be, or whose duration is not the time between
  ///         its keyframes (options.max_time_error): nothing is changed, but for the biases at which motions are integrated
  /// Takes the map's guard to read, and again to write; O(keyframes), with a scale O(map), in one hold: docs/local_mapping.md
  /// says how long, and why.
  const initialisation& operator()(Map& map, const keyframe& current, const initialisation_options& options = {}) {
    static_assert(require_inertial_traits<Map>());
    static_assert(detail::inertial_has_v<Map, detail::inertial_initialise_member>,
                  "turbomap: inertial_initialisation needs inertial_traits with set_gravity and set_initialised; see "
                  "docs/inertial.md");
    detail::check_initialisation_options(options);
    require(options.most_seconds >= options.min_seconds, "options.most_seconds", options.most_seconds,
            "must not be below min_seconds");
    check_not_negative("options.max_time_error", options.max_time_error);
    require(scales || !options.monocular, "options.monocular", options.monocular,
            "needs map_traits with for_each_keyframe and for_each_point");
    found_ = estimate(map, current, options);
    if constexpr (detail::inertial_has_v<Map, detail::inertial_bias_member>) {
      constexpr int most = 3;  // each time at a better bias: the change of the second is seldom worth a third
      for (int again = 0; again < most && found_.integrate_again && integrate(map); ++again)
        found_ = estimate(map, current, options);
    }
    if (found_ && !stale_) commit(map, options);
    return found_;
  }
  /// Whether somebody changed the keyframes meanwhile, so that nothing was written.
  bool stale() const { return stale_; }

 private:
  static constexpr bool scales = detail::map_has_v<Map, detail::map_all_member>;

  initialisation estimate(Map& map, const keyframe& current, const initialisation_options& options) {
    snapshot(map, current, options);
    if (stale_) return {};
    return initialise_inertial(T_cw_, motions_, T_bc_, options);
  }
  /// Integrates the samples again at the bias that was found. \return whether a motion is another now: a map may have no samples,
  /// or limits of its own; and where somebody changed the keyframes, nothing is done
  bool integrate(Map& map) {
    [[maybe_unused]] const auto guard = map_guard(map);
    if (!unchanged(map)) return false;
    bool changed = false;
    preintegration<double> motion;
    for (std::size_t i = 1; i < keyframes_.size(); ++i) {
      tell(map, keyframes_[i], found_.bias);
      changed =
          (inertial::motion(map, keyframes_[i], motion) && !same_bias(motion.bias, motions_[i - 1].bias)) || changed;
    }
    return changed;
  }

  void snapshot(Map& map, const keyframe& current, const initialisation_options& options) {
    [[maybe_unused]] const auto guard = map_guard(map);
    keyframes_.clear(), T_cw_.clear(), motions_.clear();
    stale_ = current == keyframe{} || !traits::alive(map, current);
    if (stale_) return;
    const rigid_transform<double> T_bc = inertial::T_bc(map);
    require(is_pose(T_bc), "T_bc", T_bc.qw, "must be finite, with a quaternion of unit length (qw is given)");
    T_bc_ = to_isometry<double>(normalised(T_bc));
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
      require(detail::lasts(motion, time - earlier, options.max_time_error), "motion.dt", motion.dt,
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

  /// Whether the keyframes are as they were read; if not, stale() is true. The caller holds the guard.
  bool unchanged(const Map& map) {
    for (std::size_t i = 0; i < keyframes_.size() && !stale_; ++i) {
      const keyframe& k = keyframes_[i];
      stale_ = !traits::alive(map, k) || (i > 0 && !(traits::previous(map, k) == keyframes_[i - 1]));
      if (stale_) break;
      const auto now = pose_of(map, k);
      const auto& then = T_cw_[i];
      stale_ = now.tx != then.tx || now.ty != then.ty || now.tz != then.tz || now.qx != then.qx || now.qy != then.qy ||
               now.qz != then.qz || now.qw != then.qw;
    }
    return !stale_;
  }
  void commit(Map& map, const initialisation_options& options) {
    [[maybe_unused]] const auto guard = map_guard(map);
    if (!unchanged(map)) return;
    const bool first = !inertial::initialised(map);
    if constexpr (scales)
      if (options.monocular) scale_map(map, found_.scale);
    inertial::set_gravity(map, found_.gravity);
    for (std::size_t i = 0; i < keyframes_.size(); ++i) {
      inertial::set_velocity(map, keyframes_[i], found_.velocity[i]);
      inertial::set_bias(map, keyframes_[i], found_.bias);
      if (i > 0) tell(map, keyframes_[i], found_.bias);
    }
    tell(map, traits::next(map, keyframes_.back()), found_.bias);
    if (first) reach_back(map, options.max_time_error);
    inertial::set_initialised(map, true);
  }
  /// Keyframes before those of the estimate get its bias, and velocities by their poses: an adjustment takes the state of any keyframe
  /// of an initialised map for an estimate. A motion that an adjustment would not take tells nothing of them.
  void reach_back(Map& map, double max_time_error) {
    keyframe after = keyframes_.front();
    isometry<double> T_after = body(map, after);
    for (double time = traits::time(map, after);;) {
      const keyframe k = traits::previous(map, after);
      if (k == keyframe{} || !traits::alive(map, k)) return;
      const double earlier = traits::time(map, k), dt = time - earlier;
      if (!(dt > 0)) return;  // no time: the keyframes may run in a circle
      tell(map, after, found_.bias);
      const isometry<double> T = body(map, k);
      vec3<double> moved = T_after.t - T.t;
      preintegration<double> motion;
      if (inertial::motion(map, after, motion) && detail::is_usable(motion, default_max_force) &&
          detail::lasts(motion, dt, max_time_error)) {
        const vec3<double> dP = corrected(motion, found_.bias).dP;
        moved = moved - (0.5 * dt * dt) * found_.gravity - T.R * dP;
      }
      const vec3<double> velocity = (1 / dt) * moved;
      inertial::set_velocity(map, k, detail::is_finite(velocity) ? velocity : vec3<double>{0, 0, 0});
      inertial::set_bias(map, k, found_.bias);
      after = k, T_after = T, time = earlier;
    }
  }
  /// Where the IMU is, and how it is turned, in the world.
  isometry<double> body(const Map& map, const keyframe& k) const {
    return inverse(T_bc_ * to_isometry<double>(normalised(pose_of(map, k))));
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
  isometry<double> T_bc_{identity3<double>(), {0, 0, 0}};
};

TURBOMAP_END_NAMESPACE

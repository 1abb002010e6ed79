// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that makes a visual map an inertial one: it compares the poses of the keyframes with what the IMU measured between
/// them (initialise_inertial), and writes gravity, velocities, biases and, for one camera, the scale to the user's map. Called
/// again it refines them. Meant for the keyframes' thread, between two keyframes; initialisation_schedule says when.

#include <cstddef>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../error.hpp"
#include "../inertial/initialise.hpp"
#include "../map/inertial_traits.hpp"
#include "../map/map_traits.hpp"
#include "../math/rotation.hpp"
#include "../plain_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {
template <class M, class T>
using inertial_initialise_member =
    std::void_t<decltype(T::set_gravity(std::declval<M&>(), std::declval<const vec3<double>&>())),
                decltype(T::set_initialised(std::declval<M&>(), bool{}))>;
}  // namespace detail

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
  using traits = map_traits<Map>;
  using inertial = inertial_traits<Map>;
  using keyframe = typename traits::keyframe;

  /// Looks back in time from a keyframe, as far as motions are known.
  /// \return what was found. Where it is not initialised, or `stale()`, the map is as it was
  /// \throws std::invalid_argument  an option, T_bc, a pose or a motion that cannot be: nothing is changed
  /// Takes the map's guard to read, and again to write; O(keyframes), with a scale O(map).
  const initialisation& operator()(Map& map, const keyframe& current, const initialisation_options& options = {}) {
    static_assert(require_inertial_traits<Map>());
    static_assert(detail::inertial_has_v<Map, detail::inertial_initialise_member>,
                  "turbomap: inertial_initialisation needs inertial_traits with set_gravity and set_initialised; see "
                  "docs/inertial.md");
    constexpr int most = 3;  // each time the motions are integrated at a better bias
    initialisation_options at = options;
    for (int pass = 0; pass < most; ++pass) {
      snapshot(map, current);
      found_ = initialise_inertial(T_cw_, motions_, T_bc_, at);
      if (!found_ || !commit(map, pass == 0 && options.monocular)) break;
      at.monocular = false;  // it is in metres by now
      if (!found_.integrate_again || !detail::inertial_has_v<Map, detail::inertial_bias_member>) break;
    }
    return found_;
  }
  /// Whether somebody changed the keyframes meanwhile, so that nothing was written.
  bool stale() const { return stale_; }

 private:
  void snapshot(Map& map, const keyframe& current) {
    [[maybe_unused]] const auto guard = map_guard(map);
    keyframes_.clear(), T_cw_.clear(), motions_.clear();
    stale_ = current == keyframe{} || !traits::alive(map, current);
    if (stale_) return;
    T_bc_ = to_isometry<double>(normalised(inertial::T_bc(map)));
    preintegration<double> motion;
    for (keyframe k = current; !(k == keyframe{});) {
      keyframes_.push_back(k), T_cw_.push_back(pose_of(map, k));
      const keyframe before = traits::previous(map, k);
      if (before == keyframe{} || !inertial::motion(map, k, motion)) break;
      motions_.push_back(motion);
      k = before;
    }
    if (motions_.size() == keyframes_.size()) motions_.resize(keyframes_.size() - 1);
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

  bool commit(Map& map, bool scale) {
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
        scale_map(map, found_.scale);
      else
        require(false, "options.monocular", scale, "needs map_traits with for_each_keyframe and for_each_point");
    }
    inertial::set_gravity(map, found_.gravity);
    for (std::size_t i = 0; i < keyframes_.size(); ++i) {
      inertial::set_velocity(map, keyframes_[i], found_.velocity[i]);
      inertial::set_bias(map, keyframes_[i], found_.bias);
      if constexpr (detail::inertial_has_v<Map, detail::inertial_bias_member>)
        if (i > 0) inertial::bias_changed(map, keyframes_[i], found_.bias);
    }
    inertial::set_initialised(map, true);
    return true;
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
    }
    for (const auto& p : points) {
      const auto& x = traits::position(map, p);
      const auto n = traits::normal(map, p);
      const auto s = static_cast<float>(scale);
      traits::set_position(map, p, {scale * x.x, scale * x.y, scale * x.z});
      traits::set_appearance(map, p, {n.x, n.y, n.z}, s * traits::min_distance(map, p),
                             s * traits::max_distance(map, p), traits::descriptor_data(map, p));
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

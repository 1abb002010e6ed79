// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How the library reads and changes what a map with an inertial measurement unit (IMU) holds besides keyframes and points.
/// A second small struct beside map_traits; who maps without an IMU does not need it, nor this header.
///
/// The rules of map_traits hold: static members, on the host, under the same guard; writes must not throw. The map_traits must
/// have `time`, `previous` and `next`.
///
///     template <>
///     struct turbomap::inertial_traits<my::Map> {
///       static bool initialised(const my::Map&);  // whether gravity, velocities and biases are known, and the scale
///       static turbomap::vec3<double> gravity(const my::Map&);               // in the world, m/s^2, e.g. {0, 0, -9.81}
///       static turbomap::rigid_transform<double> T_bc(const my::Map&);       // frame of the poses to body, that of the IMU
///       static turbomap::vec3<double> velocity(const my::Map&, keyframe);    // of the IMU in the world, m/s
///       static turbomap::imu_bias<double> bias(const my::Map&, keyframe);    // rad/s, m/s^2
///       // What the IMU measured from previous(keyframe) to the keyframe. False: it did not, or not all the time
///       static bool motion(const my::Map&, keyframe, turbomap::preintegration<double>& motion);
///
///       // Writes
///       static void set_velocity(my::Map&, keyframe, const turbomap::vec3<double>&);
///       static void set_bias(my::Map&, keyframe, const turbomap::imu_bias<double>&);
///       static void set_motion(my::Map&, keyframe, const turbomap::preintegration<double>&);
///       static void clear_motion(my::Map&, keyframe);                        // motion() is false from then on
///
///       // Optional
///       // False: initialised not long ago. The adjustment trusts its edges less then, and the map may turn. No stage sets it:
///       // false before the first initialisation, true after the second refinement
///       static bool refined(const my::Map&);
///       // `removed` is about to be erased; `after` follows it, and has their motion already. To keep samples: append(history of
///       // removed, that of after), which throws where they do not meet: catch it, and keep none
///       static void join_samples(my::Map&, keyframe removed, keyframe after);
///       // The bias of the keyframe before this one is another now. To integrate the samples again: needs_integration()
///       static void bias_changed(my::Map&, keyframe, const turbomap::imu_bias<double>&);
///       static void set_gravity(my::Map&, const turbomap::vec3<double>&);  // these two are for inertial_initialisation
///       static void set_initialised(my::Map&, bool);
///     };
///
/// See docs/inertial.md and examples/07_stereo_inertial.cpp.

#include "../config.hpp"
#include "../inertial/inertial_window_options.hpp"
#include "../inertial/merge.hpp"
#include "../inertial/preintegration.hpp"
#include "../math/functions.hpp"
#include "inertial_members.hpp"
#include "map_traits.hpp"
#include "require_inertial_traits.hpp"

namespace turbomap {

/// Specialise this for your map type: see above.
template <class Map>
struct inertial_traits {
  using turbomap_not_specialised = void;  ///< only here, so that a missing specialisation is found.
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Whether the estimates of an initialised map are no longer young: true where the traits do not say.
template <class Map>
bool is_refined([[maybe_unused]] const Map& map) {
  if constexpr (detail::inertial_has_v<Map, detail::inertial_refined_member>)
    return inertial_traits<Map>::refined(map);
  else
    return true;
}

namespace detail {
inline bool is_finite(const vec3<double>& v) { return is_finite(v.x) && is_finite(v.y) && is_finite(v.z); }
inline bool is_finite(const imu_bias<double>& b) { return is_finite(b.gyro) && is_finite(b.acceleration); }
/// Whether an adjustment can use it: it is finite, and its velocity and position need no larger mean force per mass than max_force, m/s^2.
inline bool is_usable(const preintegration<double>& p, double max_force) {
  return p.dt > 0 && is_finite(p.dt + sum_of_elements(p)) && norm(p.dV) <= max_force * p.dt &&
         norm(p.dP) <= max_force * p.dt * p.dt / 2;
}
/// Whether it lasts dt s, but for max_error.
inline bool lasts(const preintegration<double>& p, double dt, double max_error) {
  return p.dt - dt <= max_error && dt - p.dt <= max_error;
}
}  // namespace detail

/// A keyframe is about to leave the map: what the IMU measured to it and from it on becomes one motion of the keyframe that
/// follows in time, merge(). Where one of the two is not known, not finite or beyond max_force, that one's is not known
/// either. Call it under the guard, before erase_keyframe(); local_mapper does so. O(1), and what join_samples() takes.
/// \param max_force  as inertial_adjustment_options::max_force
template <class Map>
void bridge_motion(Map& map, const typename map_traits<Map>::keyframe& removed, double max_force = default_max_force) {
  using traits = inertial_traits<Map>;
  static_assert(require_inertial_traits<Map>());
  const auto after = map_traits<Map>::next(map, removed);
  if (after == typename map_traits<Map>::keyframe{}) return;
  preintegration<double> to, from;
  if (!traits::motion(map, removed, to) || !traits::motion(map, after, from) || !detail::is_usable(to, max_force) ||
      !detail::is_usable(from, max_force))
    return traits::clear_motion(map, after);
  traits::set_motion(map, after, merge(to, from));
  if constexpr (detail::inertial_has_v<Map, detail::inertial_join_member>) traits::join_samples(map, removed, after);
}

TURBOMAP_END_NAMESPACE

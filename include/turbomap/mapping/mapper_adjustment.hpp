// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// With which class a local_mapper adjusts. The user may name one, or none; by default it depends on what the traits of the map
/// can write. A map that is mirrored is adjusted by the same class on the mirror.

#include <type_traits>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "global_adjustment.hpp"
#include "local_adjustment.hpp"
#include "refused_mapper.hpp"

namespace turbomap {

/// The adjustment of a local_mapper that compiles no solver. The stage then runs only if there is a hook `adjust`.
struct no_adjustment {};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// What a local_mapper adjusts with by default: local_adjustment, if the traits of the map can write poses and positions.
template <class Map, class Policy>
using default_adjustment =
    std::conditional_t<!has_map_traits_v<Map>, detail::refused_traits,
                       std::conditional_t<adjustable_v<Map>, local_adjustment<Map, Policy>, no_adjustment>>;

namespace detail {

/// The user's adjustment, on the map that stages work on.
template <class Adjustment, class Map>
struct adjustment_on {
  using type = Adjustment;
};
template <class Map>
struct adjustment_on<no_adjustment, Map> {
  /// Made like an adjustment, and never called.
  struct type {
    template <class Context>
    explicit type(const Context&) {}
  };
};
template <template <class, class, class> class Adjustment, class User, class Policy, class Methods, class Map>
struct adjustment_on<Adjustment<User, Policy, Methods>, Map> {
  using type = Adjustment<Map, Policy, Methods>;
  using methods = Methods;  ///< that are compiled
};

/// The adjustment of all of the map, with the same solvers.
template <class Adjustment, class Map>
struct global_on;
template <template <class, class, class> class Adjustment, class User, class Policy, class Methods, class Map>
struct global_on<Adjustment<User, Policy, Methods>, Map> {
  using type = global_adjustment<Map, Policy, Methods>;
};

/// Whether an adjustment uses the IMU of the map, as inertial_adjustment: the mapper is in inertial mode then.
template <class Adjustment, class = void>
struct is_inertial : std::false_type {};
template <class Adjustment>
struct is_inertial<Adjustment, std::enable_if_t<Adjustment::inertial>> : std::true_type {};

}  // namespace detail

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A map of which the mapper works on a copy, made of any other: so that both can be compared.

#include <turbomap/map/map_traits.hpp>

namespace turbomap {
template <class Map>
struct inertial_traits;  // of maps with an IMU, which include its header
}

namespace turbomap_test {

/// The same map, with the same members and traits, mirrored.
template <class Map>
struct mirrored_map : Map {
  using Map::Map;
};

}  // namespace turbomap_test

template <class Map>
struct turbomap::map_traits<turbomap_test::mirrored_map<Map>> : turbomap::map_traits<Map> {
  static constexpr bool mirrored = true;
};
template <class Map>
struct turbomap::inertial_traits<turbomap_test::mirrored_map<Map>> : turbomap::inertial_traits<Map> {};

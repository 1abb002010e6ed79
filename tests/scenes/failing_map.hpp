// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A flat_map whose traits throw in the middle of a commit, when told.

#include <cstddef>
#include <limits>
#include <stdexcept>

#include "map_scene.hpp"

namespace turbomap_test {

struct broken_write : std::runtime_error {
  broken_write() : std::runtime_error("the traits throw") {}
};
/// Its traits throw where an observation is added that is one too many.
struct failing_map : flat_map {
  using flat_map::flat_map;
  int adds_left = std::numeric_limits<int>::max();
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::failing_map> : turbomap::map_traits<turbomap_test::flat_map> {
  static void add_observation(turbomap_test::failing_map& m, point p, keyframe k, std::size_t i) {
    if (m.adds_left-- <= 0) throw turbomap_test::broken_write();
    turbomap::map_traits<turbomap_test::flat_map>::add_observation(m, p, k, i);
  }
};

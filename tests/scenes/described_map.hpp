// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A map that remembers which points were given an appearance.

#include <turbomap/map/simple_map/simple_map.hpp>

#include <cstdint>
#include <vector>

#include "matching_rigs.hpp"

namespace turbomap_test {

struct described_map : turbomap::simple_map<turbomap::binary_descriptor<256>, pinhole_camera> {
  using turbomap::simple_map<turbomap::binary_descriptor<256>, pinhole_camera>::simple_map;
  std::vector<std::uint64_t> described;  ///< ids, in the order of the calls
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::described_map>
    : turbomap::map_traits<turbomap::simple_map<turbomap::binary_descriptor<256>, turbomap_test::pinhole_camera>> {
  using map = turbomap_test::described_map;
  using base =
      turbomap::map_traits<turbomap::simple_map<turbomap::binary_descriptor<256>, turbomap_test::pinhole_camera>>;

  static void set_appearance(map& m, point p, const turbomap::vec3<float>& normal, float min, float max,
                             const std::uint8_t* d) {
    m.described.push_back(base::id(m, p));
    base::set_appearance(m, p, normal, min, max, d);
  }
};

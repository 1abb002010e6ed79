// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One number for a whole map. Two runs that leave the same map print the same number; a single bit that differs in a pose,
/// a position, an appearance or an observation changes it.

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <type_traits>

#include <turbomap/map/map_traits.hpp>

namespace turbomap_replay {

/// 64-bit FNV-1a over bytes.
class digest {
 public:
  void add_bytes(const void* data, std::size_t bytes) {
    const auto* at = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < bytes; ++i) value_ = (value_ ^ at[i]) * 0x100000001B3u;
  }
  template <class T>
  void add(const T& value) {
    static_assert(std::is_arithmetic_v<T>);  // a struct may have padding
    add_bytes(&value, sizeof value);
  }
  std::string text() const {
    char buffer[17];
    std::snprintf(buffer, sizeof buffer, "%016llx", static_cast<unsigned long long>(value_));
    return buffer;
  }

 private:
  std::uint64_t value_ = 0xCBF29CE484222325u;
};

/// Keyframes with their poses, points with position, appearance and observations, all in the order of the map.
template <class Map>
std::string map_digest(const Map& map) {
  using traits = turbomap::map_traits<Map>;
  using descriptor = typename traits::descriptor;
  digest d;
  traits::for_each_keyframe(map, [&](typename traits::keyframe k) {
    const auto& T = traits::pose(map, k);
    d.add(traits::id(map, k));
    d.add(T.qx), d.add(T.qy), d.add(T.qz), d.add(T.qw), d.add(T.tx), d.add(T.ty), d.add(T.tz);
  });
  traits::for_each_point(map, [&](typename traits::point p) {
    const auto& x = traits::position(map, p);
    const auto& n = traits::normal(map, p);
    d.add(traits::id(map, p));
    d.add(x.x), d.add(x.y), d.add(x.z), d.add(n.x), d.add(n.y), d.add(n.z);
    d.add(traits::min_distance(map, p)), d.add(traits::max_distance(map, p));
    d.add_bytes(traits::descriptor_data(map, p), descriptor::bytes);
    traits::for_each_observation(
        map, p, [&](typename traits::keyframe k, std::size_t keypoint) { d.add(traits::id(map, k)), d.add(keypoint); });
  });
  return d.text();
}

}  // namespace turbomap_replay

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Edits of a map as plain values, random lists of them, and the functions of the library that they call.

#include <turbomap/map/map_edit.hpp>
#include <turbomap/mapping/fusion_commit.hpp>

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <random>
#include <sstream>
#include <string>
#include <vector>

namespace turbomap_test {

enum class edit_kind : std::uint8_t {
  add_keyframe,
  erase_keyframe,
  add_point,
  erase_point,
  observe,
  forget,
  fade,
  move,
  merge,
  commit,
  cull_keyframes,
  cull_points,
  forget_replacements
};

struct edit {
  edit_kind kind;
  std::uint32_t a, b, c;
};

inline std::string to_string(const edit& e) {
  static constexpr const char* names[] = {"add_keyframe",
                                          "erase_keyframe",
                                          "add_point",
                                          "erase_point",
                                          "observe",
                                          "forget",
                                          "fade",
                                          "move",
                                          "merge",
                                          "commit",
                                          "cull_keyframes",
                                          "cull_points",
                                          "forget_replacements"};
  std::ostringstream text;
  text << "{edit_kind::" << names[static_cast<int>(e.kind)] << ", " << e.a << ", " << e.b << ", " << e.c << "}";
  return text.str();
}

inline std::vector<edit> random_edits(std::uint32_t seed, std::size_t count) {
  using k = edit_kind;
  // Observations dominate, so that maps are full and edits collide.
  static constexpr k often[] = {k::observe,   k::observe,   k::observe,   k::observe,   k::observe,   k::observe,
                                k::observe,   k::observe,   k::observe,   k::forget,    k::fade,      k::move,
                                k::move,      k::merge,     k::merge,     k::commit,    k::commit,    k::commit,
                                k::add_point, k::add_point, k::add_point, k::add_point, k::add_point, k::add_point};
  static constexpr k seldom[] = {k::add_keyframe,   k::add_keyframe,   k::add_keyframe,
                                 k::erase_keyframe, k::erase_keyframe, k::erase_point,
                                 k::cull_keyframes, k::cull_points,    k::forget_replacements};
  std::mt19937 random(seed);
  std::vector<edit> edits(count);
  for (edit& e : edits) {
    const auto r = static_cast<std::uint32_t>(random());
    e.kind = r % 8 == 0 ? seldom[(r / 8) % std::size(seldom)] : often[(r / 8) % std::size(often)];
    e.a = static_cast<std::uint32_t>(random() >> 12), e.b = static_cast<std::uint32_t>(random() >> 12);
    e.c = static_cast<std::uint32_t>(random() >> 12);
  }
  return edits;
}

/// The edits of the library. Tests of the tests replace one.
struct library_edits {
  template <class Map, class P, class K>
  static bool observe(Map& map, P p, K k, std::size_t i) {
    return turbomap::observe(map, p, k, i);
  }
  template <class Map, class K>
  static auto forget(Map& map, K k, std::size_t i) {
    return turbomap::forget(map, k, i);
  }
  template <class Map, class K>
  static bool move(Map& map, K k, std::size_t from, std::size_t to) {
    return turbomap::move_observation(map, k, from, to);
  }
  template <class Map, class P, class S>
  static bool merge(Map& map, P from, P into, const turbomap::fusion_commit_options& o, S& scratch) {
    return turbomap::merge_points(map, from, into, o.merges, scratch, o.tolerance);
  }
};

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A million random edits of maps, compared with the oracle after each one. A failure is shrunk to a short list of
/// edits that is printed as code.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "scenes/map_scene.hpp"
#include "scenes/map_world.hpp"
#include "scenes/pointer_map.hpp"
#include "support/shrink.hpp"

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(undefined_behavior_sanitizer)
#define TURBOMAP_TEST_SANITIZED 1
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TURBOMAP_TEST_SANITIZED 1
#endif

namespace {

using namespace turbomap_test;

#if defined(TURBOMAP_TEST_SANITIZED) || !defined(__OPTIMIZE__)
constexpr std::size_t edits_in_all = 300000;
#else
constexpr std::size_t edits_in_all = 1300000;  // of which a million change the map; the others are refused, rightly
#endif
constexpr std::size_t edits_a_world = 5000;  // what a failure is shrunk from

world_options world_of(std::size_t number) {
  world_options o;
  o.cameras = std::array{1, 2, 4}[number % 3];
  o.levels = std::array{8, 8, 1, 3}[number % 4];
  o.keypoints_per_camera = std::array{24, 14, 9}[number % 3];
  return o;
}

/// The shortest list that was found to fail, as code and with what fails.
template <class Map, class Edits>
std::string report(std::vector<edit>& edits, const world_options& options) {
  const auto fails = [&options](const std::vector<edit>& list) {
    return run_edits<Map, Edits>(list, options).has_value();
  };
  const auto failure = run_edits<Map, Edits>(edits, options);
  edits.resize(std::min(edits.size(), failure->edit + 1));
  for (std::size_t before = edits.size() + 1; edits.size() < before;) {
    before = edits.size();
    edits = shrink(edits, fails);
    // Small operands need fewer points and keyframes to mean what they mean.
    shrink_values(
        edits,
        [](edit& e) {
          return std::array{&e.a, &e.b, &e.c};
        },
        fails);
    edits = shrink(edits, fails);
  }
  std::string text = "cameras " + std::to_string(options.cameras) + ", levels " + std::to_string(options.levels) + "\n";
  for (const edit& e : edits) text += to_string(e) + ",\n";
  return text + run_edits<Map, Edits>(edits, options)->what;
}

/// Worlds of random edits until `count` were made or one fails; then its shrunk list.
template <class Map, class Edits = library_edits>
std::vector<edit> find_failure(std::size_t count, std::string& text, std::size_t* done = nullptr) {
  for (std::size_t world = 0; world * edits_a_world < count; ++world) {
    auto edits = random_edits(static_cast<std::uint32_t>(world + 1), edits_a_world);
    if (!run_edits<Map, Edits>(edits, world_of(world), 1000, done)) continue;
    text = "world " + std::to_string(world) + ", " + report<Map, Edits>(edits, world_of(world));
    return edits;
  }
  return {};
}

template <class Map>
void check_edits(std::size_t count) {
  std::string text;
  std::size_t done = 0;
  find_failure<Map>(count, text, &done);
  INFO(text);
  CHECK(text.empty());
  CHECK(done > count / 4 * 3);
}

TEST_CASE("a million random edits of a simple_map: no violation") { check_edits<flat_map>(edits_in_all); }

TEST_CASE("the same edits of a map of pointers, without counts of its own, give the same map") {
  check_edits<pointer_map>(edits_in_all / 10);
}

// Edits with a fault each.
struct move_keeps_counts : library_edits {
  template <class Map, class K>
  static bool move(Map& map, K k, std::size_t from, std::size_t to) {
    using traits = turbomap::map_traits<Map>;
    const auto kept = traits::point_at(map, k, from);
    if (!turbomap::move_observation(map, k, from, to)) return false;
    // As if the counts had not followed.
    const int before = traits::keypoint(map, k, from).octave, after = traits::keypoint(map, k, to).octave;
    turbomap::detail::move_count(map, kept, after, before);
    return true;
  }
};
struct second_view_counts_again : library_edits {  // what drifts on rigs in published code
  template <class Map, class P, class K>
  static bool observe(Map& map, P p, K k, std::size_t i) {
    const int before = turbomap::finest_octave(map, p, k);
    if (!turbomap::observe(map, p, k, i)) return false;
    if (before >= 0) turbomap::detail::change_count(map, p, before, 1);
    return true;
  }
};
struct forget_keeps_the_slot : library_edits {
  template <class Map, class K>
  static auto forget(Map& map, K k, std::size_t i) {
    const auto p = turbomap::forget(map, k, i);
    turbomap::map_traits<Map>::set_point(map, k, i, p);
    return p;
  }
};
struct merge_without_replacement : library_edits {
  template <class Map, class P, class S>
  static bool merge(Map& map, P from, P into, const turbomap::fusion_commit_options&, S& scratch) {
    if (from == into || turbomap::seen_apart(map, from, into)) return false;
    scratch.clear();
    turbomap::map_traits<Map>::for_each_observation(map, from, [&scratch](auto k, std::size_t i) {
      scratch.push_back({k, i});
    });
    turbomap::erase_point(map, from);
    for (const auto& view : scratch) turbomap::observe(map, into, view.first, view.second);
    return true;
  }
};

/// Found, shrunk to at most `longest` edits, of which none can go.
template <class Edits>
void check_shrinks(std::size_t longest) {
  std::string text;
  const auto edits = find_failure<flat_map, Edits>(60000, text);
  INFO(text);
  REQUIRE_FALSE(edits.empty());
  CHECK(edits.size() <= longest);
  bool rig = false;  // the world that failed may have been of any rig: one of them shows it
  for (std::size_t world = 0; world < 12 && !rig; ++world) {
    if (!run_edits<flat_map, Edits>(edits, world_of(world))) continue;
    rig = true;
    CHECK_FALSE(run_edits<flat_map>(edits, world_of(world)));  // the library's own edits pass
  }
  CHECK(rig);
}

TEST_CASE("broken edits are found, and shrunk to the few edits that matter") {
  check_shrinks<move_keeps_counts>(4);          // a keyframe, a point, a view, the move
  check_shrinks<second_view_counts_again>(4);   // a keyframe, a point, two views
  check_shrinks<forget_keeps_the_slot>(4);      // a keyframe, a point, a view, forgotten
  check_shrinks<merge_without_replacement>(4);  // two points, a keyframe, the merge
}

TEST_CASE("a list shrinks to what makes it fail, and to the numbers that do") {
  std::vector<unsigned> list(1000, 7);
  list[3] = 500, list[444] = 500, list[999] = 900;
  int runs = 0;
  const auto fails = [&runs](const std::vector<unsigned>& l) {
    ++runs;
    std::size_t n = 0;
    for (const unsigned x : l) n += x >= 2 && x != 7 ? 1 : 0;
    return n >= 3;
  };
  auto shrunk = shrink(list, fails);
  CHECK(shrunk == std::vector<unsigned>{500, 500, 900});
  CHECK(runs < 200);
  shrink_values(
      shrunk, [](unsigned& x) { return std::array{&x}; }, fails);
  CHECK(shrunk == std::vector<unsigned>{2, 2, 2});
  CHECK(shrink(std::vector<int>{1}, [](const std::vector<int>&) { return true; }).empty());
}

}  // namespace

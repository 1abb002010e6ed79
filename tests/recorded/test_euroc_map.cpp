// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Search and creation on a real map with known poses, 384-bit descriptors: bounds well below what docs/evaluation.md states,
/// and well above what a broken search or creation reaches.

#include <doctest/doctest.h>

#include "../files.hpp"
#include "../support.hpp"
#include "evaluation/euroc_map.hpp"

using namespace turbomap::evaluation;

namespace {

void check(const map_evaluation& e) {
  MESSAGE(e.matches << " matches; recall " << e.recall() << ", precision " << e.precision() << " ("
                    << e.precision_with_duplicates() << "), accuracy " << median(e.distance_relative));
  CHECK(e.ordered_differs == 0);
  CHECK(e.queries > 100);
  // Nearly all that can be found is: what is lost, is lost to another candidate of smaller distance.
  CHECK(e.found >= e.consistent * 95 / 100);
  CHECK(e.found <= e.consistent);
  CHECK(e.precision() > 0.7);
  CHECK(e.precision_with_duplicates() > 0.9);
  CHECK(e.accepted_of_correct > e.correct * 9 / 10);
  CHECK(median(e.distance_relative) < 0.03);
}

}  // namespace

TEST_CASE("a real map: undistorted pixels") {
  const auto file = turbomap_test::data("euroc-v101-map/euroc_v1_01_submaps.kfm");
  if (!file) return;
  const keyframe_map map = read_keyframe_map(*file);
  CHECK(map.keyframes.size() == 159);
  CHECK(map.landmarks.size() == 37600);
  const map_evaluation e = map_evaluator<turbomap::pinhole<double>>(map, {}).run();
  check(e);
  CHECK(e.recall() > 0.33);
}

TEST_CASE("a real map: raw pixels and the lens's own model") {
  const auto file = turbomap_test::data("euroc-v101-map/euroc_v1_01_submaps.kfm");
  if (!file) return;
  const map_evaluation e = map_evaluator<turbomap::brown_conrady<double>>(read_keyframe_map(*file), {}).run();
  check(e);
  CHECK(e.recall() > 0.45);
}

TEST_CASE("a .kfm file that is cut short, or is none, is refused") {
  const auto file = turbomap_test::data("euroc-v101-map/euroc_v1_01_submaps.kfm");
  if (!file) return;
  const turbomap_test::temporary_directory folder;
  const std::string bytes = turbomap_test::file_bytes(*file);
  const auto message = [&](const std::string& changed) {
    turbomap_test::write_bytes(folder / "map.kfm", changed);
    return turbomap_test::bad_file_message([&] { read_keyframe_map(folder / "map.kfm"); });
  };
  CHECK(turbomap_test::has(message(bytes.substr(0, 50)), "intrinsics: the file is cut short"));
  CHECK(turbomap_test::has(message(bytes.substr(0, bytes.size() - 1)), "landmark submap: the file is cut short"));
  CHECK(turbomap_test::has(message(bytes + "x"), "1 bytes after the last landmark"));
  CHECK(turbomap_test::has(message("no" + bytes.substr(2)), "magic"));
}

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Search, creation and fusion on a real map with known poses, 384-bit descriptors: bounds well below what docs/evaluation.md states,
/// and well above what a broken search or creation reaches.

#include <doctest/doctest.h>

#include "evaluation/euroc_map.hpp"
#include "evaluation/euroc_map_fusion.hpp"
#include "support/files.hpp"
#include "support/support.hpp"

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

/// What holds of every map that was fused under merge_rule::refuse: nothing is merged that the map sees apart.
void check_refused(const fusion_verdict& v) {
  CHECK(v.faults == 0);
  CHECK(v.seen_twice == 0);
  CHECK(v.contradictions_known == 0);
  CHECK(v.observations_lost() == 0);
  // The rest are of observations that the map was not told of, one for each pair at most.
  CHECK(v.contradiction_px.size() < v.survivor_px.size() / 30);
  CHECK(v.survivor_px.size() == v.summary.merged);
  CHECK(v.summary.stale == 0);
  CHECK(v.summary.entries ==
        v.summary.merged + v.summary.observations_added + v.summary.conflicts + v.summary.already_observed);
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

TEST_CASE("a real map: keypoints with two landmarks are found to be duplicates, or it is known why not") {
  const auto file = turbomap_test::data("euroc-v101-map/euroc_v1_01_submaps.kfm");
  if (!file) return;
  const keyframe_map map = read_keyframe_map(*file);
  for (const double sigma : {1.0, 2.0}) {
    fusion_evaluation_options options;
    options.sigma_px = sigma;
    const pair_evaluation e = fusion_evaluator(map, options).pairs();
    MESSAGE(e.of(pair_cause::found) << " of " << e.pairs << " found, " << e.verdict.summary.merged << " merged");
    CHECK(e.pairs == 873);
    std::size_t explained = 0, searched = 0;
    for (const std::size_t n : e.cause) explained += n;
    for (const std::size_t n : e.outcome) searched += n;
    CHECK(explained == e.pairs);
    CHECK(searched == e.pairs - e.of(pair_cause::unseen));
    // The explanation, made without the search, agrees with it.
    CHECK(e.of(pair_cause::found) + e.elsewhere == e.of(turbomap::duplicate_outcome::matched));
    CHECK(e.of(pair_cause::found) > (sigma > 1 ? 400 : 300));
    CHECK(e.of(pair_cause::lost) < e.of(pair_cause::found) / 20);
    CHECK(e.of(pair_cause::turned) == 0);
    // All that are found are fused, and hardly anything else.
    CHECK(e.verdict.confirmed == e.of(pair_cause::found));
    CHECK(e.verdict.summary.merged >= e.verdict.confirmed);
    CHECK(e.verdict.summary.merged <= e.verdict.confirmed * 103 / 100);
    check_refused(e.verdict);
  }
}

TEST_CASE("a real map: every keyframe is fused with its neighbourhood") {
  const auto file = turbomap_test::data("euroc-v101-map/euroc_v1_01_submaps.kfm");
  if (!file) return;
  const keyframe_map map = read_keyframe_map(*file);
  fusion_evaluation_options options;
  const fusion_verdict v = fusion_evaluator(map, options).whole_map();
  MESSAGE(v.summary.merged << " merged, " << v.summary.conflicts << " conflicts, " << v.confirmed << " confirmed");
  check_refused(v);
  CHECK(v.summary.merged > 1400);
  CHECK(v.confirmed > 360);  // both ways find more than one
  // As near to the keypoints of the other as those that are duplicates for certain.
  CHECK(fusion_verdict::near(v.survivor_px) > v.survivor_px.size() * 9 / 10);
  CHECK(fusion_verdict::near(v.certain_survivor_px) < v.certain_survivor_px.size());

  // The other rules do merge what is seen apart: so the check above can fail.
  options.merges = turbomap::merge_rule::refuse_apart;
  const fusion_verdict apart = fusion_evaluator(map, options).whole_map();
  CHECK(apart.faults == 0);
  CHECK(apart.contradictions_known > 100);
  CHECK(median(apart.contradiction_px) < std::sqrt(2 * turbomap::merge_tolerance{}.chi2));
  options.merges = turbomap::merge_rule::drop;
  const fusion_verdict drop = fusion_evaluator(map, options).whole_map();
  CHECK(drop.faults == 0);
  CHECK(drop.contradictions_known > apart.contradictions_known);
  CHECK(drop.observations_lost() > 100);
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

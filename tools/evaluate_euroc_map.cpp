// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-evaluate-euroc-map: recall, precision and accuracy of search and creation, and what duplicate search and fusion find
/// and do, on a real map (.kfm) with known poses.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <string>

#include "evaluation/euroc_map.hpp"
#include "evaluation/euroc_map_fusion.hpp"
#include "run_program.hpp"

namespace {

using namespace turbomap::evaluation;

template <class Camera>
void report(const char* pixels, const keyframe_map& map, const map_evaluation_options& options) {
  const map_evaluation e = map_evaluator<Camera>(map, options).run();
  std::printf("\n%s pixels, sigma %.0f px: %zu query keyframes, %zu pairs (%zu left out: short baseline)\n", pixels,
              options.sigma_px, e.queries, e.pairs, e.short_baselines);
  std::printf(
      "  recall:    %zu of %zu common observations matched (%.1f %%); %zu within the descriptor threshold, %zu of "
      "these "
      "pass the epipolar test\n",
      e.found, e.common, 100 * e.recall(), e.within, e.consistent);
  std::printf(
      "  precision: %zu matches: %zu of one landmark, %zu of two (they disagree by %.1f px in the median): %zu within "
      "%.0f px, %zu wrong; %zu unknown\n",
      e.matches, e.correct, e.disagreement_px.size(), median(e.disagreement_px), e.duplicates(), e.duplicate_px,
      e.wrong(), e.matches - e.correct - e.disagreement_px.size());
  std::printf("             %.1f %%; %.1f %% when two landmarks within %.0f px count as one\n", 100 * e.precision(),
              100 * e.precision_with_duplicates(), e.duplicate_px);
  std::printf("  creation:  %zu accepted; of the correct matches %zu (%.1f %%), of the wrong ones %zu (%.1f %%)\n",
              e.accepted, e.accepted_of_correct, 100 * share(e.accepted_of_correct, e.correct), e.accepted_of_wrong,
              100 * share(e.accepted_of_wrong, e.wrong()));
  std::printf(
      "  accuracy:  created point to the map's landmark: median %.3f m, p90 %.3f m; of its depth: median %.2f %%, p90 "
      "%.2f %%\n",
      median(e.distance_m), quantile(e.distance_m, 0.9), 100 * median(e.distance_relative),
      100 * quantile(e.distance_relative, 0.9));
  std::printf("  epipolar-ordered search: %.2f ms per keyframe (one core); differs from exhaustive in %zu of %zu\n",
              e.search_ms / static_cast<double>(e.queries), e.ordered_differs, e.queries);
}

void report(const char* what, const fusion_verdict& v) {
  const turbomap::fusion_summary& s = v.summary;
  std::printf(
      "  %s: %zu found: %zu merged, %zu observations added, %zu conflicts, %zu observed already by then\n"
      "    %zu pairs of the source are one point; %zu faults of the map, %zu points seen twice by a keyframe, %zu "
      "observations lost\n"
      "    contradictions of the source: %zu, keypoints apart %.1f px in the median; %zu of them known to the map\n"
      "    survivor from the keypoints of what it replaced: %.1f px in the median (its own point: %.1f px), %zu of %zu "
      "within "
      "%.0f px; confirmed ones: %zu of %zu\n",
      what, s.entries, s.merged, s.observations_added, s.conflicts, s.already_observed, v.confirmed, v.faults,
      v.seen_twice, v.observations_lost(), v.contradiction_px.size(),
      v.contradiction_px.empty() ? 0.0 : median(v.contradiction_px), v.contradictions_known, median(v.survivor_px),
      median(v.own_px), fusion_verdict::near(v.survivor_px), v.survivor_px.size(), fusion_verdict::duplicate_px,
      fusion_verdict::near(v.certain_survivor_px), v.certain_survivor_px.size());
}

void report_fusion(const keyframe_map& map, fusion_evaluation_options options) {
  using turbomap::duplicate_outcome;
  const pair_evaluation e = fusion_evaluator(map, options).pairs();
  std::printf("\nduplicates, sigma %.0f px: %zu keypoints have two good landmarks; the second is looked for:\n",
              options.sigma_px, e.pairs);
  std::printf(
      "  %zu found; %zu seen nowhere else, %zu not in view, %zu beyond the gate, %zu too different, %zu lost to "
      "another "
      "keypoint\n",
      e.of(pair_cause::found), e.of(pair_cause::unseen), e.of(pair_cause::turned), e.of(pair_cause::misplaced),
      e.of(pair_cause::unlike), e.of(pair_cause::lost));
  std::printf(
      "  outcomes: %zu matched (%zu elsewhere), %zu too different, %zu no keypoint, %zu no consistent keypoint, %zu "
      "other\n",
      e.of(duplicate_outcome::matched), e.elsewhere, e.of(duplicate_outcome::too_different),
      e.of(duplicate_outcome::no_keypoint), e.of(duplicate_outcome::no_consistent_keypoint),
      e.of(duplicate_outcome::behind) + e.of(duplicate_outcome::outside) + e.of(duplicate_outcome::oblique));
  std::printf("  landmark to its keypoint: %.1f px in the median, p90 %.1f px; descriptors: %.0f bits, p90 %.0f\n",
              median(e.error_px), quantile(e.error_px, 0.9), median(e.distance), quantile(e.distance, 0.9));
  report("fused", e.verdict);
  report("whole map, refuse", fusion_evaluator(map, options).whole_map());
  options.merges = turbomap::merge_rule::refuse_apart;
  report("whole map, refuse_apart", fusion_evaluator(map, options).whole_map());
}

}  // namespace

int main(int argc, char** argv) {
  std::string file;
  map_evaluation_options options;
  CLI::App app("Evaluates search and creation on a recorded map with known poses.", "turbomap-evaluate-euroc-map");
  app.footer("Example:\n  turbomap-evaluate-euroc-map euroc-v101-map/euroc_v1_01_submaps.kfm");
  app.add_option("MAP", file, "The .kfm file")->required();
  app.add_option("--neighbours", options.neighbours, "Neighbours per keyframe")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--max-distance", options.max_distance, "Largest descriptor distance")
      ->check(CLI::Range(0, 384))
      ->capture_default_str();
  return turbomap_program::run_program(app, argc, argv, [&] {
    const keyframe_map map = read_keyframe_map(file);
    std::printf("%zu keyframes, %zu landmarks\n", map.keyframes.size(), map.landmarks.size());
    for (const double sigma : {1.0, 2.0}) {
      options.sigma_px = sigma;
      report<turbomap::brown_conrady<double>>("raw", map, options);
      report<turbomap::pinhole<double>>("undistorted", map, options);
    }
    for (const double sigma : {1.0, 2.0})
      report_fusion(map, {options.max_distance, sigma, turbomap::merge_rule::refuse});
    return 0;
  });
}

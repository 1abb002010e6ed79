// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-evaluate-euroc-map: recall, precision and accuracy of search and creation on a real map (.kfm) with known poses.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>

#include "evaluation/euroc_map.hpp"

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
  std::printf("  epipolar-ordered search: %.2f ms a keyframe (one core); differs from exhaustive in %zu of %zu\n",
              e.search_ms / static_cast<double>(e.queries), e.ordered_differs, e.queries);
}

}  // namespace

int main(int argc, char** argv) {
  std::string file;
  map_evaluation_options options;
  CLI::App app("Evaluates search and creation on a recorded map with known poses.", "turbomap-evaluate-euroc-map");
  app.add_option("MAP", file, "The .kfm file")->required();
  app.add_option("--neighbours", options.neighbours, "Neighbours a keyframe")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--max-distance", options.max_distance, "Largest descriptor distance")
      ->check(CLI::Range(0, 384))
      ->capture_default_str();
  try {
    app.parse(argc, argv);
    const keyframe_map map = read_keyframe_map(file);
    std::printf("%zu keyframes, %zu landmarks\n", map.keyframes.size(), map.landmarks.size());
    for (const double sigma : {1.0, 2.0}) {
      options.sigma_px = sigma;
      report<turbomap::brown_conrady<double>>("raw", map, options);
      report<turbomap::pinhole<double>>("undistorted", map, options);
    }
  } catch (const CLI::ParseError& error) {
    return error.get_exit_code() == 0 ? app.exit(error)
                                      : (std::fprintf(stderr, "turbomap-evaluate-euroc-map: %s\n", error.what()), 2);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "turbomap-evaluate-euroc-map: %s\n", error.what());
    return 2;
  }
  return 0;
}

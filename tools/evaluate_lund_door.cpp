// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-evaluate-lund-door: search and creation on photographs, against their COLMAP model.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>

#include "evaluation/lund_door_evaluator.hpp"
#include "run_program.hpp"

namespace {

using namespace turbomap::evaluation;

template <class Camera>
void report(const char* pixels, const turbomap::colmap_model& model, const std::vector<photo>& photos,
            const photo_evaluation_options& options) {
  const photo_evaluation e = photo_evaluator<Camera>(model, photos, options).run();
  std::printf("\n%s pixels: %zu photographs, %zu keypoints, %zu pairs\n", pixels, e.photos, e.keypoints, e.pairs);
  std::printf("  matches:   %zu; candidate to epipolar line: median %.2f px, p90 %.2f px\n", e.matches,
              median(e.epipolar_px), quantile(e.epipolar_px, 0.9));
  std::printf(
      "  tracks:    %zu matches have one within %.0f px; %zu (%.1f %%) move as it does; deviation: median %.2f px, p90 "
      "%.1f px\n",
      e.judged, options.nearby_px, e.agree, 100 * e.agreement(), median(e.deviation_px), quantile(e.deviation_px, 0.9));
  std::printf(
      "  recall:    %zu of %zu keypoints on a track with a keypoint at its other end are matched there (%.1f %%)\n",
      e.found, e.reachable, 100 * e.recall());
  std::printf(
      "  points:    %zu accepted; to the nearest point of the model, in %% of the depth: median %.2f, p90 %.2f; depth "
      "against the track's (%zu): median %.2f %%, p90 %.2f %%\n",
      e.accepted, 100 * median(e.nearest), 100 * quantile(e.nearest, 0.9), e.depth_error.size(),
      100 * median(e.depth_error), 100 * quantile(e.depth_error, 0.9));
  std::printf("  epipolar-ordered search: %.1f ms per photograph (one core); differs from exhaustive in %zu of %zu\n",
              e.search_ms / static_cast<double>(e.photos), e.ordered_differs, e.photos);
}

}  // namespace

int main(int argc, char** argv) {
  std::string folder;
  photo_evaluation_options options;
  CLI::App app("Evaluates search and creation on photographs with a COLMAP model.", "turbomap-evaluate-lund-door");
  app.footer("Example:\n  turbomap-evaluate-lund-door lund-door");
  app.add_option("FOLDER", folder, "Folder with images/ and colmap_ground_truth/ (text form)")->required();
  app.add_option("--features", options.features, "ORB features per photograph")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_option("--neighbours", options.neighbours, "Neighbours a photograph")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  return turbomap_program::run_program(app, argc, argv, [&] {
    const auto model = turbomap::read_colmap_model(folder + "/colmap_ground_truth");
    const auto photos = read_photos(folder + "/images", model, options.features);
    report<turbomap::brown_conrady<double>>("raw", model, photos, options);
    report<turbomap::pinhole<double>>("undistorted", model, photos, options);
    return 0;
  });
}

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// ORB features of photographs with known poses, judged by the tracks and points of their COLMAP model: bounds well below what
/// docs/evaluation.md states, and well above what a broken search or creation reaches.

#include <doctest/doctest.h>

#include "support/support.hpp"

#if __has_include(<opencv2/features2d.hpp>)

#include "evaluation/lund_door_evaluator.hpp"

using namespace turbomap::evaluation;

namespace {

void check(const photo_evaluation& e) {
  MESSAGE(e.matches << " matches; " << e.agreement() << " of " << e.judged << " agree with a track; recall "
                    << e.recall() << ", depth error " << median(e.depth_error) << ", to the nearest point "
                    << median(e.nearest));
  CHECK(e.ordered_differs == 0);
  CHECK(e.pairs == 24);
  CHECK(e.matches > 10000);
  CHECK(e.judged > 1500);
  CHECK(e.agreement() > 0.95);
  CHECK(e.recall() > 0.6);
  CHECK(median(e.epipolar_px) < 1);
  CHECK(e.accepted > e.matches * 9 / 10);
  CHECK(median(e.depth_error) < 0.01);
  CHECK(median(e.nearest) < 0.01);
}

}  // namespace

TEST_CASE("photographs with known poses") {
  const auto folder = turbomap_test::data("lund-door");
  if (!folder) return;
  const auto model = turbomap::read_colmap_model(*folder / "colmap_ground_truth");
  CHECK(model.images.size() == 12);
  CHECK(model.points.size() == 11384);
  photo_evaluation_options options;
  options.neighbours = 2;
  const auto photos = read_photos(*folder / "images", model, 2000);
  SUBCASE("undistorted pixels") { check(photo_evaluator<turbomap::pinhole<double>>(model, photos, options).run()); }
  SUBCASE("raw pixels") { check(photo_evaluator<turbomap::brown_conrady<double>>(model, photos, options).run()); }
}

TEST_CASE("pixels by place, also those beside the photograph") {
  pixel_grid grid(100, 50);
  grid.add(3, 4, 0), grid.add(-1e9, -1e300, 1), grid.add(1e300, 40, 2), grid.add(-2, 20, 3), grid.add(99, 49, 4);
  CHECK(grid.nearest(5, 4, 3) == 0);
  CHECK(grid.nearest(1, 20, 4) == 3);
  CHECK(grid.nearest(-40, 20, 4) == -1);
  CHECK(grid.nearest(1e300, 40, 16) == 2);
  CHECK(grid.nearest(101, 51, 4) == 4);
  CHECK(grid.nearest(1e9, 1e9, 16) == -1);
}

#else

TEST_CASE("photographs with known poses") { turbomap_test::skip("OpenCV was not found"); }

#endif

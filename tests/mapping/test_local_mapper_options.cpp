// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The sets of options: accurate() keeps what belongs to the sensor, and says what its comment says.

#include <turbomap/mapping/local_mapper_options.hpp>

#include <cmath>

#include <doctest/doctest.h>

using turbomap::local_mapper_options;
using turbomap::mapping_stage;

TEST_CASE("the four sets of defaults, as docs/local_mapping.md tells them") {
  const turbomap::pyramid scales{1.5F, 4};
  const auto stereo = local_mapper_options::stereo(0.11, 4.4, scales);
  const auto mono = local_mapper_options::monocular(scales);
  const auto inertial = local_mapper_options::stereo_inertial(0.11, 4.4, scales);
  const auto mono_inertial = local_mapper_options::monocular_inertial(scales);
  for (const auto* o : {&stereo, &mono, &inertial, &mono_inertial}) {
    const bool is_mono = o == &mono || o == &mono_inertial, has_imu = o == &inertial || o == &mono_inertial;
    CAPTURE(is_mono);
    CAPTURE(has_imu);
    const auto& around = o->neighbours.neighbourhood;
    CHECK(around.neighbours == (is_mono ? 30 : 10));
    CHECK(around.temporal_neighbours == (has_imu ? 11 : 0));
    CHECK(around.second_neighbours == 20);
    CHECK(around.temporal_targets == (has_imu ? 20 : 0));
    CHECK(o->neighbours.stereo_baseline == (is_mono ? 0 : 0.11));
    CHECK(o->neighbours.baseline_rule.min_baseline_depth_ratio == 0.01);
    CHECK(o->creation.max_parallax_cosine == (has_imu ? 0.9996 : 0.9998));
    CHECK(o->point_culling.patience == 2);
    CHECK(o->point_culling.fewest_measurements == (is_mono ? 2 : 3));
    CHECK(o->keyframe_culling.redundant_share == (o == &inertial ? 0.5F : 0.9F));
    CHECK(o->keyframe_culling.max_depth == (is_mono ? 0.0F : 4.4F));
    CHECK(o->keyframe_culling.temporal_guards == has_imu);
    for (const auto& s : {o->search.scales, o->creation.scales, o->fusion.search.scales, o->adjustment.scales})
      CHECK((s.scale_factor == 1.5F && s.levels == 4));
    CHECK(o->fusion.commit.tolerance.scale_factor == 1.5F);
    // What balanced() and accurate() are compared with.
    CHECK(o->adjustment.outlier_factor == 1);
    CHECK(o->fusion.search.radius == 3);
    CHECK(o->fusion.search.finer_octaves == 1);
    CHECK(o->fusion.search.coarser_octaves == 0);
    CHECK(o->creation.known_octaves == 1);
    CHECK_FALSE(o->covariances);
    CHECK_FALSE(o->fusion.covariances);
    CHECK(o->extra_rounds == 0);
    CHECK(o->adjustment.solve.max_iterations == 10);
    CHECK(o->adjustment.solve.min_relative_decrease == 3e-4);
    CHECK(o->keyframe_culling.observers == 3);
    for (const bool enabled : o->enabled.values) CHECK(enabled);
    CHECK(o->most_views == 128);
    CHECK(o->checked_share == 0.01);
    CHECK(o->points_read_per_guard == 1024);
    CHECK(o->deadline_ms == 0);
    CHECK_FALSE(o->strict);
  }
}

TEST_CASE("accurate: what belongs to the sensor stays") {
  const turbomap::pyramid scales{1.5F, 4};
  const auto stereo = local_mapper_options::stereo(0.11, 4.4, scales).accurate();
  CHECK(stereo.neighbours.stereo_baseline == 0.11);
  CHECK(stereo.keyframe_culling.max_depth == 4.4F);
  CHECK(stereo.point_culling.fewest_measurements == 3);
  for (const auto& s :
       {stereo.search.scales, stereo.creation.scales, stereo.fusion.search.scales, stereo.adjustment.scales})
    CHECK((s.scale_factor == 1.5F && s.levels == 4));
  CHECK(stereo.fusion.commit.tolerance.scale_factor == 1.5F);
  CHECK(local_mapper_options::monocular().accurate().neighbours.neighbourhood.neighbours == 30);
  CHECK(stereo.neighbours.neighbourhood.temporal_neighbours == 10);
  const auto inertial = local_mapper_options::monocular_inertial().accurate();
  CHECK(inertial.neighbours.neighbourhood.temporal_neighbours == 11);
  CHECK(inertial.keyframe_culling.temporal_guards);
}

TEST_CASE("accurate: gates of 99.9 %, outliers of stereo beyond; the window holds the monocular gate at its octave") {
  const auto o = local_mapper_options::stereo(0.11, 4.4).accurate();
  const double mono = -2 * std::log(0.001);  // chi-square of two degrees of freedom
  CHECK(o.creation.mono_chi2 == doctest::Approx(mono).epsilon(1e-4));
  CHECK(o.fusion.search.mono_chi2 == doctest::Approx(mono).epsilon(1e-4));
  CHECK(o.adjustment.outlier_factor * o.adjustment.mono_chi2 == doctest::Approx(mono).epsilon(1e-4));
  CHECK(o.adjustment.mono_chi2 == local_mapper_options().adjustment.mono_chi2);  // the kernel stays
  CHECK(o.fusion.search.radius * o.fusion.search.radius >= mono);
  const double x = o.fusion.search.stereo_chi2;  // of three
  CHECK(std::erfc(std::sqrt(x / 2)) + std::sqrt(2 * x / std::acos(-1.0)) * std::exp(-x / 2) ==
        doctest::Approx(0.001).epsilon(1e-3));
  CHECK(o.creation.stereo_chi2 == x);
  CHECK(o.adjustment.outlier_factor * o.adjustment.stereo_chi2 == doctest::Approx(18.02).epsilon(1e-3));
}

TEST_CASE("accurate: links are looked for again, and scales that hang on few points are adjusted to the end") {
  const auto o = local_mapper_options::monocular().accurate();
  CHECK(local_mapper_options().extra_rounds == 0);
  CHECK(o.extra_rounds == 2);
  CHECK(local_mapper_options().adjustment.solve.damping == turbomap::damping_rule::diagonal);
  CHECK(local_mapper_options().adjustment.solve.slow_iterations == 1);
  CHECK(o.adjustment.solve.slow_iterations == 3);
  CHECK(o.adjustment.solve.damping == turbomap::damping_rule::diagonal);
  CHECK(o.adjustment.solve.max_iterations == 20);
  CHECK(o.adjustment.solve.min_relative_decrease == 1e-5);
}

TEST_CASE("balanced: the gates of accurate, one round, and more observers before a keyframe goes") {
  const auto o = local_mapper_options::stereo(0.11, 4.4).balanced(), most = o.accurate();
  CHECK(o.creation.mono_chi2 == most.creation.mono_chi2);
  CHECK(o.fusion.search.stereo_chi2 == most.fusion.search.stereo_chi2);
  CHECK(o.adjustment.outlier_factor == most.adjustment.outlier_factor);
  CHECK(o.fusion.search.coarser_octaves == 1);
  CHECK(o.neighbours.neighbourhood.temporal_neighbours == 10);
  CHECK(o.covariances);
  CHECK_FALSE(o.fusion.covariances);
  CHECK(o.extra_rounds == 0);
  CHECK(o.adjustment.solve.slow_iterations == 1);
  CHECK(o.enabled[mapping_stage::keyframe_culling]);
  CHECK(o.keyframe_culling.observers == 8);
  CHECK(o.keyframe_culling.max_depth == 4.4F);
  CHECK(local_mapper_options::stereo(0.11, 4.4).accurate().keyframe_culling.observers == 3);
}

TEST_CASE("accurate: no keyframe is culled, and points are not taken as exact") {
  const auto o = local_mapper_options::monocular().accurate();
  for (std::size_t s = 0; s < turbomap::mapping_stages; ++s)
    CHECK(o.enabled.values[s] == (static_cast<mapping_stage>(s) != mapping_stage::keyframe_culling));
  CHECK(o.covariances);
  CHECK(o.fusion.covariances);
}

TEST_CASE("published steps: those of both adjustments") {
  using turbomap::damping_rule;
  auto o = local_mapper_options::stereo_inertial(0.11, 4.4);
  for (const auto* w : {&o.inertial.window, &o.inertial.large}) {
    CHECK(w->damping == damping_rule::diagonal);
    CHECK(w->initial_lambda == 1e-6);
  }
  o.use_published_steps();
  CHECK(o.adjustment.solve.damping == damping_rule::identity);
  CHECK(o.adjustment.solve.slow_iterations == 3);
  CHECK(o.inertial.window.damping == damping_rule::identity);
  CHECK(o.inertial.window.initial_lambda == 1);
  CHECK(o.inertial.large.damping == damping_rule::identity);
  CHECK(o.inertial.large.initial_lambda == 1e-2);
}

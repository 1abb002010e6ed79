// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One bad row, kernel or option costs that row, or is refused, under any policy; it does not spoil the adjustment of all others.

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include "adjustment_cases.hpp"

namespace turbomap_test {

/// Options of an adjustment that goes on until nothing is left to gain.
inline turbomap::adjustment_options long_run(turbomap::damping_rule damping) {
  turbomap::adjustment_options options = in_float64();
  options.max_iterations = 60, options.damping = damping;
  return options;
}

/// Too much damping is no convergence.
template <class Policy>
void check_too_much_damping(const Policy& policy) {
  const auto s = make_adjustment_scene(scene_kind::stereo, 5, 1, 40, 3);
  for (const auto damping : {turbomap::damping_rule::identity, turbomap::damping_rule::diagonal}) {
    turbomap::adjustment_options options = long_run(damping);
    const double optimum = adjust_scene(policy, s, options).summary.cost_final;
    options.initial_lambda = 1e100;
    const auto a = adjust_scene(policy, s, options);
    CHECK(a.summary.cost_final == doctest::Approx(optimum).epsilon(1e-9));
    CHECK(a.summary.accepted > 0);
  }
}

/// At the optimum an adjustment has converged, whatever the damping.
template <class Policy>
void check_at_optimum(const Policy& policy) {
  auto s = make_adjustment_scene(scene_kind::stereo, 5, 1, 40, 3);
  const auto a = adjust_scene(policy, s, long_run(turbomap::damping_rule::diagonal));
  s.poses = a.poses, s.points = a.points;
  for (const double lambda : {0.0, 1.0, 1e100}) {
    turbomap::adjustment_options options = long_run(turbomap::damping_rule::diagonal);
    options.initial_lambda = lambda, options.min_predicted_decrease = 1e-9;
    const auto again = adjust_scene(policy, s, options);
    CHECK(again.summary.end == turbomap::adjustment_end::converged);
    CHECK(again.summary.accepted == 0);
  }
}

/// The default damping does not depend on the unit of length.
template <class Policy>
void check_unit_of_length(const Policy& policy) {
  const auto s = make_adjustment_scene(scene_kind::stereo, 5, 1, 40, 3);
  auto mm = s;
  for (auto* poses : {&mm.poses, &mm.true_poses})
    for (auto& T : *poses) T.tx *= 1000, T.ty *= 1000, T.tz *= 1000;
  for (auto& p : mm.points) p = {1000 * p.x, 1000 * p.y, 1000 * p.z};
  mm.rig[0].bf *= 1000;
  turbomap::adjustment_options options;
  options.numbers = turbomap::precision::float64;
  const auto in_m = adjust_scene(policy, s, options), in_mm = adjust_scene(policy, mm, options);
  CHECK(in_mm.summary.cost_final == doctest::Approx(in_m.summary.cost_final).epsilon(1e-6));
}

/// Under identity the first lambda scales with the information, also where an unknown is held.
template <class Policy>
void check_first_lambda(const Policy& policy) {
  for (const std::uint32_t held : {0U, 32U, 63U}) {
    CAPTURE(held);
    double lambda[2];
    for (const int small : {0, 1}) {
      auto s = make_adjustment_scene(scene_kind::stereo, 4, 1, 30, 5);
      const double scale = small == 1 ? 1e-12 : 1;
      for (auto& x : s.information) x *= scale;
      auto g = s.group();
      g.mono_kernel.delta2 *= scale, g.stereo_kernel.delta2 *= scale, g.undefined_chi2 *= scale;
      const std::vector<std::uint32_t> masks{0, 0, held, 0};
      turbomap::context<Policy> ctx{policy};
      turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
      auto frames = s.frame_input();
      frames.held = turbomap::span<const std::uint32_t>(masks);
      problem.assign(ctx, frames, s.landmark_input(), g);
      const auto summary = turbomap::adjust<float64_methods>(ctx, problem, long_run(turbomap::damping_rule::identity));
      REQUIRE(summary.accepted > 0);
      CHECK(summary.undetermined == 0);
      lambda[small] = summary.each[0].lambda / scale;
    }
    CHECK(lambda[1] == doctest::Approx(lambda[0]).epsilon(1e-9));
  }
}

/// A problem with these kernels is refused. \param words  of the message
template <class Policy, class Kernel>
void check_refused(const Policy& policy, const Kernel& mono, const Kernel& stereo, const char* words) {
  const auto s = make_adjustment_scene(scene_kind::stereo, 3, 1, 10, 3);
  const auto g = s.group();
  turbomap::reprojections<scene_camera, Kernel> rows;
  rows.rig = g.rig, rows.frame = g.frame, rows.landmark = g.landmark, rows.pixel = g.pixel;
  rows.information = g.information, rows.camera = g.camera;
  rows.mono_kernel = mono, rows.stereo_kernel = stereo;
  turbomap::context<Policy> ctx{policy};
  turbomap::bundle_problem<Policy, pose_frame, decltype(rows)> problem(ctx);
  CHECK_THROWS_WITH_AS(problem.assign(ctx, s.frame_input(), s.landmark_input(), rows), doctest::Contains(words),
                       std::invalid_argument);
}

/// A kernel with a bad weight at one place.
struct spoilt_kernel {
  double weight_at_one = 1;
  TURBOMAP_HD void operator()(double chi2, double& rho, double& weight) const {
    rho = chi2, weight = chi2 == 1 ? weight_at_one : 1;
  }
};

/// Kernels that give no cost or weight are refused by name.
template <class Policy>
void check_kernels_refused(const Policy& policy) {
  using turbomap::cauchy;
  using turbomap::huber;
  using turbomap::tukey;
  for (const double bad :
       {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN(), 0.0, -1.0}) {
    check_refused(policy, huber{bad}, huber{}, "mono_kernel");
    check_refused(policy, huber{}, huber{bad}, "stereo_kernel");
    check_refused(policy, cauchy{bad}, cauchy{}, "mono_kernel");
    check_refused(policy, tukey{}, tukey{bad}, "stereo_kernel");
  }
  check_refused(policy, spoilt_kernel{std::numeric_limits<double>::quiet_NaN()}, spoilt_kernel{}, "mono_kernel");
  check_refused(policy, spoilt_kernel{}, spoilt_kernel{-1}, "stereo_kernel");
}

/// A landmark at a camera, or next to it, leaves all others to be adjusted.
template <class Policy>
void check_landmark_at_camera(const Policy& policy) {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig})
    for (const auto damping : {turbomap::damping_rule::identity, turbomap::damping_rule::diagonal})
      for (const auto numbers : {turbomap::precision::float64, turbomap::precision::mixed})
        for (const double away : {0.0, 1e-9, 1e-4}) {
          CAPTURE(static_cast<int>(kind));
          CAPTURE(away);
          auto s = make_adjustment_scene(kind, 5, 2, 40, 3);
          turbomap::adjustment_options options = long_run(damping);
          options.numbers = numbers;
          const auto without = adjust_scene(policy, s, options);
          const vec3<double> centre = turbomap::camera_centre(turbomap::to_isometry<double>(s.poses[4]));
          s.points.push_back({centre.x + away / 3, centre.y, centre.z + away});
          for (const std::int32_t f : {3, 4}) {  // fixed ones
            s.frame.push_back(f), s.landmark.push_back(40), s.pixel.push_back({370, 250, -1});
            s.information.push_back(1), s.camera.push_back(0);
          }
          const auto free = adjust_scene(policy, s, options);
          CHECK(free.summary.accepted > 0);
          const double its_own = free.summary.cost_initial - without.summary.cost_initial;
          CHECK(free.summary.cost_final < without.summary.cost_final + 1.01 * its_own);
          // Where it cannot leave, it takes no part at all.
          std::vector<std::uint8_t> fixed(41, 0);
          fixed[40] = 1;
          turbomap::context<Policy> ctx{policy};
          turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
          problem.assign(ctx, s.frame_input(), {s.landmark_input().positions, {fixed.data(), 41}}, s.group());
          const auto summary = turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, options);
          CHECK(summary.undefined == 1);
          std::vector<rigid_transform<double>> poses;
          problem.frames(ctx, poses);
          CHECK(distance(adjusted{{}, poses, {}}, adjusted{{}, without.poses, {}}) <
                (numbers == turbomap::precision::float64 ? 1e-6 : 1e-3));
        }
}

/// The distance of two frames: a norm, whose derivative at 0 is not a number in dual numbers.
struct range_factor {
  static constexpr int size = 1;
  struct row {};
  template <class S>
  TURBOMAP_HD bool residual(const rigid_transform<S>& a, const rigid_transform<S>& b, const row&, S* e) const {
    using turbomap::operator-;
    e[0] = turbomap::norm(turbomap::camera_centre(turbomap::to_isometry<S>(a)) -
                          turbomap::camera_centre(turbomap::to_isometry<S>(b)));
    return true;
  }
};
/// Where a camera's centre is.
struct place_factor {
  static constexpr int size = 3;
  struct row {
    vec3<double> place;
  };
  template <class S>
  TURBOMAP_HD bool residual(const rigid_transform<S>& T, const row& r, S* e) const {
    const auto c = turbomap::camera_centre(turbomap::to_isometry<S>(T));
    e[0] = c.x - S(r.place.x), e[1] = c.y - S(r.place.y), e[2] = c.z - S(r.place.z);
    return true;
  }
};
/// A landmark's distance from a frame: the same.
struct depth_factor {
  static constexpr int size = 1;
  struct row {
    double distance;
  };
  template <class S>
  TURBOMAP_HD bool residual(const rigid_transform<S>& T, const vec3<S>& X, const row& r, S* e) const {
    using turbomap::operator-;
    e[0] = turbomap::norm(X - turbomap::camera_centre(turbomap::to_isometry<S>(T))) - S(r.distance);
    return true;
  }
};

/// A derivative that is not a number is left out.
template <class Policy>
void check_derivative_not_a_number(const Policy& policy) {
  std::vector<rigid_transform<double>> T(3);
  const std::vector<std::int32_t> a{0}, b{1}, all{0, 1, 2}, lone{2}, landmark{0};
  const std::vector<range_factor::row> ranges(1);
  const std::vector<place_factor::row> places{{{0, 0, 0}}, {{1, 0, 0}}, {{0, 2, 0}}};
  const std::vector<depth_factor::row> depths{{0.5}};
  const std::vector<vec3<double>> X(1);
  turbomap::context<Policy> ctx{policy};
  turbomap::bundle_problem<Policy, pose_frame, turbomap::frame_pair_factors<range_factor>,
                           turbomap::frame_factors<place_factor>, turbomap::landmark_factors<depth_factor>>
      problem(ctx);
  problem.assign(ctx, {turbomap::span<const rigid_transform<double>>(T), {}},
                 {turbomap::span<const vec3<double>>(X), {}},
                 {{}, {a.data(), 1}, {b.data(), 1}, {ranges.data(), 1}, {}, 1e6},
                 {{}, {all.data(), 3}, {places.data(), 3}, {}, 1e6},
                 {{}, {lone.data(), 1}, {landmark.data(), 1}, {depths.data(), 1}, {}, 1e6});
  const auto summary = turbomap::adjust<float64_methods>(ctx, problem, long_run(turbomap::damping_rule::diagonal));
  CHECK(summary.accepted > 0);
  CHECK(summary.cost_final == doctest::Approx(1.0 / 3).epsilon(1e-6));  // (x0, x1): x0^2 + (x1 - 1)^2 + (x1 - x0)^2
}

/// A stereo row in the plane z = 0 of a fisheye is not defined, and the others are.
template <class Policy>
void check_stereo_row_in_plane(const Policy& policy) {
  auto s = make_adjustment_scene(scene_kind::fisheye_rig, 5, 2, 40, 3);
  s.rig[0].bf = 40;
  s.poses[4] = {};
  for (std::size_t i = 0; i < s.frame.size(); ++i)
    if (s.frame[i] == 4) s.information[i] = 0;
  const auto without = adjust_scene(policy, s, long_run(turbomap::damping_rule::diagonal));
  s.points.push_back({2, 0.5, 0});  // exactly in the plane of a fixed frame at the origin
  s.frame.push_back(4), s.landmark.push_back(40), s.pixel.push_back({600, 300, 400}), s.information.push_back(1);
  s.camera.push_back(0);
  const auto a = adjust_scene(policy, s, long_run(turbomap::damping_rule::diagonal));
  CHECK(a.summary.end != turbomap::adjustment_end::not_finite);
  CHECK(a.summary.accepted > 0);
  CHECK(a.summary.undefined == 1);
  CHECK(distance(adjusted{{}, a.poses, {}}, adjusted{{}, without.poses, {}}) < 1e-6);
}

/// Quaternions that are not of unit length are refused by name.
template <class Policy>
void check_quaternions(const Policy& policy) {
  auto s = make_adjustment_scene(scene_kind::mono, 3, 1, 10, 3);
  for (const double scale : {2.0, 0.0, 0.99, 1e200}) {  // the last: a square that is no number
    auto bad = s;
    auto& T = bad.poses[1];
    T.qx *= scale, T.qy *= scale, T.qz *= scale, T.qw *= scale;
    CHECK_THROWS_WITH_AS(adjust_scene(policy, bad, in_float64()), doctest::Contains("quaternion"),
                         std::invalid_argument);
  }
  auto overflowing = s;  // finite, each of them; their sum is not
  overflowing.poses[1].qx = overflowing.poses[1].qy = 1.5e308;
  CHECK_THROWS_WITH_AS(adjust_scene(policy, overflowing, in_float64()), doctest::Contains("quaternion"),
                       std::invalid_argument);
  auto& T = s.poses[1];
  T.qx = static_cast<float>(T.qx), T.qy = static_cast<float>(T.qy), T.qz = static_cast<float>(T.qz);
  CHECK(adjust_scene(policy, s, in_float64()).summary.accepted > 0);
}

/// Indices are refused wherever they are outside, information where it is below 0, not for a sign alone.
template <class Policy>
void check_indices_and_information(const Policy& policy) {
  const auto good = make_adjustment_scene(scene_kind::mono, 3, 1, 10, 3);
  constexpr int least = std::numeric_limits<int>::min(), most = std::numeric_limits<int>::max();
  for (const int index : {-1, 10, 11, least, least + 1, least + 9, most}) {
    CAPTURE(index);
    for (const std::size_t row : {std::size_t{0}, std::size_t{17}, good.landmark.size() - 1}) {
      auto bad = good;
      bad.landmark[row] = index;
      CHECK_THROWS_WITH_AS(adjust_scene(policy, bad, in_float64()), doctest::Contains("landmark"),
                           std::invalid_argument);
    }
  }
  auto none = good;
  none.points.clear();
  CHECK_THROWS_WITH_AS(adjust_scene(policy, none, in_float64()), doctest::Contains("landmark = "),
                       std::invalid_argument);
  auto s = good;
  s.information[4] = -0.0;  // off
  CHECK(adjust_scene(policy, s, in_float64()).summary.accepted > 0);
  s.information[5] = -std::numeric_limits<double>::quiet_NaN();
  CHECK(adjust_scene(policy, s, in_float64()).summary.end == turbomap::adjustment_end::not_finite);
  s.information[6] = -1e-300;
  CHECK_THROWS_WITH_AS(adjust_scene(policy, s, in_float64()), doctest::Contains("information = -1"),
                       std::invalid_argument);
}

/// A translation of finite numbers whose sum overflows is finite.
template <class Policy>
void check_overflowing_sum(const Policy& policy) {
  auto s = make_adjustment_scene(scene_kind::mono, 3, 1, 10, 3);
  s.fixed.resize(s.poses.size() + 1, 1);
  s.poses.push_back(s.poses[0]);  // seen by nothing
  s.poses.back().tx = s.poses.back().ty = 1.5e308;
  CHECK(adjust_scene(policy, s, in_float64()).summary.end != turbomap::adjustment_end::not_finite);
}

/// Pixels by the angle from the axis, where the derivative is 0 / 0.
struct axis_camera {
  using scalar = double;
  template <class S>
  TURBOMAP_HD bool project(const vec3<S>& p, turbomap::vec2<S>& pixel) const {
    using std::atan2;
    using std::sqrt;
    const S r = sqrt(p.x * p.x + p.y * p.y), scale = r > S(0) ? atan2(r, p.z) / r : S(1) / p.z + S(0) * r;
    pixel.x = S(400) + S(300) * scale * p.x, pixel.y = S(300) * scale * p.y;
    return p.z > S(0);
  }
  template <class S>
  TURBOMAP_HD bool unproject(const turbomap::vec2<S>&, vec3<S>&) const {
    return false;
  }
  void validate() const {}
};

/// A row keeps its cost and pulls at nothing where the derivative of its camera is not finite.
template <class Policy>
void check_derivative_of_camera(const Policy& policy) {
  for (const double bf : {0.0, 40.0}) {
    CAPTURE(bf);
    auto s = make_adjustment_scene(scene_kind::mono, 4, 1, 30, 3);
    s.poses[0] = {};
    s.points[3] = {0, 0, 6};  // on the axis of the first frame, which does not move
    turbomap::rig_camera<axis_camera> camera{};
    camera.bf = bf;
    for (std::size_t i = 0; i < s.frame.size(); ++i) {
      const auto p = turbomap::to_isometry<double>(s.true_poses[static_cast<std::size_t>(s.frame[i])]) *
                     s.true_points[static_cast<std::size_t>(s.landmark[i])];
      turbomap::vec2<double> q{};
      REQUIRE(axis_camera{}.project(p, q));
      s.pixel[i] = {q.x, q.y, bf > 0 ? q.x - bf / p.z : -1};
    }
    auto g = turbomap::huber_reprojections(turbomap::rig_view<axis_camera>{&camera, 1});
    g.frame = turbomap::span<const std::int32_t>(s.frame), g.landmark = turbomap::span<const std::int32_t>(s.landmark);
    g.pixel = turbomap::span<const vec3<double>>(s.pixel), g.information = turbomap::span<const double>(s.information);
    turbomap::context<Policy> ctx{policy};
    turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<axis_camera>> problem(ctx);
    problem.assign(ctx, s.frame_input(), s.landmark_input(), g);
    std::vector<double> chi2, depth;
    problem.template chi2<0>(ctx, chi2, depth);
    double cost = 0;
    const turbomap::huber kernel = bf > 0 ? g.stereo_kernel : g.mono_kernel;
    for (const double x : chi2) {
      double rho = 0, weight = 0;
      kernel(x, rho, weight), cost += rho;
    }
    for (const int iterations : {0, 1, 6}) {
      CAPTURE(iterations);
      turbomap::adjustment_options options = in_float64();
      options.max_iterations = iterations;
      problem.assign(ctx, s.frame_input(), s.landmark_input(), g);
      const auto summary = turbomap::adjust<float64_methods>(ctx, problem, options);
      CHECK(summary.cost_initial == doctest::Approx(cost).epsilon(1e-12));
      CHECK(summary.undefined == 0);
      CHECK(summary.accepted == iterations);
    }
  }
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Against GTSAM: its PreintegratedImuMeasurements on the manifold, on 1000 random intervals, and the optimum of a small
// visual-inertial problem. Needs the environment variable TURBOMAP_GTSAM_PYTHON: a Python that can import gtsam (pip install gtsam).

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include <turbomap/inertial/bias_update.hpp>

#include "inertial_scene.hpp"
#include "preintegration_cases.hpp"
#include "reference/larger_or_nan.hpp"
#include "support/files.hpp"
#include "support/policies.hpp"
#include "support/support.hpp"

namespace {

using namespace turbomap_test;
using float64_dense = turbomap::adjustment_methods<turbomap::solver_list<turbomap::reduced_solver::dense>,
                                                   turbomap::precision_list<turbomap::precision::float64>>;

/// Runs a script that stands beside this file: from numbers in a file to numbers in a file.
void run_python(const char* python, const char* script, const std::filesystem::path& input,
                const std::filesystem::path& output) {
  const auto path = std::filesystem::path(__FILE__).parent_path() / script;
  const std::string command = std::string(python) + " " + path.string() + " " + input.string() + " " + output.string();
  REQUIRE(std::system(command.c_str()) == 0);
}

TEST_CASE("preintegration is GTSAM's on 1000 random intervals") {
  const char* python = std::getenv("TURBOMAP_GTSAM_PYTHON");
  if (python == nullptr) return skip("TURBOMAP_GTSAM_PYTHON is not set: a Python that can import gtsam");
  const temporary_directory folder;
  const auto input = folder.path() / "in.txt", output = folder.path() / "out.txt";
  const imu_motion m = make_imu_motion(77, 4000, 1000);
  preintegration_options options;
  options.rule = turbomap::integration_rule::first_order;
  std::mt19937_64 random(3);
  std::vector<imu_bias<double>> other;
  {
    std::ofstream out(input);
    out.precision(17);
    const auto put = [&out](const vec3<double>& v) { out << v.x << ' ' << v.y << ' ' << v.z << ' '; };
    out << options.noise.gyro << ' ' << options.noise.acceleration << '\n' << m.intervals.size() << '\n';
    for (std::size_t i = 0; i < m.intervals.size(); ++i) {
      other.push_back(
          {m.biases[i].gyro + random_vector(random, 0.01), m.biases[i].acceleration + random_vector(random, 0.1)});
      put(m.biases[i].gyro), put(m.biases[i].acceleration), put(other[i].gyro), put(other[i].acceleration);
      const auto steps = oracle_steps(m.t_ns, m.sample, m.intervals[i]);
      out << steps.size() << '\n';
      for (const auto& s : steps) {
        out << s.dt << ' ';
        put({s.w.x(), s.w.y(), s.w.z()}), put({s.a.x(), s.a.y(), s.a.z()});
      }
      out << '\n';
    }
  }
  run_python(python, "gtsam_preintegration.py", input, output);

  std::ifstream in(output);
  const auto read = [&in](int rows, int columns) {
    Eigen::MatrixXd A(rows, columns);
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < columns; ++c) in >> A(r, c);
    return A;
  };
  const auto difference = [&](const turbomap::mat3<double>& R, const vec3<double>& V, const vec3<double>& P) {
    const Eigen::MatrixXd theirs_R = read(3, 3), theirs_V = read(3, 1), theirs_P = read(3, 1);
    return std::max({(to_eigen(R) - theirs_R).norm(), (to_eigen(V) - theirs_V).norm() / theirs_V.norm(),
                     (to_eigen(P) - theirs_P).norm() / theirs_P.norm()});
  };
  double motion = 0, moved = 0, covariance = 0;
  for (std::size_t i = 0; i < m.intervals.size(); ++i) {
    const auto p = turbomap::preintegrate(m.samples(), m.intervals[i], m.biases[i], options);
    const auto c = turbomap::corrected(p, other[i]);
    motion = std::max(motion, difference(p.dR, p.dV, p.dP));
    moved = std::max(moved, difference(c.dR, c.dV, c.dP));
    covariance = std::max(covariance, covariance_difference(covariance_of(p).topLeftCorner(9, 9), read(9, 9)));
  }
  REQUIRE(in.good());
  MESSAGE("largest relative differences: motion " << motion << ", at another bias " << moved << ", covariance "
                                                  << covariance);
  CHECK(motion < 1e-9);
  CHECK(moved < 1e-9);
  CHECK(covariance < 1e-9);
}

TEST_CASE("the optimum of a visual-inertial problem is GTSAM's") {
  const char* python = std::getenv("TURBOMAP_GTSAM_PYTHON");
  if (python == nullptr) return skip("TURBOMAP_GTSAM_PYTHON is not set: a Python that can import gtsam");
  const temporary_directory folder;
  const auto input = folder.path() / "in.txt", output = folder.path() / "out.txt";
  constexpr int frames = 6;
  constexpr unsigned seed = 5;
  inertial_scene s = make_inertial_scene(frames, 12, seed);
  const imu_motion m = make_imu_motion(seed, 60 * frames, 0);  // the scene's
  preintegration_options options;
  options.rule = turbomap::integration_rule::first_order;
  {
    std::ofstream out(input);
    out.precision(17);
    const auto put = [&out](const vec3<double>& v) { out << v.x << ' ' << v.y << ' ' << v.z << ' '; };
    const auto put_pose = [&](const isometry<double>& T) {
      for (const double x : T.R.m) out << x << ' ';
      put(T.t);
    };
    const auto put_bias = [&](const imu_bias<double>& b) { put(b.gyro), put(b.acceleration); };
    out << options.noise.gyro << ' ' << options.noise.acceleration << ' ' << options.noise.gyro_walk << ' '
        << options.noise.acceleration_walk << '\n';
    put_pose(s.T_bc), put(s.gravity);
    out << "435 436 367 252 47.9\n"
        << frames << ' ' << s.points.size() << ' ' << s.frame.size() << ' ' << s.edges.size() << '\n';
    for (const auto& x : s.states) {
      put_pose(turbomap::to_isometry<double>(turbomap::normalised(x.T_cw)));
      put(x.velocity), put_bias(x.bias);
    }
    for (const auto& p : s.points) put(p);
    for (std::size_t i = 0; i < s.frame.size(); ++i) {
      out << s.frame[i] << ' ' << s.landmark[i] << ' ';
      put(s.pixel[i]);
      out << 1 / std::sqrt(s.information[i]) << '\n';
    }
    out << "5.991 7.815\n";
    for (std::size_t k = 0; k < s.edges.size(); ++k) {
      const std::int64_t begin = m.t_ns[3] + static_cast<std::int64_t>(k) * 250'000'000;
      const auto interval = turbomap::find_interval(m.samples(), begin, begin + 250'000'000);
      const auto bias = s.edges[k].motion.bias;
      const auto p = turbomap::preintegrate(m.samples(), interval, bias, options);
      const double weight = k == 0 ? 1e-2 : 1;
      REQUIRE(turbomap::make_inertial_row(p, weight, s.edges[k]));
      REQUIRE(turbomap::make_walk_row(p, s.walks[k]));
      out << s.first[k] << ' ' << s.second[k] << ' ';
      put_bias(bias);
      const auto steps = oracle_steps(m.t_ns, m.sample, interval);
      out << weight << ' ' << (k == 0 ? 16.92 : 0) << ' ' << steps.size() << '\n';
      for (const auto& step : steps) {
        out << step.dt << ' ';
        put({step.w.x(), step.w.y(), step.w.z()}), put({step.a.x(), step.a.y(), step.a.z()});
      }
    }
    const auto& prior = s.priors[0];
    out << s.prior_frame[0] << ' ';
    put(prior.velocity), put_bias(prior.bias);
    out << prior.velocity_weight << ' ' << prior.gyro_weight << ' ' << prior.acceleration_weight << '\n';
  }
  run_python(python, "gtsam_adjustment.py", input, output);

  turbomap::context<sequential> ctx{sequential{}};
  inertial_problem<sequential> problem(ctx);
  s.assign(ctx, problem, inertial_factor{});
  turbomap::adjustment_options solve;
  solve.numbers = turbomap::precision::float64, solve.max_iterations = 60;
  const auto summary = turbomap::adjust<float64_dense>(ctx, problem, solve);
  std::vector<inertial_state<double>> states;
  std::vector<vec3<double>> points;
  problem.frames(ctx, states), problem.landmarks(ctx, points);

  std::ifstream in(output);
  double theirs;
  in >> theirs;
  CHECK(summary.cost_final == doctest::Approx(theirs).epsilon(1e-9));
  double pose = 0, velocity = 0, gyro = 0, acceleration = 0, point = 0;
  const auto compare = [&in](double ours, double& worst) {
    double x;
    in >> x;
    worst = larger_or_nan(worst, std::abs(ours - x));
  };
  const auto compare_vector = [&](const vec3<double>& v, double& worst) {
    compare(v.x, worst), compare(v.y, worst), compare(v.z, worst);
  };
  for (const auto& x : states) {
    const auto T = turbomap::to_isometry<double>(turbomap::normalised(x.T_cw));
    for (const double r : T.R.m) compare(r, pose);
    compare_vector(T.t, pose), compare_vector(x.velocity, velocity);
    compare_vector(x.bias.gyro, gyro), compare_vector(x.bias.acceleration, acceleration);
  }
  for (std::size_t l = 0; l < points.size(); ++l) {
    int rows = 0;  // one view without stereo tells no distance
    for (std::size_t i = 0; i < s.frame.size(); ++i)
      if (s.landmark[i] == static_cast<std::int32_t>(l)) rows += s.pixel[i].z >= 0 ? 3 : 2;
    double nowhere = 0;
    compare_vector(points[l], rows > 2 ? point : nowhere);
  }
  REQUIRE(in.good());
  MESSAGE("cost " << summary.cost_initial << " to " << summary.cost_final << ", theirs is "
                  << theirs / summary.cost_final - 1 << " more; largest differences: poses " << pose << ", velocities "
                  << velocity << ", biases " << gyro << ", " << acceleration << ", landmarks " << point);
  CHECK(pose < 1e-6);
  CHECK(velocity < 1e-6);
  CHECK(gyro < 1e-6);
  CHECK(acceleration < 1e-6);
  CHECK(point < 1e-6);
}

}  // namespace

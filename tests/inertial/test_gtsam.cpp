// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Preintegration against GTSAM's PreintegratedImuMeasurements on the manifold, on 1000 random intervals. Needs the
// environment variable TURBOMAP_GTSAM_PYTHON: a Python that can import gtsam (pip install gtsam).

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include <turbomap/inertial/bias_update.hpp>

#include "preintegration_cases.hpp"
#include "support/files.hpp"
#include "support/support.hpp"

namespace {

using namespace turbomap_test;

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
  const auto script = std::filesystem::path(__FILE__).parent_path() / "gtsam_preintegration.py";
  const std::string command =
      std::string(python) + " " + script.string() + " " + input.string() + " " + output.string();
  REQUIRE(std::system(command.c_str()) == 0);

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

}  // namespace

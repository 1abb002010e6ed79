// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Synthetic local bundle adjustments: what is read, what it costs, and what is refused.

#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>
#include "readers/synthetic_lba.hpp"

#include "reference/reprojection_cost.hpp"
#include "support/files.hpp"
#include "support/support.hpp"
#include "tests/synthetic_lba_samples.hpp"

using namespace turbomap_test;

namespace {

using pose = turbomap::rigid_transform<double>;
using point = turbomap::vec3<double>;

template <class Row>
std::string with(const char* name, const std::function<void(std::vector<Row>&)>& damage) {
  const temporary_directory folder;
  write_synthetic_lba(folder.path());
  auto rows = turbomap::read_npy_rows<Row>(folder / name);
  damage(rows);
  turbomap::write_npy_rows(folder / name, rows);
  return bad_file_message([&] { turbomap::read_synthetic_lba(folder.path()); });
}

}  // namespace

TEST_CASE("a problem is read, with or without the truth") {
  const temporary_directory folder;
  write_synthetic_lba(folder.path());
  const auto s = turbomap::read_synthetic_lba(folder.path());
  CHECK(s.data.frame_count() == 2);
  CHECK(s.data.T_cw[1].qw == 0.8);
  CHECK(s.data.fixed == std::vector<std::uint8_t>{0, 1});
  CHECK(s.data.points[1].z == 6);
  CHECK(s.data.frame == std::vector<std::int32_t>{0, 1, 1});
  CHECK(s.data.landmark == std::vector<std::int32_t>{1, 1, 0});
  CHECK(s.data.stereo == std::vector<std::uint8_t>{1, 0, 1});
  CHECK(s.data.pixel[0].z == -5);
  CHECK(s.data.information[2] == 0.25);
  CHECK(s.data.camera.empty());
  CHECK(s.points_true[0].z == 3.5);
  CHECK(s.T_cw_true.size() == 2);
  std::filesystem::remove(folder / "Tcw_true.npy");
  CHECK(turbomap::read_synthetic_lba(folder.path()).points_true.empty());
}

TEST_CASE("what is broken is named with its array and row") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  using ints = std::vector<std::int32_t>;
  using bytes = std::vector<std::uint8_t>;
  using doubles = std::vector<double>;
  using points = std::vector<point>;
  using poses = std::vector<pose>;
  CHECK(has(with<std::int32_t>("e_kf.npy", [](ints& v) { v[1] = 2; }), "array e_kf: row 1 is 2, outside [0, 2)"));
  CHECK(has(with<std::int32_t>("e_pt.npy", [](ints& v) { v[0] = -1; }), "array e_pt: row 0 is -1"));
  CHECK(has(with<std::int32_t>("e_pt.npy", [](ints& v) { v.pop_back(); }), "array e_pt: has 2 rows, not 3"));
  CHECK(has(with<std::uint8_t>("kf_fixed.npy", [](bytes& v) { v[0] = 2; }), "array kf_fixed: row 0"));
  CHECK(has(with<std::uint8_t>("kf_fixed.npy", [](bytes& v) { v.push_back(0); }), "array kf_fixed: has 3 rows, not 2"));
  CHECK(has(with<std::uint8_t>("e_type.npy", [](bytes& v) { v[0] = 3; }), "array e_type: row 0 is 3"));
  CHECK(
      has(with<point>("e_obs.npy", [&](points& v) { v[1].x = nan; }), "array e_obs: row 1 holds a number that is not"));
  CHECK(has(with<double>("e_invsigma2.npy", [](doubles& v) { v[1] = 0; }), "array e_invsigma2: row 1 is not positive"));
  CHECK(has(with<point>("pt.npy", [&](points& v) { v[1].y = nan; }), "array pt: row 1"));
  CHECK(has(with<point>("pt_true.npy", [](points& v) { v.pop_back(); }), "array pt_true: has 1 rows, not 2"));
  CHECK(has(with<pose>("Tcw.npy", [](poses& v) { v[1].qw = 0.7; }), "array Tcw: row 1 does not begin with a unit"));
  CHECK(has(with<pose>("Tcw_true.npy", [](poses& v) { v[0].qw = 0; }), "array Tcw_true: row 0"));
  const temporary_directory empty;
  CHECK(has(bad_file_message([&] { turbomap::read_synthetic_lba(empty.path()); }), "array Tcw: cannot be opened"));
}

TEST_CASE("the shared problems cost what their peers say") {
  cost_camera camera;
  camera.fx = camera.fy = 435.2, camera.cx = 367.4, camera.cy = 252.2, camera.bf = 47.9;
  const std::pair<const char*, double> problems[] = {
      {"30-20-6000", 911016.53}, {"10-40-2500", 396436.37}, {"50-50-10000", 1948657.35}};
  for (const auto& [name, cost] : problems) {
    const auto folder = data(std::string("synthetic-lba/") + name);
    if (!folder) return;
    const auto s = turbomap::read_synthetic_lba(*folder);
    CHECK(std::abs(robust_cost(s.data, {camera}) - cost) < 0.005);
    CHECK(s.points_true.size() == s.data.points.size());
  }
}

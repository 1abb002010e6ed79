// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The recorded preintegrations of an iteration: what is read, and what is refused by name.

#include <turbomap/io/recording_writer.hpp>
#include "readers/recording_snapshot_preintegration.hpp"

#include <array>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "support/files.hpp"

using namespace turbomap_test;

namespace {

using ints = std::vector<std::int32_t>;
using bytes = std::vector<std::uint8_t>;
using floats = std::vector<float>;

turbomap::recording small_recording() {
  turbomap::recording_meta m;
  m.width = 640, m.height = 480, m.camera1 = {435, 435, 320, 240};
  m.scale_factors = m.level_sigma2 = m.inv_level_sigma2 = floats(8, 1);
  m.bounds = {0, 0, 640, 480}, m.cell_width_inverse = m.cell_height_inverse = 0.1F;
  turbomap::recorder record(m);
  for (std::int32_t i = 0; i < 3; ++i) {
    turbomap::keyframe_record k;
    k.t_ns = i, k.previous = i - 1;
    record.add(k);
  }
  return record.data();
}

/// Keyframes 2 and 1 are optimised, 0 is fixed; 2 has a preintegration from 1.
struct folder_of_arrays {
  folder_of_arrays() : where(turbomap::snapshot_directory(folder.path(), 2)) {
    std::filesystem::create_directories(where);
    put("lba_kf", ints{2, 1, 0});
    put("lba_imu_has", bytes{1, 0});
    put("lba_imu_prev", ints{1, -1});
    put("lba_imu_dT", floats{0.5F, 0});
    put("lba_imu_dV", std::vector<turbomap::vec3<float>>{{1, 2, 3}, {}});
    put("lba_imu_dP", std::vector<turbomap::vec3<float>>{{4, 5, 6}, {}});
    put("lba_imu_bias_orig", std::vector<std::array<float, 6>>{{1, 2, 3, 4, 5, 6}, {}});
    for (const char* name : {"dR", "JRg", "JVg", "JVa", "JPg", "JPa"}) {
      floats values(18, 0);
      values[1] = static_cast<float>(std::string(name).size()) + (name[2] == 'a' ? 0.5F : 0);
      shape(std::string("lba_imu_") + name, values, {2, 3, 3});
    }
    floats C(450, 0);
    C[16] = 9;
    shape("lba_imu_C", C, {2, 15, 15});
  }
  template <class Row>
  void put(const std::string& name, const std::vector<Row>& rows) const {
    turbomap::write_npy_rows(where / (name + ".npy"), rows);
  }
  void shape(const std::string& name, const floats& values, const std::vector<std::size_t>& size) const {
    turbomap::write_npy<float>(where / (name + ".npy"), values, size);
  }
  std::vector<turbomap::recorded_preintegration> read() const {
    return turbomap::read_preintegration_snapshot(small_recording(), folder.path(), 2);
  }
  std::string message() const {
    return bad_file_message([&] { read(); });
  }
  temporary_directory folder;
  std::filesystem::path where;
};
std::string with(const std::function<void(const folder_of_arrays&)>& damage) {
  const folder_of_arrays f;
  damage(f);
  return f.message();
}

TEST_CASE("recorded preintegrations are read") {
  const folder_of_arrays f;
  const auto p = f.read();
  REQUIRE(p.size() == 1);
  CHECK(p[0].from == 1);
  CHECK(p[0].to == 2);
  CHECK(p[0].dT == 0.5F);
  CHECK(p[0].dV.y == 2);
  CHECK(p[0].dP.z == 6);
  CHECK(p[0].dR(0, 1) == 2);
  CHECK(p[0].J_Rg(0, 1) == 3);
  CHECK(p[0].J_Pa(0, 1) == 3.5F);
  CHECK(p[0].C[16] == 9);
  CHECK(p[0].bias[5] == 6);
}

TEST_CASE("an iteration without them has none") {
  const temporary_directory folder;
  CHECK(turbomap::read_preintegration_snapshot(small_recording(), folder.path(), 2).empty());
}

TEST_CASE("what is broken is named with its array") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  using arrays = folder_of_arrays;
  CHECK(has(with([](const arrays& f) { std::filesystem::remove(f.where / "lba_imu_has.npy"); }),
            "lba_imu_has: is missing"));
  CHECK(has(with([](const arrays& f) { f.put("lba_imu_has", bytes{2, 0}); }), "lba_imu_has: row 0 is 2"));
  CHECK(has(with([](const arrays& f) { f.put("lba_kf", ints{3}); }), "lba_kf: row 0 is 3"));
  CHECK(has(with([](const arrays& f) { f.put("lba_kf", ints{2}); }), "lba_imu_has: has more rows"));
  CHECK(has(with([](const arrays& f) { f.put("lba_imu_prev", ints{3, 0}); }), "lba_imu_prev: row 0 is no row"));
  CHECK(has(with([](const arrays& f) { f.put("lba_imu_prev", ints{0, 0}); }), "lba_imu_prev: row 0 is not an earlier"));
  CHECK(has(with([](const arrays& f) { f.put("lba_imu_dT", floats{1}); }), "lba_imu_dT: has 1 rows"));
  CHECK(has(with([&](const arrays& f) { f.put("lba_imu_dT", floats{nan, 0}); }), "lba_imu_dT: row 0 holds"));
  CHECK(has(with([](const arrays& f) { f.shape("lba_imu_JVa", floats(9, 0), {1, 3, 3}); }), "lba_imu_JVa: has shape"));
  CHECK(has(with([&](const arrays& f) { f.shape("lba_imu_C", floats(450, nan), {2, 15, 15}); }), "lba_imu_C"));
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The recorded local bundle adjustment of an iteration: what is read, and every kind of damage by name.

#include <turbomap/io/recording_writer.hpp>
#include "readers/recording_snapshot_adjustment.hpp"

#include <array>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "snapshot_samples.hpp"
#include "support/files.hpp"

using namespace turbomap_test;

namespace {

using turbomap::recorded_residual;
using pose = turbomap::rigid_transform<float>;
using point = turbomap::vec3<float>;
using ints = std::vector<std::int32_t>;
using bytes = std::vector<std::uint8_t>;
using floats = std::vector<float>;
using doubles = std::vector<double>;

const std::string meta = turbomap_test::adjustment_meta;

/// Three keyframes of four keypoints.
turbomap::recording small_recording(bool second_camera) {
  turbomap::recording_meta m;
  m.width = 640, m.height = 480, m.camera1 = {435, 435, 320, 240};
  if (second_camera) m.model = "KannalaBrandt8", m.camera1 = {190, 190, 255, 256, 0, 0, 0, 0}, m.camera2 = m.camera1;
  m.scale_factors = m.level_sigma2 = m.inv_level_sigma2 = floats(8, 1);
  m.bounds = {0, 0, 640, 480}, m.cell_width_inverse = m.cell_height_inverse = 0.1F;
  turbomap::recorder record(m);
  for (std::int32_t i = 0; i < 3; ++i) {
    const std::vector<turbomap::keypoint> keypoints(4);
    const std::vector<turbomap::descriptor_bytes> descriptors(4);
    turbomap::keyframe_record k;
    k.t_ns = i, k.previous = i - 1;
    k.keypoints = keypoints, k.descriptors = descriptors;
    record.add(k);
  }
  return record.data();
}

/// Writes an adjustment, changes it, and reads it.
std::optional<turbomap::adjustment_snapshot> read(
    bool second_camera = false,
    const std::function<void(const std::filesystem::path&)>& damage = [](const std::filesystem::path&) {}) {
  const temporary_directory folder;
  const auto where = turbomap::snapshot_directory(folder.path(), 2);
  turbomap_test::write_adjustment(where, second_camera);
  damage(where);
  return turbomap::read_adjustment_snapshot(small_recording(second_camera), folder.path(), 2);
}
std::string message(const std::function<void(const std::filesystem::path&)>& damage) {
  return bad_file_message([&] { read(false, damage); });
}
template <class Row>
std::string with(const char* name, const std::function<void(std::vector<Row>&)>& damage) {
  return message([&](const std::filesystem::path& folder) {
    const auto file = folder / (std::string(name) + ".npy");
    auto rows = turbomap::read_npy_rows<Row>(file);
    damage(rows);
    turbomap::write_npy_rows(file, rows);
  });
}
std::string with_meta(const std::string& part, const std::string& by) {
  std::string text = meta;
  const auto at = text.find(part);
  REQUIRE(at != std::string::npos);
  text.replace(at, part.size(), by);
  return message([&](const std::filesystem::path& folder) { write_bytes(folder / "meta.json", text); });
}

TEST_CASE("a recorded adjustment is read") {
  const auto s = read();
  REQUIRE(s.has_value());
  CHECK_FALSE(s->inertial);
  CHECK(s->iterations == 7);
  CHECK(s->initial_lambda == 100);
  CHECK(s->robust_cost_before == 12.5);
  CHECK(s->robust_cost_after == 11.25);
  CHECK(s->optimised == 2);
  CHECK(s->keyframe == ints{2, 0, 1});
  CHECK(s->T_cw_after[0].tx == 1.5F);
  CHECK(s->pose_after[0][9] == 1.5);
  CHECK(s->point == ints{70, 30});
  CHECK(s->position_after_exact[0].z == 3.5);
  CHECK(s->kind[1] == recorded_residual::stereo);
  CHECK(s->chi2_after[2] == 9);
  CHECK(s->outlier == bytes{0, 0, 1});
}

TEST_CASE("its problem is that of before") {
  const auto s = read(true);
  REQUIRE(s.has_value());
  const auto d = turbomap::problem_of(*s);
  CHECK(d.T_cw[0].tx == 1);
  CHECK(d.fixed == bytes{0, 1, 1});
  CHECK(d.points[0].z == 3);
  CHECK(d.frame == ints{0, 1, 2});
  CHECK(d.landmark == ints{0, 0, 1});
  CHECK(d.camera == bytes{0, 0, 1});
  CHECK(d.stereo == bytes{0, 1, 0});
  CHECK(d.pixel[1].z == 15);
  CHECK(d.pixel[2].y == 31);
  CHECK(d.information[2] == 0.25);
}

TEST_CASE("an iteration without adjustment has none") {
  const auto s = read(false, [](const std::filesystem::path& folder) {
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    write_bytes(folder / "meta.json", "{}");
  });
  CHECK_FALSE(s.has_value());
}

TEST_CASE("what is broken is named with its array and row") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const double dnan = nan;
  CHECK(has(with<std::int32_t>("lba_kf", [](ints& v) { v[1] = 3; }), "array lba_kf: row 1 is 3, outside [0, 3)"));
  CHECK(has(with<std::uint8_t>("lba_kf_fixed", [](bytes& v) { v[2] = 0; }), "array lba_kf_fixed: row 2 is 0"));
  CHECK(has(with<std::uint8_t>("lba_kf_fixed", [](bytes& v) { v[0] = 2; }), "array lba_kf_fixed: row 0 is 2"));
  CHECK(has(with<std::uint8_t>("lba_kf_fixed", [](bytes& v) { v.pop_back(); }), "array lba_kf_fixed: has 2 rows"));
  CHECK(has(with<pose>("lba_Tcw_before", [&](auto& v) { v[2].ty = nan; }), "array lba_Tcw_before: row 2 holds"));
  CHECK(has(with<pose>("lba_Tcw_before", [](auto& v) { v[0].qw = 2; }),
            "array lba_Tcw_before: row 0 has no unit quaternion"));
  CHECK(has(with<pose>("lba_Tcw_after", [](auto& v) { v[1].qw = 2; }),
            "array lba_Tcw_after: row 1 has no unit quaternion"));
  CHECK(has(with<pose>("lba_Tcw_after", [&](auto& v) { v[1].tz = nan; }), "array lba_Tcw_after: row 1 holds"));
  CHECK(has(with<point>("lba_pt_after", [&](auto& v) { v[1].z = nan; }), "array lba_pt_after: row 1 holds"));
  CHECK(
      has(with<std::array<double, 12>>("lba_pose_after_d", [](auto& v) { v.pop_back(); }), "lba_pose_after_d: has 1"));
  CHECK(has(with<std::array<double, 12>>("lba_pose_after_d", [&](auto& v) { v[0][11] = dnan; }), "row 0 holds"));
  CHECK(has(with<point>("lba_pt_before", [&](auto& v) { v[0].x = nan; }), "array lba_pt_before: row 0 holds"));
  CHECK(has(with<point>("lba_pt_after", [](auto& v) { v.pop_back(); }), "array lba_pt_after: has 1 rows, not 2"));
  CHECK(has(with<turbomap::vec3<double>>("lba_pt_after_d", [&](auto& v) { v[1].y = dnan; }), "lba_pt_after_d: row 1"));
  CHECK(has(with<std::int32_t>("lba_e_kf", [](ints& v) { v[0] = -1; }), "array lba_e_kf: row 0 is -1"));
  CHECK(has(with<std::int32_t>("lba_e_pt", [](ints& v) { v[2] = 2; }), "array lba_e_pt: row 2 is 2"));
  CHECK(has(with<std::int32_t>("lba_e_kp", [](ints& v) { v[0] = 4; }),
            "array lba_e_kp: row 0 is 4, but keyframe 2 has 4"));
  CHECK(has(with<std::uint8_t>("lba_e_type", [](bytes& v) { v[0] = 3; }), "array lba_e_type: row 0 is 3, not 0 to 2"));
  CHECK(has(with<std::uint8_t>("lba_e_type", [](bytes& v) { v[0] = 2; }), "row 0 is 2, but there is no second camera"));
  CHECK(has(with<point>("lba_e_obs", [&](auto& v) { v[1].z = nan; }), "array lba_e_obs: row 1 holds"));
  CHECK(
      has(with<float>("lba_e_invsigma2", [](floats& v) { v[1] = 0; }), "array lba_e_invsigma2: row 1 is not positive"));
  CHECK(has(with<float>("lba_e_invsigma2", [&](floats& v) { v[2] = std::numeric_limits<float>::infinity(); }),
            "row 2 holds"));
  CHECK(
      has(with<double>("lba_e_chi2_before", [&](doubles& v) { v[2] = dnan; }), "array lba_e_chi2_before: row 2 holds"));
  CHECK(has(with<double>("lba_e_chi2_after", [&](doubles& v) { v[1] = dnan; }), "array lba_e_chi2_after: row 1"));
  CHECK(
      has(with<double>("lba_e_chi2_before", [](doubles& v) { v.pop_back(); }), "array lba_e_chi2_before: has 2 rows"));
  CHECK(has(with<std::uint8_t>("lba_e_outlier", [](bytes& v) { v[0] = 2; }), "array lba_e_outlier: row 0 is 2"));
  CHECK(has(with<std::uint8_t>("lba_e_depthpos", [](bytes& v) { v[0] = 9; }), "array lba_e_depthpos: row 0 is 9"));
  CHECK(has(with_meta("\"n_opt\": 2", "\"n_opt\": 4"), "key 'lba': has an n_opt above the size of lba_kf"));
  CHECK(has(with_meta("\"n_opt\": 2", "\"n_opt\": \"2\""), "key 'lba.n_opt': has the wrong type"));
  CHECK(has(with_meta("\"iterations\": 7, ", ""), "key 'lba.iterations': is missing"));
  CHECK(has(with_meta("\"iterations\": 7", "\"iterations\": 1e10"), "key 'lba.iterations': has the wrong type"));
  CHECK(has(with_meta("\"lba\"", "\"other\""), "key 'lba': is missing, but lba_kf is there"));
  const auto remove = [](const char* name) {
    return message([&](const std::filesystem::path& folder) { std::filesystem::remove(folder / name); });
  };
  CHECK(has(remove("lba_kf.npy"), "key 'lba': is there, but lba_kf is missing"));
  CHECK(has(remove("lba_e_obs.npy"), "array lba_e_obs: cannot be opened"));
}

}  // namespace

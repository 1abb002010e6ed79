// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Recordings: writing and reading gives the same recording; every kind of damage is refused with the array's name.

#include <turbomap/io/recording.hpp>
#include <turbomap/io/recording_writer.hpp>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "scenes/recording_samples.hpp"
#include "support/files.hpp"

using turbomap_test::bad_file_message;
using turbomap_test::has;
using turbomap_test::refused;
using turbomap_test::small_meta;
using turbomap_test::small_recording;

namespace {

std::vector<std::string> bytes_of(const turbomap::recording& r) {
  std::vector<std::string> all;
  turbomap::visit_arrays(r, [&](const char*, const auto& rows, turbomap::recording_rows, turbomap::presence) {
    all.emplace_back(reinterpret_cast<const char*>(rows.data()), rows.size() * sizeof(*rows.data()));
  });
  return all;
}

/// Changes a file of a good recording on disk and returns what reading it says.
std::string after(const std::function<void(const std::filesystem::path&)>& damage, bool fisheye = false) {
  const turbomap_test::temporary_directory folder;
  turbomap::write_recording(folder.path(), small_recording(fisheye));
  damage(folder.path());
  return bad_file_message([&] { turbomap::read_recording(folder.path()); });
}

template <class Row>
std::string with(const char* name, const std::function<void(std::vector<Row>&)>& damage, bool fisheye = false) {
  return after(
      [&](const std::filesystem::path& folder) {
        const auto file = folder / (std::string(name) + ".npy");
        auto rows = turbomap::read_npy_rows<Row>(file);
        damage(rows);
        turbomap::write_npy_rows(file, rows);
      },
      fisheye);
}

using i4 = std::int32_t;
using i8 = std::int64_t;
using u1 = std::uint8_t;
using reference = turbomap::keypoint_reference;
using pose = turbomap::rigid_transform<float>;

}  // namespace

TEST_CASE("a recording is read back as written") {
  for (const bool fisheye : {false, true}) {
    const turbomap_test::temporary_directory folder;
    const turbomap::recording r = small_recording(fisheye);
    turbomap::write_recording(folder / "a", r);
    const turbomap::recording again = turbomap::read_recording(folder / "a");
    CHECK(bytes_of(again) == bytes_of(r));
    turbomap::write_recording(folder / "b", again);
    CHECK(turbomap_test::file_bytes(folder / "a/meta.json") == turbomap_test::file_bytes(folder / "b/meta.json"));
    CHECK(again.meta.camera1 == r.meta.camera1);
    CHECK(again.meta.camera2 == r.meta.camera2);
    CHECK(again.meta.T_lr.tx == r.meta.T_lr.tx);
    CHECK(again.meta.scale_factors == r.meta.scale_factors);
    CHECK(again.meta.close_depth == 6.6);
    CHECK(again.meta.imu_walk_variance == r.meta.imu_walk_variance);
    REQUIRE(again.meta.events.size() == 1);
    CHECK(again.meta.events[0].name == "InitializeIMU");
    CHECK(again.meta.events[0].scale == 1.02);
    CHECK(again.meta.ate_kf_rmse_m == 0.03125);
    CHECK(again.meta.noise_px == 0.75);
    CHECK(again.meta.disparity_noise_px == -1);
    CHECK(again.nleft == std::vector<i4>(3, fisheye ? 3 : -1));
    CHECK(again.has_imu());
    CHECK(again.has_velocity());
    CHECK_FALSE(again.is_simulated());
  }
}

TEST_CASE("rows of a keyframe") {
  const turbomap::recording r = small_recording(true);
  CHECK(r.keypoints(1).begin == 5);
  CHECK(r.associations(0).size() == 1);
  CHECK(r.associations(2).size() == 2);
  CHECK(r.recent(2).size() == 2);
  CHECK(turbomap::slice(r.assoc_kp, r.associations(2))[1] == 2);
  const auto keypoints = r.gather_keypoints(1);
  REQUIRE(keypoints.size() == 5);
  CHECK(keypoints[2].camera == 0);
  CHECK(keypoints[3].camera == 1);
  CHECK(keypoints[2].y == 21);
  CHECK(keypoints[4].group == turbomap::keypoint::no_group);
  CHECK(r.descriptors(2)[3][31] == 35);
}

TEST_CASE("optional arrays may be missing, but not half of them") {
  CHECK(after([](const auto& folder) {
          for (const char* name : {"log_vel", "log_bias", "log_bimu", "gt_t_ns", "gt_Twb", "final_Tcw", "final_alive"})
            std::filesystem::remove(folder / (std::string(name) + ".npy"));
        }) == "nothing thrown");
  refused(after([](const auto& folder) { std::filesystem::remove(folder / "log_bias.npy"); }), "log_bias",
          "is missing");
  refused(after([](const auto& folder) { std::filesystem::remove(folder / "imu_t_ns.npy"); }), "imu_gyro_acc", "not 0");
  refused(after([](const auto& folder) { std::filesystem::remove(folder / "log_kp_xy.npy"); }), "log_kp_xy",
          "cannot be opened");
}

TEST_CASE("damaged recordings are refused by array and reason") {
  refused(after([](const auto& folder) { std::filesystem::resize_file(folder / "log_kp_desc.npy", 600); }),
          "log_kp_desc", "bytes of data");
  refused(after([](const auto& folder) { std::filesystem::resize_file(folder / "log_Tcw.npy", 40); }), "log_Tcw",
          "truncated");
  refused(with<float>("log_kp_angle", [](auto& rows) { rows.pop_back(); }), "log_kp_angle", "has 14 rows, not 15");
  refused(with<i8>("log_t_ns", [](auto& rows) { rows.clear(); }), "log_t_ns", "is empty");
  refused(with<i8>("log_kp_off", [](auto& rows) { rows[0] = 1; }), "log_kp_off", "begin with 0");
  refused(with<i8>("log_kp_off", [](auto& rows) { rows[1] = 11; }), "log_kp_off", "row 2 is 10, less than");
  refused(with<i8>("log_kp_off", [](auto& rows) { rows[3] = 16; }), "log_kp_off", "ends at 16, but there are 15");
  refused(with<i8>("log_assoc_off", [](auto& rows) { rows[3] = 4; }), "log_assoc_off", "ends at 4");
  refused(with<i8>("log_recent_off", [](auto& rows) { rows[1] = -1; }), "log_recent_off", "less than");
  refused(with<i4>("log_assoc_kp", [](auto& rows) { rows[2] = 5; }), "log_assoc_kp",
          "row 2 is 5, but keyframe 1 has 5");
  refused(with<i4>("log_assoc_kp", [](auto& rows) { rows[0] = -1; }), "log_assoc_kp", "row 0 is -1");
  refused(with<reference>("log_assoc_ref",
                          [](auto& rows) {
                            rows[2] = {0, 5};
                          }),
          "log_assoc_ref", "keypoint 5 of keyframe 0");
  refused(with<reference>("log_assoc_ref2",
                          [](auto& rows) {
                            rows[2] = {2, 0};
                          }),
          "log_assoc_ref2", "keyframe 2, from keyframe 1");
  refused(with<reference>("log_assoc_ref", [](auto& rows) { rows[0] = {-1, 0}; }), "log_assoc_ref", "keyframe -1");
  refused(with<reference>("log_recent_ref", [](auto& rows) { rows[0] = {9, 0}; }), "log_recent_ref", "keyframe 9");
  refused(with<u1>("log_assoc_new", [](auto& rows) { rows[0] = 2; }), "log_assoc_new", "neither 0 nor 1");
  refused(with<reference>("log_assoc_ref", [](auto& rows) { rows[1] = {0, 0}; }), "log_assoc_ref", "own keyframe");
  refused(with<u1>("log_kp_octave", [](auto& rows) { rows[7] = 8; }), "log_kp_octave", "row 7 is 8, outside [0, 8)");
  refused(with<float>("log_kp_depth", [](auto& rows) { rows[3] = std::nanf(""); }), "log_kp_depth",
          "row 3 holds a number that is not");
  refused(
      with<turbomap::vec2<float>>("log_kp_xy", [](auto& rows) { rows[6].y = std::numeric_limits<float>::infinity(); }),
      "log_kp_xy", "row 6");
  refused(with<pose>("log_Tcw", [](auto& rows) { rows[1].qw = 0; }), "log_Tcw", "row 1 does not begin with a unit");
  refused(with<pose>("frame_Tcw", [](auto& rows) { rows[1].tx = std::nanf(""); }), "frame_Tcw", "row 1");
  refused(with<turbomap::imu_sample>("imu_gyro_acc", [](auto& rows) { rows[2].gyro.x = NAN; }), "imu_gyro_acc",
          "row 2");
  refused(with<i8>("imu_t_ns", [](auto& rows) { rows[2] = 0; }), "imu_t_ns", "row 2 is earlier");
  refused(with<i4>("log_prev_kf", [](auto& rows) { rows[1] = 1; }), "log_prev_kf", "row 1");
  refused(with<i4>(
              "log_nleft", [](auto& rows) { rows[1] = 6; }, true),
          "log_nleft", "row 1 is 6");
  refused(with<i4>("log_nleft", [](auto& rows) { rows[1] = 2; }), "log_nleft", "no second camera");
  refused(with<i4>(
              "log_kp_lrmatch", [](auto& rows) { rows[8] = 5; }, true),
          "log_kp_lrmatch", "row 8 is 5");
}

TEST_CASE("a damaged meta.json is refused by key and reason") {
  const auto meta = [](const std::string& from, const std::string& to) {
    return after([&](const std::filesystem::path& folder) {
      std::string text = turbomap_test::file_bytes(folder / "meta.json");
      REQUIRE(has(text, from));
      text.replace(text.find(from), from.size(), to);
      turbomap_test::write_bytes(folder / "meta.json", text);
    });
  };
  CHECK(has(meta("\"bf\"", "\"bg\""), "meta.json: key 'bf': is missing"));
  CHECK(has(meta("\"Pinhole\"", "\"Omni\""), "key 'model': is 'Omni'"));
  CHECK(has(meta("\"n_levels\": 8", "\"n_levels\": 7"), "key 'scale_factors'"));
  CHECK(has(meta("\"n_levels\": 8", "\"n_levels\": \"8\""), "key 'n_levels': has the wrong type"));
  CHECK(has(meta("435.204681,", ""), "key 'camera1': needs 4"));
  CHECK(has(meta("\"mnMaxX\": 640", "\"mnMaxX\": -1"), "key 'mnMaxX'"));
  CHECK(has(meta("{", "["), "is not a JSON object"));
  CHECK(has(after([](const auto& folder) { std::filesystem::remove(folder / "meta.json"); }),
            "meta.json: cannot be opened"));
  CHECK(
      has(bad_file_message([] { turbomap::read_recording("no such folder"); }), "no such folder: is not a directory"));
}

TEST_CASE("nothing is written of a recording that is not one") {
  const turbomap_test::temporary_directory folder;
  turbomap::recording r = small_recording();
  r.assoc_kp[0] = 77;
  CHECK(has(bad_file_message([&] { turbomap::write_recording(folder / "new", r); }), "log_assoc_kp"));
  CHECK_FALSE(std::filesystem::exists(folder / "new"));
}

TEST_CASE("the recorder refuses a keyframe whole") {
  turbomap::recorder record(small_meta(false));
  std::vector<turbomap::keypoint> keypoints(2);
  std::vector<turbomap::descriptor_bytes> descriptors(1);
  turbomap::keyframe_record k;
  k.keypoints = keypoints, k.descriptors = descriptors;
  CHECK_THROWS_AS(record.add(k), std::invalid_argument);
  descriptors.resize(2), k.descriptors = descriptors;
  const std::vector<turbomap::point_association> wrong{{2, {}, {}, {}, false}};
  k.associations = wrong;
  CHECK_THROWS_AS(record.add(k), std::invalid_argument);
  k.associations = {};
  keypoints[1].camera = 1;
  CHECK_THROWS_AS(record.add(k), std::invalid_argument);
  CHECK(record.data().keyframe_count() == 0);
  CHECK(record.data().kp_xy.empty());
  keypoints[1].camera = 0;
  CHECK(record.add(k) == 0);
  CHECK(record.data().kp_xy.size() == 2);
}

TEST_CASE("tables of times") {
  const turbomap_test::temporary_directory folder;
  CHECK(turbomap::read_timing(folder.path()).empty());
  turbomap_test::write_bytes(folder / "timing.csv", "iter,ms_sft,snapshot\n10,100,0\n11,1,0\n12,50,1\n13,3,0\n");
  const auto table = turbomap::read_timing(folder.path());
  CHECK(table.row_count() == 4);
  CHECK(table.mean("ms_sft") == 2);
  CHECK_THROWS_AS(table.column("ms_fuse"), std::invalid_argument);
  turbomap_test::write_bytes(folder / "timing_quiet.csv", "iter,ms_sft,snapshot\r\n11,7,0\r\n");
  CHECK(turbomap::read_timing(folder.path()).mean("ms_sft") == 7);
  const auto error = [&](const char* text) {
    turbomap_test::write_bytes(folder / "timing.csv", text);
    return bad_file_message([&] { turbomap::read_timing_table(folder / "timing.csv"); });
  };
  CHECK(has(error("iter,a\n1,x\n"), "line 2: 'x' is not a number"));
  CHECK(has(error("iter,a\n1\n"), "line 2: has fewer"));
  CHECK(has(error("iter,a\n1,2,3\n"), "line 2: has more"));
  CHECK(has(error(""), "has no header"));
}

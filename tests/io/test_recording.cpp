// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Recordings: writing and reading gives the same recording; every kind of damage is refused with the array's name.

#include <turbomap/io/recording.hpp>
#include <turbomap/io/recording_writer.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <ctime>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "scenes/recording_samples.hpp"
#include "support/files.hpp"
#include "support/refused.hpp"

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
    CHECK(again.meta.keypoint_pixels == "multiplied");
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
  refused(with<pose>("log_Tcw", [](auto& rows) { rows[1].qw = 0; }), "log_Tcw", "row 1 has no unit quaternion");
  refused(with<pose>("frame_Tcw", [](auto& rows) { rows[1].tx = std::nanf(""); }), "frame_Tcw", "row 1");
  refused(with<turbomap::imu_sample>("imu_gyro_acc", [](auto& rows) { rows[2].gyro.x = NAN; }), "imu_gyro_acc",
          "row 2");
  refused(with<i8>("imu_t_ns", [](auto& rows) { rows[2] = 0; }), "imu_t_ns", "row 2 is earlier");
  refused(with<i4>("log_prev_kf", [](auto& rows) { rows[1] = 1; }), "log_prev_kf", "row 1");
  refused(with<i8>("frame_t_ns", [](auto& rows) { rows[2] = -5; }), "frame_t_ns", "row 2 is earlier");
  refused(with<turbomap::stamped_body_pose>("gt_Twb", [](auto& rows) { rows[1].qw = 0; }), "gt_Twb",
          "row 1 has no unit quaternion");
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
  for (const char* width : {"true", "640.9", "640.0", "\"640\"", "[640]", "1e3"})
    CHECK(has(meta("\"width\": 640", std::string("\"width\": ") + width), "key 'width': has the wrong type"));
  for (const char* width : {"4294967936", "-4294966656", "18446744073709551615"})
    CHECK(has(meta("\"width\": 640", std::string("\"width\": ") + width), "key 'width': is out of range"));
  CHECK(has(meta("\"width\": 640", "\"width\": 0"), "key 'width': is not positive"));
  CHECK(has(meta("\"width\": 640", "\"width\": 1e300"), "key 'width': has the wrong type"));
  CHECK(has(meta("\"snapshots\": [\n  1\n ]", "\"snapshots\": [4294967297]"), "key 'snapshots': is out of range"));
  CHECK(has(meta("\"n_levels\": 8", "\"n_levels\": 8.7"), "key 'n_levels': has the wrong type"));
  CHECK(has(meta("\"mnMaxX\": 640.0", "\"mnMaxX\": 1e300"), "key 'mnMaxX': is out of range"));
  CHECK(has(meta("\"scale_factor\": 1.2", "\"scale_factor\": 1e39, \"x\": 1.2"), "key 'scale_factor': is out of"));
  CHECK(has(meta("435.204681", "-435.2"), "key 'camera1': has a focal length that is not"));
  CHECK(has(meta("435.204681", "null"), "key 'camera1': has the wrong type"));
  CHECK(has(meta("\"bf\": 47.9", "\"bf\": -1e9"), "key 'bf': is negative"));
  CHECK(has(meta("\"level_sigma2\": [\n  1.0", "\"level_sigma2\": [0"), "key 'level_sigma2': is not positive"));
  CHECK(has(meta("\"Tlr\": [\n  0.0", "\"Tlr\": [7"), "key 'Tlr': does not begin with a unit quaternion"));
  CHECK(has(meta("\"grid_cols\": 64", "\"grid_cols\": 2147483647"), "key 'grid_cols': is above"));
  CHECK(has(meta("\"iter\": 1", "\"iter\": 1.5"), "key 'events.iter': has the wrong type"));
  CHECK(has(meta("\"iter\": 1,", ""), "key 'events.iter': is missing"));
  CHECK(has(after([](const auto& folder) {
              std::filesystem::remove(folder / "meta.json");
              std::filesystem::create_directory(folder / "meta.json");
            }),
            "meta.json: cannot be opened"));
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

TEST_CASE("a meta.json that could not be read is not written, and the old recording stays") {
  const turbomap_test::temporary_directory folder;
  turbomap::write_recording(folder.path(), small_recording());
  const std::string before = turbomap_test::file_bytes(folder / "meta.json");
  const auto refused = [&](const std::function<void(turbomap::recording_meta&)>& change, const std::string& reason) {
    turbomap::recording r = small_recording();
    change(r.meta), r.T_cw[0].tx = 42;
    const std::string message = bad_file_message([&] { turbomap::write_recording(folder.path(), r); });
    CAPTURE(message);
    CHECK(has(message, reason));
    CHECK(turbomap_test::file_bytes(folder / "meta.json") == before);
    CHECK(turbomap::read_recording(folder.path()).T_cw[0].tx == 0);
    CHECK_THROWS_AS(turbomap::write_recording_meta(folder / "other.json", r.meta), turbomap::bad_file);
    CHECK_FALSE(std::filesystem::exists(folder / "other.json"));
  };
  refused([](auto& m) { m.sensor = "mono"; }, "key 'sensor': is 'mono', not stereo, inertial or monocular");
  refused([](auto& m) { m = turbomap::recording_meta(); }, "key 'width': is not positive");
  refused([](auto& m) { m.scale_factor = 0.5F; }, "key 'scale_factor': is not above 1");
  refused([](auto& m) { m.scale_factor = INFINITY; }, "key 'scale_factor': is not finite");
  refused([](auto& m) { m.camera1[2] = NAN; }, "key 'camera1': is not finite");
  refused([](auto& m) { m.close_depth = NAN; }, "key 'thDepth': is not finite");
  refused([](auto& m) { m.T_bc.qw = 2; }, "key 'Tbc': does not begin");
  refused([](auto& m) { m.imu_noise_variance.pop_back(); }, "key 'imu_noise_cov_diag': needs 6");
  refused([](auto& m) { m.noise_px = -2; }, "key 'noise_px': is negative");
  refused([](auto& m) { m.keypoint_pixels = "half"; }, "key 'keypoint_pixels': is 'half'");
  refused([](auto& m) { m.sim3_scale = NAN; }, "key 'sim3_scale': is not finite");
  refused([](auto& m) { m.events[0].name = "\xff\xfe"; }, "a string is not UTF-8");
}

TEST_CASE("meta.json is the same in every locale") {
  const turbomap_test::temporary_directory folder;
  const turbomap::recording r = small_recording();
  turbomap::write_recording_meta(folder / "classic.json", r.meta);
  const turbomap_test::comma_locale comma;
  turbomap::write_recording_meta(folder / "comma.json", r.meta);
  CHECK(turbomap_test::file_bytes(folder / "comma.json") == turbomap_test::file_bytes(folder / "classic.json"));
  CHECK(turbomap::read_recording_meta(folder / "comma.json").camera1 == r.meta.camera1);
}

TEST_CASE("the recorder refuses what could not be read when it is added") {
  CHECK_THROWS_AS(turbomap::recorder(turbomap::recording_meta{}), std::invalid_argument);
  turbomap::recorder record(small_meta(false));
  const std::vector<turbomap::descriptor_bytes> descriptors(2);
  struct keyframe {
    std::vector<turbomap::keypoint> keypoints = std::vector<turbomap::keypoint>(2);
    std::vector<std::int32_t> partner = std::vector<std::int32_t>(2, -1);
    std::vector<turbomap::point_association> associations;
    std::vector<turbomap::recorded_recent_point> recent;
    turbomap::keyframe_record record;
  };
  const auto add = [&](const std::function<void(keyframe&)>& change) {
    keyframe k;
    k.record.t_ns = 5;
    change(k);
    k.record.keypoints = k.keypoints, k.record.descriptors = descriptors, k.record.stereo_partner = k.partner;
    k.record.associations = k.associations, k.record.recent = k.recent;
    try {
      record.add(k.record);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string("nothing thrown");
  };
  CHECK(add([](keyframe&) {}) == "nothing thrown");
  CHECK(add([](keyframe& k) { k.record.previous = 0; }) == "nothing thrown");
  const auto refused = [&](const std::function<void(keyframe&)>& change, const std::string& reason) {
    const std::string message = add(change);
    CAPTURE(message);
    CHECK(has(message, reason));
    CHECK(record.data().keyframe_count() == 2);
    CHECK(record.data().kp_xy.size() == 4);
    CHECK(record.data().kp_off == std::vector<i8>{0, 2, 4});
  };
  refused([](auto& k) { k.record.T_cw.tx = NAN; }, "keyframe 2/log_Tcw.npy: array log_Tcw: row 0 holds a number");
  refused([](auto& k) { k.record.T_cw.qw = 0; }, "array log_Tcw: row 0 has no unit quaternion");
  refused([](auto& k) { k.record.t_ns = 4; }, "t_ns = 4: must not be before");
  refused([](auto& k) { k.keypoints[1].octave = 200; }, "array log_kp_octave: row 1 is 200");
  refused([](auto& k) { k.keypoints[1].x = INFINITY; }, "array log_kp_xy: row 1 holds");
  refused([](auto& k) { k.record.previous = 2; }, "array log_prev_kf: row 0 is 2, not an earlier keyframe");
  refused([](auto& k) { k.partner[1] = 2; }, "array log_kp_lrmatch: row 1 is 2");
  refused([](auto& k) { k.record.velocity.x = NAN; }, "array log_vel: row 0");
  refused([](auto& k) { k.record.bias[3] = NAN; }, "array log_bias: row 0");
  const turbomap::point_association good{0, {1, 1}, {0, 0}, {1, 2, 3}, false};
  const auto association = [&](const std::function<void(turbomap::point_association&)>& change) {
    return [&good, change](keyframe& k) { k.associations = {good, good}, change(k.associations[1]); };
  };
  refused(association([](auto& a) { a.keypoint = 2; }), "array log_assoc_kp: row 1 is 2");
  refused(association([](auto& a) { a.latest = {1, 2}; }), "array log_assoc_ref: row 1 refers to keypoint 2");
  refused(association([](auto& a) { a.latest = {3, 0}; }), "refers to keyframe 3, from keyframe 2");
  refused(association([](auto& a) { a.earliest = {-7, 0}; }), "array log_assoc_ref2: row 1 refers to keyframe -7");
  refused(association([](auto& a) { a.position.z = NAN; }), "array log_assoc_pos: row 1");
  refused(association([](auto& a) { a.is_new = true; }), "does not refer to its own keyframe");
  refused([](auto& k) { k.recent = {{{2, 2}, 0, 1, 1}}; }, "array log_recent_ref: row 0 refers to keypoint 2");
  CHECK(add(association([](auto& a) { a.latest = {2, 1}, a.is_new = true; })) == "nothing thrown");

  const turbomap::imu_sample still{};
  record.add_imu(7, still);
  CHECK_THROWS_AS(record.add_imu(6, still), std::invalid_argument);
  CHECK_THROWS_AS(record.add_imu(8, {{0, NAN, 0}, {}}), std::invalid_argument);
  record.add_ground_truth(7, {0, 0, 0, 1, 0, 0, 0});
  CHECK_THROWS_AS(record.add_ground_truth(6, {0, 0, 0, 1, 0, 0, 0}), std::invalid_argument);
  CHECK_THROWS_AS(record.add_ground_truth(8, {0, 0, 0, 0, 0, 0, 0}), std::invalid_argument);
  CHECK_THROWS_AS(record.add_ground_truth(8, {0, 0, NAN, 1, 0, 0, 0}), std::invalid_argument);
  CHECK(record.data().imu.size() == 1);
  CHECK(record.data().gt_t_ns.size() == 1);
  const turbomap_test::temporary_directory folder;
  record.write(folder.path());
  const auto read = turbomap::read_recording(folder.path());
  CHECK(read.keyframe_count() == 3);
  CHECK(read.associations(2).size() == 2);
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

TEST_CASE("what was recorded is taken, and the next keyframe begins anew") {
  turbomap::recorder record(small_meta(false));
  const std::vector<turbomap::keypoint> keypoints(2);
  const std::vector<turbomap::descriptor_bytes> descriptors(2);
  turbomap::keyframe_record k;
  k.keypoints = keypoints, k.descriptors = descriptors;
  REQUIRE(record.add(k) == 0);
  const turbomap::recording taken = std::move(record.data());
  CHECK(taken.keyframe_count() == 1);
  CHECK(record.add(k) == 0);
  CHECK(record.data().kp_off == taken.kp_off);
  CHECK(record.data().assoc_off == taken.assoc_off);
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
  CHECK(has(error("iter,a\n1,\n"), "line 2: '' is not a number"));
  CHECK(has(error("iter,a,a\n1,2,3\n"), "line 1: has two columns 'a'"));
  CHECK(has(error(""), "has no header"));
  const auto lacks = [&](const char* name, const char* text) {
    turbomap_test::write_bytes(folder / name, text);
    return bad_file_message([&] { turbomap::read_timing(folder.path()); });
  };
  CHECK(has(lacks("timing_quiet.csv", "ms_sft,snapshot\n7,0\n"), "timing_quiet.csv: line 1: has no column 'iter'"));
  std::filesystem::remove(folder / "timing_quiet.csv");
  CHECK(has(lacks("timing.csv", "iter,ms_sft\n11,7\n"), "timing.csv: line 1: has no column 'snapshot'"));
  CHECK(has(bad_file_message([&] { turbomap::read_timing_table(folder.path()); }), "cannot be opened"));
}

TEST_CASE("a table of times is read in linear time") {
  const turbomap_test::temporary_directory folder;
  const auto seconds = [&](int lines) {
    std::string text = "iter\n";
    for (int i = 0; i < lines; ++i) text += "1\n";
    turbomap_test::write_bytes(folder / "one.csv", text);
    double best = 1e9;
    for (int repeat = 0; repeat < 3; ++repeat) {
      const std::clock_t begin = std::clock();  // of this process: the machine has other things to do
      CHECK(turbomap::read_timing_table(folder / "one.csv").row_count() == static_cast<std::size_t>(lines));
      best = std::min(best, double(std::clock() - begin) / CLOCKS_PER_SEC);
    }
    return best;
  };
  // 16 times the lines; quadratic would be 256 times the time.
  const double small = seconds(25000), large = seconds(400000);
  MESSAGE("25,000 lines: " << 1e3 * small << " ms, 400,000: " << 1e3 * large << " ms");
  CHECK(large < 80 * small);
}

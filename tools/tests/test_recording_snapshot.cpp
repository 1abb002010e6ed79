// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Snapshots of a recording: what is written is read; every kind of damage is refused with the array's name.

#include "readers/recording_snapshot.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "snapshot_samples.hpp"
#include "support/files.hpp"
#include "support/refused.hpp"

using turbomap_test::bad_file_message;
using turbomap_test::has;
using turbomap_test::refused;
using turbomap_test::small_recording;

namespace {

using i1 = std::int8_t;
using i4 = std::int32_t;
using i8 = std::int64_t;
using u1 = std::uint8_t;
using pose = turbomap::rigid_transform<float>;
using pair = turbomap::index_pair;
using vec3 = turbomap::vec3<float>;

class snapshot_folder : private turbomap_test::temporary_directory, public turbomap_test::snapshot_files {
 public:
  explicit snapshot_folder(bool fisheye = false)
      : snapshot_files(turbomap::snapshot_directory(path(), 1), fisheye), recording_(small_recording(fisheye)) {}

  turbomap::recording_snapshot read(i4 iteration = 1) const {
    return turbomap::read_snapshot(recording_, path(), iteration);
  }
  std::string error(i4 iteration = 1) const {
    return bad_file_message([&] { read(iteration); });
  }
  turbomap::recording& recording() { return recording_; }

 private:
  turbomap::recording recording_;
};

/// What reading says after one array was replaced.
template <class Row>
std::string with(const char* name, const std::vector<Row>& rows, bool fisheye = false) {
  const snapshot_folder folder(fisheye);
  folder.put(name, rows);
  return folder.error();
}
template <class T>
std::string with(const char* name, const std::vector<T>& values, const std::vector<std::size_t>& shape) {
  const snapshot_folder folder;
  folder.put(name, values, shape);
  return folder.error();
}
std::string without(const char* name) {
  const snapshot_folder folder;
  folder.remove(name);
  return folder.error();
}

}  // namespace

TEST_CASE("the start, the search and the creation of a snapshot are read") {
  const auto s = snapshot_folder().read();
  CHECK(s.pairs(0)[0][1] == 4);
  CHECK(s.batch_pairs(0).size() == 1);
  CHECK(s.mask1(0)[0] == 1);
  CHECK(s.mask2(0)[1] == 1);
  CHECK(s.creation.method[0] == -1);
  CHECK(has(snapshot_folder().error(2), "meta.json"));
}

TEST_CASE("the fusion of a snapshot is read") {
  for (const bool fisheye : {false, true}) {
    const auto s = snapshot_folder(fisheye).read();
    REQUIRE(s.fusion);
    const auto& f = *s.fusion;
    CHECK(f.cameras == (fisheye ? 2 : 1));
    CHECK(f.states.position[1].y == 5);
    CHECK(f.states.raw_max_distance[1] == 2);
    CHECK(f.states.point[0] == 7);
    CHECK(f.targets == std::vector<i4>{0});
    CHECK(f.calls.backward == std::vector<u1>{0, 1});
    CHECK(f.calls.off == std::vector<i8>{0, 2, 3});
    CHECK(f.calls.state[1] == -1);
    CHECK(f.calls.found.code[2] == 8);
    CHECK(f.calls.found.keypoint[0] == 3);
    CHECK(f.calls.found.distance[0] == 20);
    CHECK(f.calls.found.level[2] == 2);
    CHECK(f.calls.action[0] == 2);
    CHECK(f.calls.observations[2] == 4);
    CHECK(f.calls.slot_observations[0] == 5);
    CHECK(f.calls.slot_point[0] == 8);
    CHECK(f.forward_keypoint[1] == 2);
    CHECK(f.forward.state[1] == 1);
    CHECK(f.forward.found.code.size() == 2 * f.cameras);
    CHECK(f.backward.state == std::vector<i4>{1});
    CHECK(f.backward.found.level.size() == f.cameras);
  }
}

TEST_CASE("the map update and the culling of a snapshot are read") {
  const auto s = snapshot_folder().read();
  REQUIRE(s.map_update);
  CHECK(s.map_update->position[0].z == 3);
  CHECK(s.map_update->max_distance[0] == 5);
  CHECK(s.map_update->observers(0)[1] == 2);
  CHECK(s.map_update->obs_keypoints[1][0] == 2);
  CHECK(s.map_update->covis_w[0] == 15);
  REQUIRE(s.culling);
  const auto& c = *s.culling;
  CHECK(c.redundant_share == 0.5F);
  CHECK(c.inertial);
  CHECK_FALSE(c.imu_initialized);
  CHECK(c.last_guarded_id == 3);
  CHECK(c.keyframes_left == 2);
  CHECK(c.previous_next[0][1] == 1);
  CHECK(c.slots(0).size() == 2);
  CHECK(c.slot_point[0] == 1);
  CHECK(c.observations(1).begin == 2);
  CHECK(c.obs_octave[0] == 2);
  CHECK(c.observation_count[0] == 3);
  CHECK(c.dry_redundant[0] == 1);
  CHECK(c.points[0] == 2);
  CHECK(c.status[0] == turbomap::recorded_culling::culled);
}

TEST_CASE("stages may be left out whole, never in part") {
  const auto keep = [](const std::string& prefix) {
    const snapshot_folder folder;
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder.where())) files.push_back(entry.path());
    for (const auto& file : files) {
      const std::string name = file.filename().string();
      const bool stage = name.rfind("fs_", 0) == 0 || name.rfind("fuse", 0) == 0 || name.rfind("fpost_", 0) == 0 ||
                         name.rfind("cull_", 0) == 0;
      if (stage && name.rfind(prefix, 0) != 0) std::filesystem::remove(file);
    }
    const auto s = folder.read();
    return std::array<bool, 3>{s.fusion.has_value(), s.map_update.has_value(), s.culling.has_value()};
  };
  CHECK(keep("none") == std::array<bool, 3>{false, false, false});
  CHECK(keep("fpost_") == std::array<bool, 3>{false, true, false});
  CHECK(keep("cull_") == std::array<bool, 3>{false, false, true});
  refused(without("fs_pos"), "fs_pos", "is missing, but fuse_targets is there");
  refused(without("fpost_kp"), "fpost_kp", "is missing, but fpost_pt is there");
  refused(without("cull_in_kf"), "cull_in_kf", "is missing, but cull_kf_kp is there");
  refused(without("fuseb_bwd_level"), "fuseb_bwd_level", "cannot be opened");
  refused(without("fpost_covis_w"), "fpost_covis_w", "cannot be opened");
  refused(without("cull_kf_prevnext"), "cull_kf_prevnext", "cannot be opened");
}

TEST_CASE("a damaged start, search or creation is refused by array and reason") {
  refused(with<i4>("kf_alive", {1, 0}), "kf_alive", "row 1 is not above");
  CHECK(has(with<i4>("kf_alive", {0, 2}), "key 'kf': is not in kf_alive"));
  refused(with<pose>("kf_Tcw", std::vector<pose>(1)), "kf_Tcw", "has 1 rows, not 2");
  refused(with<i4>("sft_neigh", {3}), "sft_neigh", "row 0 is 3, outside [0, 3)");
  refused(with<i4>("sft_neigh", {2}), "sft_neigh", "row 0 is 2, which is not in kf_alive");
  refused(with<i4>("covis_w", {}), "covis_w", "has 0 rows, not 1");
  refused(with<pair>("sftb_pairs", {{1, 5}}), "sftb_pairs", "row 0 is (1, 5)");
  refused(with<pair>("sft_pairs", {{-1, 4}}), "sft_pairs", "row 0 is (-1, 4)");
  refused(with<i8>("sft_pairs_off", {0, 2}), "sft_pairs_off", "ends at 2");
  refused(with<i8>("sft_pairs_off", {0, 1, 1}), "sft_pairs_off", "has 3 rows, not 2");
  refused(with<i8>("sft_mask2_off", {0, 4}), "sft_mask2_off", "ends at 4");
  refused(with<u1>("sft_mask1", {1, 0, 0, 0, 0}), "sft_mask1", "has shape (5,), not (1, 5)");
  refused(with<i1>("cnm_method", {0}), "cnm_x3D", "not finite");
  refused(with<float>("sft_baseline", {INFINITY}), "sft_baseline", "not finite");
}

TEST_CASE("damaged point states and fusion entries are refused by array and reason") {
  refused(with<vec3>("fs_pos", {{1, 2, 3}, {4, NAN, 6}}), "fs_pos", "row 1 holds a number that is not finite");
  refused(with<vec3>("fs_normal", std::vector<vec3>(1)), "fs_normal", "has 1 rows, not 2");
  for (const char* name : {"fs_mindist", "fs_maxdist", "fs_rawmax"}) {
    refused(with<float>(name, {1, INFINITY}), name, "row 1");
    refused(with<float>(name, {1, 2, 3}), name, "has 3 rows, not 2");
  }
  refused(with<turbomap::descriptor_bytes>("fs_desc", {}), "fs_desc", "has 0 rows, not 2");
  refused(with<i4>("fs_pt", {7, -1}), "fs_pt", "row 1 is -1");
  refused(with<i4>("fuse_targets", {2}), "fuse_targets", "row 0 is 2, which is not in kf_alive");
  refused(with<i4>("fuse_call_kf", {0, 3}), "fuse_call_kf", "row 1 is 3");
  refused(with<u1>("fuse_call_right", {0, 1}), "fuse_call_right", "row 1 is 1");
  CHECK(with<u1>("fuse_call_right", {0, 1}, true) == "nothing thrown");
  refused(with<u1>("fuse_call_dir", {0, 2}), "fuse_call_dir", "row 1 is 2");
  refused(with<i8>("fuse_call_off", {0, 2, 4}), "fuse_call_off", "ends at 4");
  refused(with<i4>("fuse_e_state", {0, -1, 2}), "fuse_e_state", "row 2 is 2");
  refused(with<i4>("fuse_e_state", {-1, -1, 1}), "fuse_e_state", "row 0 is -1, but the code");
  refused(with<u1>("fuse_e_code", {0, 2, 10}), "fuse_e_code", "row 2 is 10");
  refused(with<u1>("fuse_e_code", {0, 2}), "fuse_e_code", "has shape (2,), not (3,)");
  refused(with<u1>("fuse_e_code", {0, 2, 0}), "fuse_e_bestidx", "row 2 is -1");
  refused(with<i4>("fuse_e_bestidx", {5, -1, -1}), "fuse_e_bestidx", "row 0 is 5, but keyframe 0 has 5");
  refused(with<i4>("fuse_e_bestidx", {3, -1, 4}), "fuse_e_bestidx", "row 2 is a keypoint, but the code");
  refused(with<i4>("fuse_e_bestdist", {20, 256, 257}), "fuse_e_bestdist", "row 2 is 257");
  refused(with<i1>("fuse_e_level", {1, -2, 2}), "fuse_e_level", "row 1 is -2");
  refused(with<i1>("fuse_e_level", {8, -1, 2}), "fuse_e_level", "row 0 is 8");
  refused(with<u1>("fuse_e_action", {5, 0, 0}), "fuse_e_action", "row 0 is 5");
  refused(with<u1>("fuse_e_action", {0, 0, 0}), "fuse_e_action", "row 0 does not fit the code");
  refused(with<u1>("fuse_e_action", {2, 1, 0}), "fuse_e_action", "row 1 does not fit the code");
  refused(with<i4>("fuse_e_nobs", {1}), "fuse_e_nobs", "has 1 rows, not 3");
  refused(with<i4>("fuse_e_inkf_nobs", {1}), "fuse_e_inkf_nobs", "has 1 rows, not 3");
  refused(with<i4>("fuse_e_inkf_pt", {-2, -1, -1}), "fuse_e_inkf_pt", "row 0 is -2");
}

TEST_CASE("damaged batch searches are refused by array and reason") {
  refused(with<i4>("fuseb_fwd_state", {0, 2}), "fuseb_fwd_state", "row 1 is 2");
  refused(with<i4>("fuseb_fwd_kp", {0, 5}), "fuseb_fwd_kp", "row 1 is 5");
  refused(with<i4>("fuseb_fwd_kp", {0}), "fuseb_fwd_kp", "has 1 rows, not 2");
  refused(with<u1>("fuseb_fwd_code", {1, 1}, {1, 2}), "fuseb_fwd_code", "has shape (1, 2), not (1, 1, 2)");
  refused(with<u1>("fuseb_fwd_code", {1, 1}, {2, 1, 1}), "fuseb_fwd_code", "has shape (2, 1, 1), not (1, 1, 2)");
  refused(with<i4>("fuseb_fwd_bestidx", {4, 5}, {1, 1, 2}), "fuseb_fwd_bestidx", "row 1 is 5");
  refused(with<i4>("fuseb_bwd_state", {-1}), "fuseb_bwd_state", "row 0 is -1");
  refused(with<i1>("fuseb_bwd_level", {2, 2}, {2, 1}), "fuseb_bwd_level", "has shape (2, 1), not (1, 1)");
}

TEST_CASE("a damaged map update is refused by array and reason") {
  refused(with<i4>("fpost_kp", {5}), "fpost_kp", "row 0 is 5");
  refused(with<i4>("fpost_pt", {-1}), "fpost_pt", "row 0 is -1");
  refused(with<vec3>("fpost_pos", {{1, NAN, 3}}), "fpost_pos", "row 0");
  refused(with<vec3>("fpost_normal", {{1, NAN, 3}}), "fpost_normal", "row 0");
  refused(with<float>("fpost_mindist", {NAN}), "fpost_mindist", "row 0");
  refused(with<float>("fpost_maxdist", {1, 2}), "fpost_maxdist", "has 2 rows, not 1");
  refused(with<turbomap::descriptor_bytes>("fpost_desc", {}), "fpost_desc", "has 0 rows, not 1");
  refused(with<i4>("fpost_nobs", {-1}), "fpost_nobs", "row 0 is -1");
  refused(with<i4>("fpost_refkf", {3}), "fpost_refkf", "row 0 is 3");
  refused(with<i4>("fpost_refkf", {1}), "fpost_refkf", "row 0 is not among the point's observers");
  refused(with<i8>("fpost_obs_off", {0, 1}), "fpost_obs_off", "ends at 1");
  refused(with<i4>("fpost_obs_kf", {0, 3}), "fpost_obs_kf", "row 1 is 3");
  refused(with<pair>("fpost_obs_lr", {{2, -1}, {5, -1}}), "fpost_obs_lr", "row 1 is (5, -1)");
  refused(with<pair>("fpost_obs_lr", {{2, -1}, {-1, -1}}), "fpost_obs_lr", "row 1 is (-1, -1)");
  refused(with<pair>("fpost_obs_lr", {{2, -1}, {2, 4}}), "fpost_obs_lr", "5 left and 0 right");
  refused(with<pair>("fpost_obs_lr", {{2, -1}, {3, -1}}, true), "fpost_obs_lr", "3 left and 2 right");
  refused(with<pair>("fpost_obs_lr", {{2, -1}, {-1, 2}}, true), "fpost_obs_lr", "row 1 is (-1, 2)");
  CHECK(with<pair>("fpost_obs_lr", {{2, 4}, {-1, 3}}, true) == "nothing thrown");
  refused(with<i4>("fpost_covis_kf", {-1}), "fpost_covis_kf", "row 0 is -1");
  refused(with<i4>("fpost_covis_w", {}), "fpost_covis_w", "has 0 rows, not 1");
  snapshot_folder no_final;
  no_final.recording().final_T_cw.clear();
  refused(no_final.error(), "fpost_obs_kf", "row 1 is 2, which is not in kf_alive");
}

TEST_CASE("a damaged culling is refused by array, key and reason") {
  refused(with<i4>("cull_in_kf", {3}), "cull_in_kf", "row 0 is 3");
  refused(with<pair>("cull_kf_prevnext", {{-2, 1}}), "cull_kf_prevnext", "row 0 names -2");
  refused(with<pair>("cull_kf_prevnext", {{-1, 3}}), "cull_kf_prevnext", "row 0 names 3");
  refused(with<i8>("cull_kf_off", {0, 3}), "cull_kf_off", "ends at 3");
  refused(with<i4>("cull_kf_kp", {1, 5}), "cull_kf_kp", "row 1 is 5, but keyframe 0 has 5");
  refused(with<i4>("cull_kf_pt", {1, 2}), "cull_kf_pt", "row 1 is 2");
  refused(with<i4>("cull_pt_id", {4, -9}), "cull_pt_id", "row 1 is -9");
  refused(with<i4>("cull_pt_nobs", {-1, 2}), "cull_pt_nobs", "row 0 is -1");
  refused(with<i4>("cull_pt_scalecount", {1, 2}), "cull_pt_scalecount", "has shape (2,)");
  refused(with<i8>("cull_obs_off", {0, 2, 1}), "cull_obs_off", "row 2 is 1, less than");
  refused(with<i4>("cull_obs_kf", {0, 2, 9}), "cull_obs_kf", "row 2 is 9");
  refused(with<pair>("cull_obs_lr", {{2, -1}, {1, -1}, {1, 1}}), "cull_obs_lr", "row 2 is (1, 1)");
  refused(with<u1>("cull_obs_octave", {2, 1, 8}), "cull_obs_octave", "row 2 is 8");
  for (const char* name : {"cull_dry_nmps", "cull_dry_nred", "cull_dry_nred_opt", "cull_nmps", "cull_nred"}) {
    refused(with<i4>(name, {3}), name, "row 0 is 3, outside [-1, 3)");
    refused(with<i4>(name, {}), name, "has 0 rows, not 1");
  }
  refused(with<i4>("cull_kf", {1}), "cull_kf", "row 0 is not the keyframe of cull_in_kf");
  refused(with<u1>("cull_status", {4}), "cull_status", "row 0 is 4");
  const auto meta = [](const std::string& from, const std::string& to) {
    const snapshot_folder folder;
    std::string text = snapshot_folder::meta;
    text.replace(text.find(from), from.size(), to);
    turbomap_test::write_bytes(folder.where() / "meta.json", text);
    return folder.error();
  };
  CHECK(has(meta("cull_redundant_th", "th"), "meta.json: key 'cull_redundant_th': is missing"));
  CHECK(has(meta("0.5", "1.5"), "key 'cull_redundant_th': is not in (0, 1]"));
  CHECK(has(meta("\"imu_initialized\":0", "\"imu_initialized\":\"no\""), "key 'imu_initialized': has the wrong type"));
  CHECK(has(meta("cull_keyframes_in_map", "kfs"), "key 'cull_keyframes_in_map'"));
  CHECK(has(meta("cull_last_id_kf_mnId", "last"), "key 'cull_last_id_kf_mnId'"));
}

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A snapshot of the small recording, with every stage, that tests write, damage and read.

#include "readers/recording_snapshot.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "scenes/recording_samples.hpp"
#include "support/files.hpp"

namespace turbomap_test {

/// The files of iteration 1 of the small recording: keyframes 0 and 1 of five keypoints each, one row or two in everything.
class snapshot_files {
 public:
  using i1 = std::int8_t;
  using i4 = std::int32_t;
  using i8 = std::int64_t;
  using u1 = std::uint8_t;
  using pose = turbomap::rigid_transform<float>;
  using pair = turbomap::index_pair;
  using vec3 = turbomap::vec3<float>;

  snapshot_files(const std::filesystem::path& where, bool fisheye) : where_(where) {
    std::filesystem::create_directories(where_);
    write_bytes(where_ / "meta.json", meta);
    put_search();
    put_fusion(fisheye ? 2 : 1);
    put_map_update();
    put_culling();
  }

  template <class Row>
  void put(const std::string& name, const std::vector<Row>& rows) const {
    turbomap::write_npy_rows(file(name), rows);
  }
  template <class T>
  void put(const std::string& name, const std::vector<T>& values, const std::vector<std::size_t>& shape) const {
    turbomap::write_npy<T>(file(name), values, shape);
  }
  void remove(const std::string& name) const { std::filesystem::remove(file(name)); }
  const std::filesystem::path& where() const { return where_; }

  static constexpr const char* meta = R"({"iter":1,"kf":1,"N":5,"inertial_run":1,"imu_initialized":0,)"
                                      R"("cull_redundant_th":0.5,"cull_last_id_kf_mnId":3,"cull_keyframes_in_map":2})";

 private:
  std::filesystem::path file(const std::string& name) const { return where_ / (name + ".npy"); }

  void put_search() const {
    put("kf_alive", std::vector<i4>{0, 1});
    put("kf_Tcw", std::vector<pose>(2));
    put("covis_kf", std::vector<i4>{0});
    put("covis_w", std::vector<i4>{1});
    put("sft_neigh", std::vector<i4>{0});
    put("sft_baseline", std::vector<float>{1});
    put("sft_Ow1_used", std::vector<vec3>(1));
    put("sft_skipped", std::vector<u1>{0});
    put("sft_mask1", std::vector<u1>{1, 0, 0, 0, 0}, {1, 5});
    put("sft_mask2_off", std::vector<i8>{0, 5});
    put("sft_mask2", std::vector<u1>{0, 1, 0, 0, 0});
    for (const std::string name : {"sft_pairs", "sftb_pairs"}) {
      put(name + "_off", std::vector<i8>{0, 1});
      put(name, std::vector<pair>{{1, 4}});
    }
    put("cnm_code", std::vector<u1>{1});
    put("cnm_method", std::vector<i1>{-1});
    put("cnm_x3D", std::vector<vec3>{{NAN, NAN, NAN}});
  }

  void put_fusion(std::size_t cameras) const {
    put("fs_pos", std::vector<vec3>{{1, 2, 3}, {4, 5, 6}});
    put("fs_normal", std::vector<vec3>(2));
    for (const char* name : {"fs_mindist", "fs_maxdist", "fs_rawmax"}) put(name, std::vector<float>{1, 2});
    put("fs_desc", std::vector<turbomap::descriptor_bytes>(2));
    put("fs_pt", std::vector<i4>{7, 8});
    put("fuse_targets", std::vector<i4>{0});
    put("fuse_call_kf", std::vector<i4>{0, 1});
    put("fuse_call_right", std::vector<u1>{0, 0});
    put("fuse_call_dir", std::vector<u1>{0, 1});
    put("fuse_call_off", std::vector<i8>{0, 2, 3});
    put("fuse_e_state", std::vector<i4>{0, -1, 1});
    put("fuse_e_code", std::vector<u1>{0, 2, 8});
    put("fuse_e_bestidx", std::vector<i4>{3, -1, -1});
    put("fuse_e_bestdist", std::vector<i4>{20, 256, 256});
    put("fuse_e_level", std::vector<i1>{1, -1, 2});
    put("fuse_e_action", std::vector<u1>{2, 0, 0});
    put("fuse_e_nobs", std::vector<i4>{2, 3, 4});
    put("fuse_e_inkf_nobs", std::vector<i4>{5, -1, -1});
    put("fuse_e_inkf_pt", std::vector<i4>{8, -1, -1});
    const auto batch = [&](const std::string& prefix, std::size_t targets, std::size_t points) {
      const std::size_t n = targets * cameras * points;
      std::vector<std::size_t> shape{cameras, points};
      if (prefix == "fuseb_fwd_") shape.insert(shape.begin(), targets);
      put(prefix + "code", std::vector<u1>(n, 1), shape);
      put(prefix + "bestidx", std::vector<i4>(n, 4), shape);
      put(prefix + "bestdist", std::vector<i4>(n, 77), shape);
      put(prefix + "level", std::vector<i1>(n, 2), shape);
    };
    put("fuseb_fwd_kp", std::vector<i4>{0, 2});
    put("fuseb_fwd_state", std::vector<i4>{0, 1});
    batch("fuseb_fwd_", 1, 2);
    put("fuseb_bwd_state", std::vector<i4>{1});
    batch("fuseb_bwd_", 1, 1);
  }

  void put_map_update() const {
    put("fpost_kp", std::vector<i4>{2});
    put("fpost_pt", std::vector<i4>{7});
    put("fpost_pos", std::vector<vec3>{{1, 2, 3}});
    put("fpost_normal", std::vector<vec3>{{0, 0, 1}});
    put("fpost_mindist", std::vector<float>{1});
    put("fpost_maxdist", std::vector<float>{5});
    put("fpost_desc", std::vector<turbomap::descriptor_bytes>(1));
    put("fpost_nobs", std::vector<i4>{2});
    put("fpost_refkf", std::vector<i4>{0});
    put("fpost_obs_off", std::vector<i8>{0, 2});
    put("fpost_obs_kf", std::vector<i4>{0, 2});  // 2 is not in the map, and has a final pose
    put("fpost_obs_lr", std::vector<pair>{{2, -1}, {2, -1}});
    put("fpost_covis_kf", std::vector<i4>{0});
    put("fpost_covis_w", std::vector<i4>{15});
  }

  void put_culling() const {
    put("cull_in_kf", std::vector<i4>{0});
    put("cull_kf_prevnext", std::vector<pair>{{-1, 1}});
    put("cull_kf_off", std::vector<i8>{0, 2});
    put("cull_kf_kp", std::vector<i4>{1, 2});
    put("cull_kf_pt", std::vector<i4>{1, 0});
    put("cull_pt_id", std::vector<i4>{4, 9});
    put("cull_pt_nobs", std::vector<i4>{3, 2});
    put("cull_pt_scalecount", std::vector<std::array<i4, 8>>(2));
    put("cull_obs_off", std::vector<i8>{0, 2, 3});
    put("cull_obs_kf", std::vector<i4>{0, 2, 0});
    put("cull_obs_lr", std::vector<pair>{{2, -1}, {1, -1}, {1, -1}});
    put("cull_obs_octave", std::vector<u1>{2, 1, 1});
    for (const char* name : {"cull_dry_nmps", "cull_nmps"}) put(name, std::vector<i4>{2});
    for (const char* name : {"cull_dry_nred", "cull_dry_nred_opt", "cull_nred"}) put(name, std::vector<i4>{1});
    put("cull_kf", std::vector<i4>{0});
    put("cull_status", std::vector<u1>{1});
  }

  std::filesystem::path where_;
};

inline constexpr const char* adjustment_meta =
    R"({"lba": {"inertial": 0, "iterations": 7, "user_lambda_init": 100, "robust_chi2_before": 12.5,)"
    R"( "robust_chi2_after": 11.25, "n_opt": 2}})";

/// Keyframes 2 and 0 optimised (0 fixed), 1 fixed; two points, three observations.
inline void write_adjustment(const std::filesystem::path& folder, bool second_camera) {
  std::filesystem::create_directories(folder);
  write_bytes(folder / "meta.json", adjustment_meta);
  using turbomap::vec3;
  using ints = std::vector<std::int32_t>;
  using bytes = std::vector<std::uint8_t>;
  using floats = std::vector<float>;
  using doubles = std::vector<double>;
  const auto write = [&](const char* name, const auto& rows) {
    turbomap::write_npy_rows(folder / (std::string(name) + ".npy"), rows);
  };
  std::vector<turbomap::rigid_transform<float>> poses(3);
  poses[0].tx = 1, poses[1].tx = 2;
  write("lba_kf", ints{2, 0, 1});
  write("lba_kf_fixed", bytes{0, 1, 1});
  write("lba_Tcw_before", poses);
  poses[0].tx = 1.5F;
  write("lba_Tcw_after", poses);
  write("lba_pose_after_d", std::vector<std::array<double, 12>>{{1, 0, 0, 0, 1, 0, 0, 0, 1, 1.5, 0, 0}, {1, 2, 3}});
  write("lba_pt_id", ints{70, 30});
  write("lba_pt_before", std::vector<vec3<float>>{{1, 2, 3}, {4, 5, 6}});
  write("lba_pt_after", std::vector<vec3<float>>{{1, 2, 3.5F}, {4, 5, 6}});
  write("lba_pt_after_d", std::vector<vec3<double>>{{1, 2, 3.5}, {4, 5, 6}});
  write("lba_e_kf", ints{0, 1, 2});
  write("lba_e_pt", ints{0, 0, 1});
  write("lba_e_kp", ints{3, 0, 1});
  write("lba_e_type", bytes{0, 1, std::uint8_t(second_camera ? 2 : 1)});
  write("lba_e_obs", std::vector<vec3<float>>{{10, 11, -1}, {20, 21, 15}, {30, 31, 25}});
  write("lba_e_invsigma2", floats{1, 0.5F, 0.25F});
  write("lba_e_chi2_before", doubles{1, 2, 3});
  write("lba_e_chi2_after", doubles{0.5, 2, 9});
  write("lba_e_outlier", bytes{0, 0, 1});
  write("lba_e_depthpos", bytes{1, 1, 1});
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// make_corpus DIRECTORY: writes what the fuzz targets start from, one folder per target, with the library's own writers where
// there is one. `corpus` beside this file is what it wrote.

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include <turbomap/io/crossover_file.hpp>
#include <turbomap/io/recording_writer.hpp>
#include <turbomap/io/trajectory.hpp>

#include "scenes/keyframe_map_bytes.hpp"
#include "scenes/recording_samples.hpp"
#include "support/files.hpp"

namespace {

using turbomap_test::file_bytes;
using turbomap_test::write_bytes;
namespace fs = std::filesystem;

fs::path in(const fs::path& corpus, const char* target, const char* name) {
  fs::create_directories(corpus / target);
  return corpus / target / name;
}

void arrays(const fs::path& corpus) {
  const turbomap_test::temporary_directory folder;
  const auto keep = [&](int reader, const char* name) {
    write_bytes(in(corpus, "npy", name), char(reader) + file_bytes(folder / "a.npy"));
  };
  const std::vector<float> floats{1, 2, 3, 4, 5, 6, 7};
  turbomap::write_npy<float>(folder / "a.npy", turbomap::span<const float>(floats.data(), 6), {2, 3});
  keep(0, "float_2x3");
  keep(8, "rows_of_3");
  turbomap::write_npy<float>(folder / "a.npy", turbomap::span<const float>(floats.data(), 1), {});
  keep(0, "float_scalar");
  turbomap::write_npy<float>(folder / "a.npy", floats, {1, 7});
  keep(9, "rows_of_7");
  turbomap::write_npy_rows(folder / "a.npy", std::vector<double>{1, 2});
  keep(1, "double_2");
  turbomap::write_npy_rows(folder / "a.npy", std::vector<std::int32_t>{});
  keep(2, "int32_none");
  turbomap::write_npy_rows(folder / "a.npy", std::vector<std::int64_t>{-1});
  keep(3, "int64_1");
  turbomap::write_npy_rows(folder / "a.npy", std::vector<turbomap::descriptor_bytes>(1));
  keep(10, "descriptor");
}

/// Calibrations and data sets, a file per part. In sensor.yaml a camera has its keys without the block's name.
const std::string mounted =
    "  T_cam_imu:\n    - [1.0, 0, 0, 0.05]\n    - [0, 0.6, -0.8, 0]\n    - [0, 0.8, 0.6, 0]\n    - [0, 0, 0, 1]\n";
const std::string fisheye_lens = "  distortion_coeffs: [1e-3, 0.2e-3, 0, 0]\n  distortion_model: equidistant\n";
const std::string image = "  intrinsics: [190, 191, 255, 256] # fu, fv, cu, cv\n  resolution: [512, 512]\n";
const std::string noise = "imu0:\n  accelerometer_noise_density: 0.01\n  update_rate: 400.0\n";
const std::string sensor =
    "T_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0.1, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nresolution: [752, 480]\n"
    "intrinsics: [458, 457, 367, 248]\ndistortion_model: radial-tangential\n"
    "distortion_coefficients: [-0.28, 0.07, 2e-4, 1e-5]\n";

void calibrations(const fs::path& corpus) {
  const std::string fisheye = mounted + fisheye_lens + image, pinhole = mounted + image;
  write_bytes(in(corpus, "calibration", "fisheyes"), "%YAML:1.0\ncam0:\n" + fisheye + "cam1:\n" + fisheye + noise);
  write_bytes(in(corpus, "calibration", "pinholes"), "cam0:\n" + pinhole + "cam1:\n" + pinhole);

  const auto dataset = [&](const char* name, char asked, const std::vector<std::string>& files) {
    std::string all(1, asked);
    for (std::size_t i = 0; i < files.size(); ++i) all += (i == 0 ? "" : "==\n") + files[i];
    write_bytes(in(corpus, "asl_dataset", name), all);
  };
  const std::string images = "#timestamp [ns],filename\n10,a.png\r\n20,b.png\n", sample = "12,0.1,0.2,0.3,0,0,9.81\n";
  const std::string truth = "#t,p,q\n10,1,2,3,1,0,0,0\n30,1,2,4,0.6,0,0,0.8\n", rate = "rate_hz: 200\n";
  dataset("pinholes", '\2', {images, sensor, images, sensor, sample, rate, truth, ""});
  dataset("one_camera", '\1', {images, sensor, "", "", "", "", truth, ""});
  const std::string cameras = "cam0:\n" + fisheye + "cam1:\n" + fisheye + noise;
  dataset("fisheyes", '\2', {images, "", images, "", sample, "", truth, cameras});
}

/// The nine files of a small Schur system.
constexpr const char* schur_system =
    "0 2 3\n0 2 3\n0 0\n4 1 1 5\n0 1\n7 8\n1 1\n9\n==\n0 2 3\n0 1\n0 0\n1 2\n==\n0 1\n0 1\n0 0\n2\n==\n"
    "0 2 3\n0 2 3\n0 0\n3.5 0 0 3\n0 1\n7 8\n1 1\n9\n==\n1 2 3\n==\n4\n==\n-1 -2 3\n==\n0 0 0\n==\n2\n";

void texts(const fs::path& corpus) {
  turbomap::write_trajectory(in(corpus, "trajectory", "three"),
                             {{-500000001, {}}, {0, {0.6, 0, 0, 0.8, 1, -2, 3.5}}, {1403715527912143104, {}}});
  write_bytes(in(corpus, "trajectory", "exponents"),
              "-.5e-3 1 0 0 0 0 0 1\n1.403636580838555574e+09 0 0 0 0 0 0 1\n+1.5e9 0 0 0 0 0 0 1\n");
  write_bytes(in(corpus, "keyframe_map", "one_keyframe"), turbomap_test::keyframe_map_bytes());
  turbomap::crossover measured;
  measured.least[0] = 1 << 20, measured.least[1] = 2048.5;
  turbomap::write_crossover(in(corpus, "crossover", "measured"), measured);
  write_bytes(in(corpus, "timing_table", "two_rows"), "iter,ms_total,snapshot\n11,1.5,0\r\n12,2e1,1\n");
  write_bytes(in(corpus, "bal", "one_camera"),
              "1 2 2\n0 0 -1.5 2.5\n0 1 3 4\n0.1 0.2 0.3\n0 0 -1\n500 1e-7 0\n1 2 3\n4 5 6\n");
  write_bytes(in(corpus, "kitti_stereo", "far_away"),
              "700 710 0 600 170 0.5\n==\n10 0.6 -0.8 0 1e308 0.8 0.6 0 1 0 0 1 0 0 0 0 1\n==\n10 7 7 3 2 2 1 10\n");
  write_bytes(in(corpus, "kitti_stereo", "two_frames"),
              "700 710 0 600 170 0.5\n==\n10  1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1\n"
              "20  0 0 1 0.5  0 1 0 0  -1 0 0 3  0 0 0 1\n==\n10 7 740 390 240 2 1 10\n20 7 600 550 100 9 9 9\n");
  write_bytes(
      in(corpus, "colmap_model", "five_cameras"),
      "# cameras\n1 SIMPLE_RADIAL 640 480 500 320 240 -0.1\n2 OPENCV 640 480 500 510 320 240 1 2 3 4\n"
      "3 PINHOLE 64 48 50 51 32 24\n4 SIMPLE_PINHOLE 64 48 50 32 24\n5 RADIAL 64 48 50 32 24 1 2\n==\n"
      "7 1 0 0 0 1 2 3 1 a b.jpg\n10.5 20.5 4 30 40 -1\n9 0 1 0 0 0 0 0 2 two.jpg\n\n==\n4 1.5 -2 3 255 255 255 0\n");
  write_bytes(in(corpus, "schur_system", "small"), schur_system);
  write_bytes(in(corpus, "colmap_model", "no_points"),
              "1 PINHOLE 64 48 50 51 32 24\n==\n1 1 0 0 0 0 0 0 1 a.jpg\n1 2 3\n");
}

void recordings(const fs::path& corpus) {
  for (const bool fisheye : {false, true}) {
    auto meta = turbomap_test::small_meta(fisheye);
    meta.levels = 2;
    for (auto* list : {&meta.scale_factors, &meta.level_sigma2, &meta.inv_level_sigma2}) list->resize(2);
    turbomap::write_recording_meta(in(corpus, "recording_meta", fisheye ? "fisheye" : "pinhole"), meta);
  }
  // Which recording; then changes: file, what, where (two bytes), by what.
  for (const char* target : {"recording", "snapshot"}) {
    write_bytes(in(corpus, target, "unchanged"), std::string("\0", 1));
    write_bytes(in(corpus, target, "fisheye_number"), std::string("\1\5\0\3\0\2\1\7", 8));
    write_bytes(in(corpus, target, "rows_and_number"), std::string("\0\7\5\4\0\x2e\1\3\0\4", 10));
  }
  write_bytes(in(corpus, "synthetic_lba", "two_numbers"), std::string("\3\0\0\0\2\1\7\5\0\1\0\0\0\1", 14));
}

/// Any bytes are a problem to the targets of algorithms.
void problems(const fs::path& corpus) {
  std::mt19937 random(1);
  for (const char* target :
       {"matching", "projection", "adjustment", "imu", "map_edits", "mapper", "fusion", "map_faults", "mirrored_mapper",
        "inertial_mapper", "map_recorder", "point_uncertainty", "resolution_profile"})
    for (const char* name : {"a", "b", "c", "d", "e", "f"}) {
      std::string any(200, 0);
      for (char& c : any) c = static_cast<char>(random() >> 8 & 0xFFU);
      write_bytes(in(corpus, target, name), any);
    }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: make_corpus DIRECTORY\n");
    return 2;
  }
  arrays(argv[1]), texts(argv[1]), calibrations(argv[1]), recordings(argv[1]), problems(argv[1]);
}

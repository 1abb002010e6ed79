// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Synthetic local bundle adjustments: the fuzzer's bytes are changes to the files of a good one.

#include "readers/synthetic_lba.hpp"

#include "fuzz/fuzz.hpp"
#include "fuzz/recording_changes.hpp"
#include "tests/synthetic_lba_samples.hpp"

using namespace turbomap_fuzz;

namespace {

folder_files written() {
  folder_files files(folder() / "lba");
  std::filesystem::create_directories(files.folder());
  turbomap_test::write_synthetic_lba(files.folder());
  files.read_files();
  return files;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const folder_files good = written();
  const recording_changes changes(good, {reinterpret_cast<const char*>(data), size});
  turbomap::synthetic_lba s;
  if (!reads([&] { s = turbomap::read_synthetic_lba(good.folder()); })) return 0;
  const turbomap::reprojection_data& d = s.data;
  const auto& T_true = s.T_cw_true;
  const auto& points_true = s.points_true;
  const std::size_t rows = d.frame.size();
  expect(d.fixed.size() == d.T_cw.size(), "every frame is fixed or not");
  for (const std::size_t n : {d.landmark.size(), d.pixel.size(), d.information.size(), d.stereo.size()})
    expect(n == rows, "rows are whole");
  for (const auto* poses : {&d.T_cw, &T_true})
    for (const auto& T : *poses) expect(is_pose(T, 1e-6), "poses are poses");
  for (const auto* points : {&d.points, &points_true, &d.pixel})
    for (const auto& x : *points) expect(finite({x.x, x.y, x.z}), "points and pixels are finite");
  for (std::size_t i = 0; i < rows; ++i) {
    expect(d.frame[i] >= 0 && static_cast<std::size_t>(d.frame[i]) < d.T_cw.size(), "frames are there");
    expect(d.landmark[i] >= 0 && static_cast<std::size_t>(d.landmark[i]) < d.points.size(), "landmarks are there");
    expect(finite({d.information[i]}) && d.information[i] > 0 && d.stereo[i] < 2, "measurements are weighted");
  }
  expect(T_true.empty() || T_true.size() == d.T_cw.size(), "the truth is of all frames");
  expect(points_true.size() == (T_true.empty() ? 0 : d.points.size()), "the truth is of all points");
  return 0;
}

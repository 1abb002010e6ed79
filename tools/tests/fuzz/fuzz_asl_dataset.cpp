// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Data sets in ASL layout, but their images: eight files, of which an empty one is not there. The first byte says what is
// asked for.

#include <utility>

#include "extraction/asl_dataset.hpp"

#include "fuzz/fuzz.hpp"
#include "tests/fuzz/calibration_checks.hpp"

using namespace turbomap_fuzz;
namespace fs = std::filesystem;

namespace {

constexpr const char* names[] = {"mav0/cam0/data.csv",    "mav0/cam0/sensor.yaml", "mav0/cam1/data.csv",
                                 "mav0/cam1/sensor.yaml", "mav0/imu0/data.csv",    "mav0/imu0/sensor.yaml",
                                 "mav0/mocap0/data.csv",  "dso/camchain.yaml"};

template <class Rows, class Time>
void expect_rising(const Rows& rows, Time time) {
  for (std::size_t i = 1; i < rows.size(); ++i) expect(time(rows[i]) > time(rows[i - 1]), "times rise");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto part = parts({reinterpret_cast<const char*>(data) + 1, size - 1}, std::size(names));
  for (std::size_t i = 0; i < part.size(); ++i) {
    fs::create_directories((folder() / names[i]).parent_path());
    if (part[i].empty())
      fs::remove(folder() / names[i]);
    else
      put(names[i], part[i]);
  }
  turbomap::extraction::dataset_options options;
  options.mono = data[0] % 2 == 1, options.imu = data[0] / 2 % 2 == 1;
  if (data[0] / 4 % 2 == 1) options.calibration = folder() / names[7];
  turbomap::extraction::asl_dataset d;
  if (!reads([&] { d = turbomap::extraction::read_asl_dataset(folder(), options); })) return 0;
  expect(d.cameras.size() == (options.mono ? 1 : 2), "as many cameras as were asked for");
  for (const auto& c : d.cameras) {
    expect_sound(c.camera);
    expect(c.distortion.empty() || c.distortion.size() == 4 || c.distortion.size() == 5, "a lens has 4 or 5 numbers");
    for (const double k : c.distortion) expect(finite({k}), "distortion is finite");
    expect(c.camera.width == d.cameras[0].camera.width && c.camera.is_fisheye() == d.cameras[0].camera.is_fisheye(),
           "cameras are of one model and size");
  }
  expect(!d.images.empty(), "there are images");
  expect_rising(d.images, [](const auto& i) { return i.t_ns; });
  for (const auto& i : d.images) expect(i.right.empty() == options.mono, "pairs are pairs");
  expect(!d.T_wb.empty(), "there is a trajectory");
  expect_rising(d.T_wb, [](const auto& p) { return p.t_ns; });
  for (const auto& p : d.T_wb) expect(is_pose(p.T_wb, 1e-9), "poses are normalised and finite");
  expect(d.imu.size() == d.imu_t_ns.size() && d.imu.empty() == !options.imu, "samples have their times");
  expect_rising(d.imu_t_ns, [](std::int64_t t) { return t; });
  for (const auto& s : d.imu)
    expect(finite({s.gyro.x, s.gyro.y, s.gyro.z, s.acceleration.x, s.acceleration.y, s.acceleration.z}),
           "samples are finite");
  expect_sound(d.noise);
  for (const auto& i : d.images) {
    Eigen::Isometry3d T;
    if (turbomap::extraction::pose_at(d.T_wb, i.t_ns, 0.1, T))
      expect(T.matrix().allFinite(), "poses between are finite");
  }
  return 0;
}

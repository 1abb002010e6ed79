// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// TUM trajectories. What is read can be written, and read again with the same times.

#include <turbomap/io/trajectory.hpp>

#include "fuzz.hpp"

using namespace turbomap_fuzz;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = put("t.txt", {reinterpret_cast<const char*>(data), size});
  std::vector<turbomap::stamped_pose> poses;
  if (!reads([&] { poses = turbomap::read_trajectory(file); })) return 0;
  expect(!poses.empty(), "a trajectory has a pose");
  for (std::size_t i = 0; i < poses.size(); ++i) {
    expect(is_pose(poses[i].T_wb, 1e-9), "poses are normalised and finite");
    expect(i == 0 || poses[i].t_ns > poses[i - 1].t_ns, "times rise");
  }
  turbomap::write_trajectory(folder() / "w.txt", poses);
  const auto again = turbomap::read_trajectory(folder() / "w.txt");
  expect(again.size() == poses.size(), "as many poses are read as were written");
  for (std::size_t i = 0; i < poses.size(); ++i) expect(again[i].t_ns == poses[i].t_ns, "times are exact");
  return 0;
}

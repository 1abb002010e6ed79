// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A synthetic local bundle adjustment of two frames that tests write, damage and read.

#include <turbomap/io/npy.hpp>
#include <turbomap/types.hpp>

#include <cstdint>
#include <filesystem>
#include <vector>

namespace turbomap_test {

inline void write_synthetic_lba(const std::filesystem::path& folder) {
  using pose = turbomap::rigid_transform<double>;
  using point = turbomap::vec3<double>;
  const auto write = [&](const char* name, const auto& rows) { turbomap::write_npy_rows(folder / name, rows); };
  write("Tcw.npy", std::vector<pose>{{}, {0, 0, 0.6, 0.8, 1, 2, 3}});
  write("Tcw_true.npy", std::vector<pose>(2));
  write("pt.npy", std::vector<point>{{1, 2, 3}, {4, 5, 6}});
  write("pt_true.npy", std::vector<point>{{1, 2, 3.5}, {4, 5, 6}});
  write("kf_fixed.npy", std::vector<std::uint8_t>{0, 1});
  write("e_kf.npy", std::vector<std::int32_t>{0, 1, 1});
  write("e_pt.npy", std::vector<std::int32_t>{1, 1, 0});
  write("e_obs.npy", std::vector<point>{{10, 20, -5}, {11, 21, -1}, {12, 22, 6}});
  write("e_invsigma2.npy", std::vector<double>{1, 0.5, 0.25});
  write("e_type.npy", std::vector<std::uint8_t>{1, 0, 1});
}

}  // namespace turbomap_test

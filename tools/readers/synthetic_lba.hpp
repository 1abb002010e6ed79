// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reads a synthetic local bundle adjustment: a folder of .npy arrays
///
///     Tcw, Tcw_true f8[K,7]   pt, pt_true f8[P,3]   kf_fixed u1[K]
///     e_kf, e_pt i4[E]   e_obs f8[E,3]   e_invsigma2 f8[E]   e_type u1[E]
///
/// (poses qx qy qz qw tx ty tz; e_obs u, v, u_right; e_type 0: mono, the last one means nothing, 1: stereo). `*_true`
/// may be left out.

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include <turbomap/config.hpp>
#include <turbomap/io/npy.hpp>
#include <turbomap/io/recording_validate.hpp>
#include <turbomap/io/reprojection_data.hpp>

namespace turbomap {

struct synthetic_lba {
  reprojection_data data;                          ///< at the start
  std::vector<rigid_transform<double>> T_cw_true;  ///< empty: not given
  std::vector<vec3<double>> points_true;
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Reads a problem. Throws bad_file naming file, array, row and reason.
inline synthetic_lba read_synthetic_lba(const std::filesystem::path& folder) {
  const detail::array_checks check(folder);
  synthetic_lba s;
  reprojection_data& d = s.data;
  const auto read = [&](const char* name, auto& rows) {
    using row = typename std::remove_reference_t<decltype(rows)>::value_type;
    rows = read_npy_rows<row>(folder / (std::string(name) + ".npy"));
    check.finite(name, rows);
  };
  const auto read_sized = [&](const char* name, auto& rows, std::size_t size) {
    read(name, rows);
    check.size(name, rows.size(), size);
  };
  const auto unit = [&](const char* name, const std::vector<rigid_transform<double>>& poses) {
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const auto& q = poses[i];
      if (!(std::abs(q.qx * q.qx + q.qy * q.qy + q.qz * q.qz + q.qw * q.qw - 1) < 1e-6))
        check.fail_row(name, i, "does not begin with a unit quaternion");
    }
  };
  read("Tcw", d.T_cw), read("pt", d.points), read("e_kf", d.frame);
  unit("Tcw", d.T_cw);
  read_sized("kf_fixed", d.fixed, d.T_cw.size());
  read_sized("e_pt", d.landmark, d.frame.size()), read_sized("e_obs", d.pixel, d.frame.size());
  read_sized("e_invsigma2", d.information, d.frame.size());
  read_sized("e_type", d.stereo, d.frame.size());
  check.in_range("kf_fixed", d.fixed, 0, 2), check.in_range("e_type", d.stereo, 0, 2);
  check.in_range("e_kf", d.frame, 0, static_cast<std::int64_t>(d.T_cw.size()));
  check.in_range("e_pt", d.landmark, 0, static_cast<std::int64_t>(d.points.size()));
  for (std::size_t i = 0; i < d.frame.size(); ++i) {
    if (!(d.information[i] > 0)) check.fail_row("e_invsigma2", i, "is not positive");
  }
  std::error_code ignored;
  if (std::filesystem::exists(folder / "Tcw_true.npy", ignored)) {
    read_sized("Tcw_true", s.T_cw_true, d.T_cw.size()), read_sized("pt_true", s.points_true, d.points.size());
    unit("Tcw_true", s.T_cw_true);
  }
  return s;
}

TURBOMAP_END_NAMESPACE

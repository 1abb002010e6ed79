// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From a file or folder of any format to a problem in memory; which format it is, by what lies there.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include <turbomap/camera/brown_conrady.hpp>
#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/camera/rig.hpp>
#include <turbomap/io/bal.hpp>
#include <turbomap/io/colmap_model.hpp>
#include <turbomap/io/kitti_stereo.hpp>
#include "readers/recording_snapshot_adjustment.hpp"
#include "readers/schur_system.hpp"
#include "readers/synthetic_lba.hpp"

#include "arguments.hpp"
#include "generated_bal.hpp"
#include "recorded_problem.hpp"

namespace turbomap_bundle {

using loaded_problem =
    std::variant<rig_problem<turbomap::pinhole<double>>, rig_problem<turbomap::kannala_brandt<double>>,
                 rig_problem<turbomap::brown_conrady<double>>, turbomap::bal_problem, turbomap::schur_system>;

/// The first of the files in a folder whose name begins like this; empty: none.
inline std::filesystem::path first_file(const std::filesystem::path& folder, const std::string& begin) {
  std::filesystem::path first;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(begin, 0) == 0 && (first.empty() || name < first.filename().string())) first = entry.path();
  }
  return first;
}

/// The same; throws bad_file where there is none.
inline std::filesystem::path existing_first_file(const std::filesystem::path& folder, const std::string& begin) {
  const auto first = first_file(folder, begin);
  if (first.empty()) throw turbomap::bad_file("turbomap: " + folder.string() + ": holds no file named " + begin + "*");
  return first;
}

inline std::string format_of(const std::filesystem::path& input) {
  namespace fs = std::filesystem;
  if (!fs::exists(input)) throw turbomap::bad_file("turbomap: " + input.string() + ": is not there");
  if (!fs::is_directory(input))
    return input.filename().string().rfind("VO_stereo_factors", 0) == 0 ? "kitti-stereo" : "bal";
  const auto holds = [&](const char* name) { return fs::exists(input / name); };
  if (holds("hschur.txt")) return "schur";
  if (holds("lba_kf.npy") || holds("e_kf.npy")) return "lba";
  if (holds("images.txt")) return "colmap";
  if (!first_file(input, "VO_stereo_factors").empty()) return "kitti-stereo";
  if (!first_file(input, "problem-").empty()) return "bal";
  throw turbomap::bad_file("turbomap: " + input.string() + ": holds no problem of a known format");
}

/// FILE: VO_stereo_factors<suffix>.txt; the calibration is that of the suffix, or the one without.
inline loaded_problem load_kitti(const std::filesystem::path& input) {
  const auto factors = std::filesystem::is_directory(input) ? existing_first_file(input, "VO_stereo_factors") : input;
  const std::string begin = "VO_stereo_factors", name = factors.filename().string();
  if (name.rfind(begin, 0) != 0)
    throw turbomap::bad_file("turbomap: " + factors.string() + ": is not named VO_stereo_factors*.txt");
  const std::string suffix = name.substr(begin.size());
  const auto folder = factors.parent_path();
  auto calibration = folder / ("VO_calibration" + suffix);
  if (!std::filesystem::exists(calibration)) calibration = folder / "VO_calibration.txt";
  auto p = turbomap::read_kitti_stereo(calibration, folder / ("VO_camera_poses" + suffix), factors);
  return rig_problem<turbomap::pinhole<double>>{{p.rig[0]}, std::move(p.data)};
}

/// Every camera of the model becomes one of the rig; the first image is fixed.
inline loaded_problem load_colmap(const std::filesystem::path& folder) {
  const auto model = turbomap::read_colmap_model(folder);
  rig_problem<turbomap::brown_conrady<double>> p;
  std::map<int, std::uint8_t> camera;
  std::map<std::int64_t, std::int32_t> landmark;
  if (model.cameras.size() > 255)
    throw turbomap::bad_file("turbomap: " + folder.string() + ": holds more than 255 cameras");
  for (const auto& [id, c] : model.cameras) {
    camera[id] = static_cast<std::uint8_t>(p.rig.size());
    p.rig.push_back({c.model, {}, 0, {}});
  }
  for (const auto& [id, x] : model.points) {
    landmark[id] = static_cast<std::int32_t>(p.data.points.size());
    p.data.points.push_back(x);
  }
  for (const auto& [id, image] : model.images) {
    for (const auto& o : image.observations) {
      if (o.point < 0 || landmark.count(o.point) == 0) continue;
      p.data.frame.push_back(static_cast<std::int32_t>(p.data.T_cw.size()));
      p.data.landmark.push_back(landmark[o.point]);
      p.data.camera.push_back(camera[image.camera]);
      p.data.pixel.push_back({o.pixel.x, o.pixel.y, 0});
      p.data.information.push_back(1), p.data.stereo.push_back(0);
    }
    p.data.fixed.push_back(p.data.fixed.empty() ? 1 : 0);
    p.data.T_cw.push_back(image.T_cw);
  }
  return p;
}

/// Whether the input of format `lba` is a synthetic problem: it has no camera.
inline bool is_synthetic(const std::filesystem::path& input) { return std::filesystem::exists(input / "e_kf.npy"); }

/// A synthetic problem, or the folder of a snapshot inside of its recording.
inline loaded_problem load_lba(const arguments& a) {
  if (is_synthetic(a.input)) {
    auto s = turbomap::read_synthetic_lba(a.input);
    const auto c = a.camera.empty() ? std::vector<double>{435.2, 435.2, 367.4, 252.2, 47.9} : a.camera;
    const turbomap::pinhole<double> camera{c[0], c[1], c[2], c[3]};
    return rig_problem<turbomap::pinhole<double>>{{{camera, {}, c[4], {}}}, std::move(s.data)};
  }
  auto folder = std::filesystem::absolute(a.input).lexically_normal();
  if (folder.filename().empty()) folder = folder.parent_path();
  const std::string name = folder.filename().string();
  if (name.rfind("snap_", 0) != 0 || name.find_first_not_of("0123456789", 5) != std::string::npos || name.size() > 14)
    throw turbomap::bad_file("turbomap: " + a.input.string() + ": is not named snap_NUMBER");
  const auto recording = turbomap::read_recording(folder.parent_path());
  const auto s = turbomap::read_adjustment_snapshot(recording, folder.parent_path(), std::stoi(name.substr(5)));
  if (!s) throw turbomap::bad_file("turbomap: " + a.input.string() + ": holds no adjustment");
  if (s->inertial)
    throw turbomap::bad_file("turbomap: " + a.input.string() + ": its adjustment is inertial, not visual");
  if (recording.meta.is_fisheye()) return recorded_problem<turbomap::kannala_brandt<double>>(recording.meta, *s);
  return recorded_problem<turbomap::pinhole<double>>(recording.meta, *s);
}

/// Adds Gaussian noise to the poses of free frames (on their left) and to the landmarks.
inline void perturb(turbomap::reprojection_data& d, const arguments& a) {
  std::mt19937 random(a.seed);
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < d.T_cw.size(); ++i) {
    double step[6];
    for (int k = 0; k < 6; ++k) step[k] = normal(random) * (k < 3 ? a.perturb_rad : a.perturb_m);
    if (d.fixed[i] == 0) d.T_cw[i] = turbomap::left_exp(step, d.T_cw[i]);
  }
  for (auto& x : d.points) {
    x.x += a.perturb_m * normal(random), x.y += a.perturb_m * normal(random), x.z += a.perturb_m * normal(random);
  }
}

/// Reads the input. Throws bad_file naming file and reason, and std::invalid_argument for a camera that is not needed, and where a
/// problem cannot be perturbed.
inline loaded_problem load(const arguments& a, const std::string& format) {
  if (!a.camera.empty() && (format != "lba" || !is_synthetic(a.input)))
    throw std::invalid_argument("--camera: is for synthetic problems, not for this one");
  loaded_problem p = [&]() -> loaded_problem {
    if (format == "schur") return turbomap::read_schur_system(a.input);
    if (format == "lba") return load_lba(a);
    if (format == "kitti-stereo") return load_kitti(a.input);
    if (format == "colmap") return load_colmap(a.input);
    if (format == "generated") return generate_bal(parse_generated_size(a.input.string()), a.seed);
    return turbomap::read_bal(std::filesystem::is_directory(a.input) ? existing_first_file(a.input, "problem-")
                                                                     : a.input);
  }();
  if (a.perturb_m != 0 || a.perturb_rad != 0)
    std::visit(
        [&](auto& problem) {
          if constexpr (is_rig_problem<std::decay_t<decltype(problem)>>::value)
            perturb(problem.data, a);
          else
            throw std::invalid_argument(
                "--perturb-m, --perturb-rad: problems of bal, generated and schur cannot be perturbed");
        },
        p);
  return p;
}

}  // namespace turbomap_bundle

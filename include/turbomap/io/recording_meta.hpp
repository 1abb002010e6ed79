// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// `meta.json` of a recording: from and to recording_meta.

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "../config.hpp"
#include "../error.hpp"
#include "recording_data.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Reads keys of a JSON object with messages that name file, key and reason.
class json_reader {
 public:
  explicit json_reader(const std::filesystem::path& file) : file_(file) {
    std::ifstream stream(file, std::ios::binary);
    if (!stream) fail("", "cannot be opened");
    json_ = nlohmann::json::parse(stream, nullptr, false);
    if (json_.is_discarded() || !json_.is_object()) fail("", "is not a JSON object");
  }
  [[noreturn]] void fail(const std::string& key, const std::string& reason) const {
    throw bad_file("turbomap: " + file_.string() + ": " + (key.empty() ? "" : "key '" + key + "': ") + reason);
  }
  const nlohmann::json& json() const { return json_; }
  bool has(const char* key) const { return json_.contains(key) && !json_[key].is_null(); }

  template <class T>
  T get(const char* key) const {
    if (!has(key)) fail(key, "is missing");
    return convert<T>(key, json_[key]);
  }
  template <class T>
  T get(const char* key, const T& otherwise) const {
    return has(key) ? convert<T>(key, json_[key]) : otherwise;
  }
  rigid_transform<float> pose(const char* key) const {
    const auto v = get<std::vector<float>>(key, {0, 0, 0, 1, 0, 0, 0});
    if (v.size() != 7) fail(key, "has " + std::to_string(v.size()) + " numbers, not qx qy qz qw tx ty tz");
    const float norm2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3];
    if (!(std::abs(norm2 - 1) < 1e-3F)) fail(key, "does not begin with a unit quaternion");
    return {v[0], v[1], v[2], v[3], v[4], v[5], v[6]};
  }

 private:
  template <class T>
  T convert(const char* key, const nlohmann::json& value) const {
    try {
      return value.get<T>();
    } catch (const nlohmann::json::exception&) {
      fail(key, "has the wrong type");
    }
  }

  std::filesystem::path file_;
  nlohmann::json json_;
};

inline std::vector<float> numbers(const rigid_transform<float>& T) {
  return {T.qx, T.qy, T.qz, T.qw, T.tx, T.ty, T.tz};
}

inline void check_meta(const json_reader& json, const recording_meta& m) {
  const std::size_t parameters = m.is_fisheye() ? 8 : 4, levels = static_cast<std::size_t>(m.levels);
  if (!m.is_fisheye() && m.model != "Pinhole")
    json.fail("model", "is '" + m.model + "', not Pinhole or KannalaBrandt8");
  if (m.camera1.size() != parameters) json.fail("camera1", "needs " + std::to_string(parameters) + " numbers");
  if (!m.camera2.empty() && m.camera2.size() != parameters)
    json.fail("camera2", "needs " + std::to_string(parameters) + " numbers or none");
  if (m.levels < 1 || m.levels > 255) json.fail("n_levels", "is not in 1..255");
  if (!(m.scale_factor > 1)) json.fail("scale_factor", "is not above 1");
  if (m.scale_factors.size() != levels) json.fail("scale_factors", "does not have n_levels numbers");
  if (m.level_sigma2.size() != levels) json.fail("level_sigma2", "does not have n_levels numbers");
  if (m.inv_level_sigma2.size() != levels) json.fail("inv_level_sigma2", "does not have n_levels numbers");
  if (!(m.bounds.max_x > m.bounds.min_x)) json.fail("mnMaxX", "is not above mnMinX");
  if (!(m.bounds.max_y > m.bounds.min_y)) json.fail("mnMaxY", "is not above mnMinY");
  if (m.grid_columns < 1) json.fail("grid_cols", "is not positive");
  if (m.grid_rows < 1) json.fail("grid_rows", "is not positive");
  if (!(m.cell_width_inverse > 0)) json.fail("grid_el_w_inv", "is not positive");
  if (!(m.cell_height_inverse > 0)) json.fail("grid_el_h_inv", "is not positive");
  if (json.has("noise_px") && !(m.noise_px >= 0)) json.fail("noise_px", "is negative");
  if (json.has("disparity_noise_px") && !(m.disparity_noise_px >= 0)) json.fail("disparity_noise_px", "is negative");
}

}  // namespace detail

/// Reads a recording's meta.json. Throws bad_file naming file, key and reason.
inline recording_meta read_recording_meta(const std::filesystem::path& file) {
  const detail::json_reader json(file);
  recording_meta m;
  m.sensor = json.get<std::string>("sensor");
  m.model = json.get<std::string>("model");
  m.width = json.get<int>("width"), m.height = json.get<int>("height");
  m.camera1 = json.get<std::vector<double>>("camera1");
  m.camera2 = json.get<std::vector<double>>("camera2", {});
  m.T_lr = json.pose("Tlr"), m.T_rl = json.pose("Trl"), m.T_bc = json.pose("Tbc");
  m.bf = json.get<double>("bf"), m.baseline = json.get<double>("b"), m.close_depth = json.get<double>("thDepth");
  m.levels = json.get<int>("n_levels");
  m.scale_factor = json.get<float>("scale_factor"), m.log_scale_factor = json.get<float>("log_scale_factor");
  m.scale_factors = json.get<std::vector<float>>("scale_factors");
  m.level_sigma2 = json.get<std::vector<float>>("level_sigma2");
  m.inv_level_sigma2 = json.get<std::vector<float>>("inv_level_sigma2");
  m.bounds = {json.get<float>("mnMinX"), json.get<float>("mnMinY"), json.get<float>("mnMaxX"),
              json.get<float>("mnMaxY")};
  m.grid_columns = json.get<int>("grid_cols"), m.grid_rows = json.get<int>("grid_rows");
  m.cell_width_inverse = json.get<float>("grid_el_w_inv"), m.cell_height_inverse = json.get<float>("grid_el_h_inv");
  m.imu_noise_variance = json.get<std::vector<double>>("imu_noise_cov_diag", {});
  m.imu_walk_variance = json.get<std::vector<double>>("imu_walk_cov_diag", {});
  m.noise_px = json.get("noise_px", -1.0), m.disparity_noise_px = json.get("disparity_noise_px", -1.0);
  m.snapshots = json.get<std::vector<std::int32_t>>("snapshots", {});
  m.frames = json.get("frames", -1), m.frames_not_ok = json.get("frames_not_ok", -1);
  m.keyframes_inserted = json.get("keyframes_inserted", -1);
  m.keyframes_alive_end = json.get("keyframes_alive_end", -1);
  m.map_points_end = json.get("map_points_end", -1), m.maps = json.get("maps", 1);
  m.ate_kf_rmse_m = json.get("ate_kf_rmse_m", -1.0), m.ate_live_rmse_m = json.get("ate_live_rmse_m", -1.0);
  m.sim3_scale = json.get("sim3_scale", -1.0);
  if (json.has("events")) {
    if (!json.json()["events"].is_array()) json.fail("events", "is not a list");
    for (const auto& e : json.json()["events"]) {
      if (!e.is_object()) json.fail("events", "holds something that is not an object");
      try {
        m.events.push_back({e.at("iter").get<std::int32_t>(), e.at("event").get<std::string>(),
                            e.value("imu_initialized_before", 0), e.value("after", 0), e.value("scale", 1.0)});
      } catch (const nlohmann::json::exception&) {
        json.fail("events", "holds an event without iter and event, or of the wrong type");
      }
    }
  }
  detail::check_meta(json, m);
  return m;
}

/// Writes a meta.json that read_recording_meta reads back as it is. Throws bad_file if it cannot.
inline void write_recording_meta(const std::filesystem::path& file, const recording_meta& m) {
  nlohmann::ordered_json json;
  json["sensor"] = m.sensor, json["frames"] = m.frames, json["frames_not_ok"] = m.frames_not_ok;
  json["keyframes_inserted"] = m.keyframes_inserted, json["keyframes_alive_end"] = m.keyframes_alive_end;
  json["map_points_end"] = m.map_points_end, json["maps"] = m.maps;
  json["ate_kf_rmse_m"] = m.ate_kf_rmse_m, json["ate_live_rmse_m"] = m.ate_live_rmse_m;
  json["sim3_scale"] = m.sim3_scale, json["width"] = m.width, json["height"] = m.height;
  json["bf"] = m.bf, json["b"] = m.baseline, json["thDepth"] = m.close_depth;
  json["camera1"] = m.camera1, json["camera2"] = m.camera2, json["model"] = m.model;
  json["Tlr"] = detail::numbers(m.T_lr), json["Trl"] = detail::numbers(m.T_rl), json["Tbc"] = detail::numbers(m.T_bc);
  json["scale_factors"] = m.scale_factors, json["level_sigma2"] = m.level_sigma2;
  json["inv_level_sigma2"] = m.inv_level_sigma2, json["scale_factor"] = m.scale_factor;
  json["log_scale_factor"] = m.log_scale_factor, json["n_levels"] = m.levels;
  json["mnMinX"] = m.bounds.min_x, json["mnMinY"] = m.bounds.min_y;
  json["mnMaxX"] = m.bounds.max_x, json["mnMaxY"] = m.bounds.max_y;
  json["grid_cols"] = m.grid_columns, json["grid_rows"] = m.grid_rows;
  json["grid_el_w_inv"] = m.cell_width_inverse, json["grid_el_h_inv"] = m.cell_height_inverse;
  json["imu_noise_cov_diag"] = m.imu_noise_variance, json["imu_walk_cov_diag"] = m.imu_walk_variance;
  if (m.noise_px >= 0) json["noise_px"] = m.noise_px;
  if (m.disparity_noise_px >= 0) json["disparity_noise_px"] = m.disparity_noise_px;
  json["events"] = nlohmann::ordered_json::array();
  for (const auto& e : m.events)
    json["events"].push_back({{"iter", e.iteration},
                              {"event", e.name},
                              {"scale", e.scale},
                              {"imu_initialized_before", e.imu_initialized_before},
                              {"after", e.imu_initialized_after}});
  json["snapshots"] = m.snapshots;
  std::ofstream stream(file, std::ios::binary);
  stream << json.dump(1) << '\n';
  if (!stream.flush()) throw bad_file("turbomap: " + file.string() + ": could not be written");
}

TURBOMAP_END_NAMESPACE

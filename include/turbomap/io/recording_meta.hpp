// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// `meta.json` of a recording: from and to recording_meta.

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "../config.hpp"
#include "../error.hpp"
#include "file_handle.hpp"
#include "json_reader.hpp"
#include "recording_data.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

inline std::vector<float> numbers(const rigid_transform<float>& T) {
  return {T.qx, T.qy, T.qz, T.qw, T.tx, T.ty, T.tz};
}

/// Rules of recording_meta; fail(key, reason) throws.
template <class Fail>
class meta_checks {
 public:
  explicit meta_checks(const Fail& fail) : fail_(fail) {}

  void operator()(const recording_meta& m) const {
    if (m.sensor != "stereo" && m.sensor != "inertial" && m.sensor != "monocular")
      fail_("sensor", "is '" + m.sensor + "', not stereo, inertial or monocular");
    if (!m.is_fisheye() && m.model != "Pinhole") fail_("model", "is '" + m.model + "', not Pinhole or KannalaBrandt8");
    positive("width", m.width), positive("height", m.height);
    camera("camera1", m.camera1, m.is_fisheye());
    if (!m.camera2.empty()) camera("camera2", m.camera2, m.is_fisheye());
    pose("Tlr", m.T_lr), pose("Trl", m.T_rl), pose("Tbc", m.T_bc);
    not_negative("bf", m.bf), not_negative("b", m.baseline), not_negative("thDepth", m.close_depth);
    if (m.levels < 1 || m.levels > 255) fail_("n_levels", "is not in 1..255");
    if (!(m.scale_factor > 1)) fail_("scale_factor", "is not above 1");
    finite("scale_factor", m.scale_factor), finite("log_scale_factor", m.log_scale_factor);
    per_level("scale_factors", m.scale_factors, m.levels), per_level("level_sigma2", m.level_sigma2, m.levels);
    per_level("inv_level_sigma2", m.inv_level_sigma2, m.levels);
    finite("mnMinX", m.bounds.min_x), finite("mnMaxX", m.bounds.max_x);
    finite("mnMinY", m.bounds.min_y), finite("mnMaxY", m.bounds.max_y);
    if (!(m.bounds.max_x > m.bounds.min_x)) fail_("mnMaxX", "is not above mnMinX");
    if (!(m.bounds.max_y > m.bounds.min_y)) fail_("mnMaxY", "is not above mnMinY");
    positive("grid_cols", m.grid_columns), positive("grid_rows", m.grid_rows);
    // The limits of the cell index of keyframe_store.
    if (m.grid_columns > 0xFFFF) fail_("grid_cols", "is above 65535");
    if (m.grid_rows > 0x7FFF) fail_("grid_rows", "is above 32767");
    positive("grid_el_w_inv", m.cell_width_inverse), positive("grid_el_h_inv", m.cell_height_inverse);
    imu("imu_noise_cov_diag", m.imu_noise_variance), imu("imu_walk_cov_diag", m.imu_walk_variance);
    not_negative_or_unknown("noise_px", m.noise_px);
    not_negative_or_unknown("disparity_noise_px", m.disparity_noise_px);
    if (m.keypoint_pixels != "full_image" && m.keypoint_pixels != "multiplied" && m.keypoint_pixels != "unknown")
      fail_("keypoint_pixels", "is '" + m.keypoint_pixels + "', not full_image, multiplied or unknown");
    for (const auto& e : m.events) finite("events", e.scale);
    finite("ate_kf_rmse_m", m.ate_kf_rmse_m), finite("ate_live_rmse_m", m.ate_live_rmse_m);
    finite("sim3_scale", m.sim3_scale);
  }

 private:
  void finite(const char* key, double x) const {
    if (!std::isfinite(x)) fail_(key, "is not finite");
  }
  void positive(const char* key, double x) const {
    finite(key, x);
    if (!(x > 0)) fail_(key, "is not positive");
  }
  void not_negative(const char* key, double x) const {
    finite(key, x);
    if (x < 0) fail_(key, "is negative");
  }
  void not_negative_or_unknown(const char* key, double x) const {
    if (x != -1) not_negative(key, x);
  }
  void camera(const char* key, const std::vector<double>& parameters, bool is_fisheye) const {
    const std::size_t count = is_fisheye ? 8 : 4;
    if (parameters.size() != count) fail_(key, "needs " + std::to_string(count) + " numbers");
    for (const double x : parameters) finite(key, x);
    if (!(parameters[0] > 0 && parameters[1] > 0)) fail_(key, "has a focal length that is not positive");
  }
  void pose(const char* key, const rigid_transform<float>& T) const {
    if (!(std::abs(T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw - 1) < 1e-3F))
      fail_(key, "does not begin with a unit quaternion");
    finite(key, T.tx), finite(key, T.ty), finite(key, T.tz);
  }
  void per_level(const char* key, const std::vector<float>& values, int levels) const {
    if (values.size() != static_cast<std::size_t>(levels)) fail_(key, "does not have n_levels numbers");
    for (const float x : values) positive(key, x);
  }
  void imu(const char* key, const std::vector<double>& variances) const {
    if (!variances.empty() && variances.size() != 6) fail_(key, "needs 6 numbers or none");
    for (const double x : variances) not_negative(key, x);
  }

  const Fail& fail_;
};
template <class Fail>
void check_meta(const recording_meta& m, const Fail& fail) {
  meta_checks<Fail>{fail}(m);
}

inline recording_meta meta_of(const json_reader& json) {
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
  m.keypoint_pixels = json.get<std::string>("keypoint_pixels", "unknown");
  m.snapshots = json.get<std::vector<std::int32_t>>("snapshots", {});
  m.frames = json.get("frames", -1), m.frames_not_ok = json.get("frames_not_ok", -1);
  m.keyframes_inserted = json.get("keyframes_inserted", -1);
  m.keyframes_alive_end = json.get("keyframes_alive_end", -1);
  m.map_points_end = json.get("map_points_end", -1), m.maps = json.get("maps", 1);
  m.ate_kf_rmse_m = json.get("ate_kf_rmse_m", -1.0), m.ate_live_rmse_m = json.get("ate_live_rmse_m", -1.0);
  m.sim3_scale = json.get("sim3_scale", -1.0);
  if (json.has("events")) {
    if (!json.json()["events"].is_array()) json.fail("events", "is not a list");
    const recording_event usual;
    for (const auto& e : json.json()["events"]) {
      if (!e.is_object()) json.fail("events", "holds something that is not an object");
      m.events.push_back({json.member<std::int32_t>("events", e, "iter"),
                          json.member<std::string>("events", e, "event"),
                          json.member("events", e, "imu_initialized_before", &usual.imu_initialized_before),
                          json.member("events", e, "after", &usual.imu_initialized_after),
                          json.member("events", e, "scale", &usual.scale)});
    }
  }
  check_meta(m, [&](const char* key, const std::string& reason) { json.fail(key, reason); });
  return m;
}

/// The text of a meta.json that is read back as it is, as the reader itself finds. Throws bad_file naming `file`, key and
/// reason.
inline std::string meta_text(const recording_meta& m, const std::filesystem::path& file) {
  check_meta(m, [&](const char* key, const std::string& reason) {
    throw bad_file("turbomap: " + file.string() + ": key '" + key + "': " + reason);
  });
  nlohmann::ordered_json json;
  json["sensor"] = m.sensor, json["frames"] = m.frames, json["frames_not_ok"] = m.frames_not_ok;
  json["keyframes_inserted"] = m.keyframes_inserted, json["keyframes_alive_end"] = m.keyframes_alive_end;
  json["map_points_end"] = m.map_points_end, json["maps"] = m.maps;
  json["ate_kf_rmse_m"] = m.ate_kf_rmse_m, json["ate_live_rmse_m"] = m.ate_live_rmse_m;
  json["sim3_scale"] = m.sim3_scale, json["width"] = m.width, json["height"] = m.height;
  json["bf"] = m.bf, json["b"] = m.baseline, json["thDepth"] = m.close_depth;
  json["camera1"] = m.camera1, json["camera2"] = m.camera2, json["model"] = m.model;
  json["Tlr"] = numbers(m.T_lr), json["Trl"] = numbers(m.T_rl), json["Tbc"] = numbers(m.T_bc);
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
  if (m.keypoint_pixels != "unknown") json["keypoint_pixels"] = m.keypoint_pixels;
  json["events"] = nlohmann::ordered_json::array();
  for (const auto& e : m.events)
    json["events"].push_back({{"iter", e.iteration},
                              {"event", e.name},
                              {"scale", e.scale},
                              {"imu_initialized_before", e.imu_initialized_before},
                              {"after", e.imu_initialized_after}});
  json["snapshots"] = m.snapshots;
  std::string text;
  try {
    text = json.dump(1) + '\n';
  } catch (const nlohmann::json::exception& e) {
    throw bad_file("turbomap: " + file.string() + ": a string is not UTF-8: " + e.what());
  }
  meta_of(json_reader(file, text));
  return text;
}

}  // namespace detail

/// Reads a recording's meta.json. Throws bad_file naming file, key and reason.
inline recording_meta read_recording_meta(const std::filesystem::path& file) {
  return detail::meta_of(detail::json_reader(file));
}

/// Writes a meta.json that read_recording_meta reads back as it is. Throws bad_file naming file, key and reason if it would
/// be refused, or cannot be written; the file is as before then.
inline void write_recording_meta(const std::filesystem::path& file, const recording_meta& m) {
  const std::string text = detail::meta_text(m, file);
  if (!detail::replace_text_file(file, text)) throw bad_file("turbomap: " + file.string() + ": could not be written");
}

TURBOMAP_END_NAMESPACE

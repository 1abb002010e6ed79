// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The report of a replay: one HTML file that needs nothing else and asks no network. Data travel as JSON in a script
/// element that no browser runs; the page's own script (benchmarks/report/) sets them as text only, so no name can
/// inject anything.

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/error.hpp>

#include "report_data.hpp"

namespace turbomap_replay {
namespace report_detail {

/// Rounded to 1e-4 (0.1 us, 0.1 mm): a third of the digits. Not finite: null, a gap on the page.
inline nlohmann::json number(double x) {
  if (!std::isfinite(x)) return nullptr;
  return std::abs(x) < 1e9 ? std::round(x * 1e4) / 1e4 : x;
}
inline nlohmann::json number(std::int64_t count) { return count < 0 ? nlohmann::json(nullptr) : nlohmann::json(count); }

inline std::string base64(const std::vector<std::uint8_t>& bytes) {
  static constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const auto at = [&](std::size_t k) { return i + k < bytes.size() ? std::uint32_t{bytes[i + k]} : 0U; };
    const std::uint32_t three = at(0) << 16 | at(1) << 8 | at(2);
    for (std::size_t k = 0; k < 4; ++k) {
      text += i + k < bytes.size() + 1 ? digits[three >> (18 - 6 * k) & 63] : '=';
    }
  }
  return text;
}

/// Positions as little-endian float32 x y z, relative to the origin so that a map far from zero keeps its millimetres.
template <class Range, class Position>
std::string packed(const Range& range, const turbomap::vec3<double>& origin, Position position) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(12 * range.size());
  for (const auto& element : range) {
    const turbomap::vec3<double> p = position(element);
    for (const double difference : {p.x - origin.x, p.y - origin.y, p.z - origin.z}) {
      const auto value = static_cast<float>(difference);
      std::uint32_t bits = 0;
      std::memcpy(&bits, &value, sizeof bits);
      for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::uint8_t>(bits >> shift));
    }
  }
  return base64(bytes);
}

inline bool finite(const turbomap::vec3<double>& p) {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}
inline turbomap::vec3<double> origin_of(const report_data& data) {
  for (const auto& k : data.trajectory)
    if (finite(k.centre)) return k.centre;
  for (const auto& p : data.points)
    if (finite(p)) return p;
  return {0, 0, 0};
}

inline nlohmann::json stage(const report_stage& s) {
  return {{"name", s.name},          {"mean", number(s.ms_mean)}, {"median", number(s.ms_median)},
          {"p95", number(s.ms_p95)}, {"max", number(s.ms_max)},   {"peer", number(s.peer_ms_mean)}};
}

/// The sum of what is known; NaN when nothing is.
inline double sum(const std::vector<double>& values) {
  double total = not_known;
  for (const double v : values)
    if (std::isfinite(v)) total = std::isfinite(total) ? total + v : v;
  return total;
}

/// One array per column: shorter than one object per row, and what plots need.
inline nlohmann::json columns(const report_data& data) {
  using json = nlohmann::json;
  json j = json::object();
  const auto column = [&](const char* name, auto value) {
    json& to = j[name] = json::array();
    for (const auto& row : data.rows) to.push_back(number(value(row)));
  };
  const double start = data.rows.empty() ? 0 : data.rows.front().time_s;
  column("time", [&](const auto& r) { return std::isfinite(start) ? r.time_s - start : r.time_s; });
  column("total", [](const auto& r) { return std::isfinite(r.total_ms) ? r.total_ms : sum(r.stage_ms); });
  column("peer_total", [](const auto& r) { return sum(r.peer_stage_ms); });
  column("points", [](const auto& r) { return r.points; });
  column("keyframes", [](const auto& r) { return r.keyframes; });
  column("observations", [](const auto& r) { return r.observations; });
  column("points_created", [](const auto& r) { return r.points_created; });
  column("points_culled", [](const auto& r) { return r.points_culled; });
  column("merged", [](const auto& r) { return r.merged; });
  column("observations_added", [](const auto& r) { return r.observations_added; });
  column("keyframes_culled", [](const auto& r) { return r.keyframes_culled; });
  j["stage_ms"] = j["peer_ms"] = j["skipped"] = j["cut"] = json::array();
  for (std::size_t s = 0; s < data.stages.size(); ++s) {
    json ms = json::array(), peer = json::array(), skipped = json::array(), cut = json::array();
    for (std::size_t i = 0; i < data.rows.size(); ++i) {
      const auto& row = data.rows[i];
      ms.push_back(row.stage_ms.empty() ? json(nullptr) : number(row.stage_ms[s]));
      peer.push_back(row.peer_stage_ms.empty() ? json(nullptr) : number(row.peer_stage_ms[s]));
      if (!row.skipped.empty() && row.skipped[s] != 0) skipped.push_back(i);
      if (!row.cut.empty() && row.cut[s] != 0) cut.push_back(i);
    }
    j["stage_ms"].push_back(std::move(ms)), j["peer_ms"].push_back(std::move(peer));
    j["skipped"].push_back(std::move(skipped)), j["cut"].push_back(std::move(cut));
  }
  return j;
}

inline void validate(const report_data& data) {
  using turbomap::require;
  const auto fits = [&](std::size_t size, const char* argument) {
    require(size == 0 || size == data.stages.size(), argument, size, "must have one element per stage, or none");
  };
  for (const auto& row : data.rows) {
    fits(row.stage_ms.size(), "report_data.rows[].stage_ms.size()");
    fits(row.peer_stage_ms.size(), "report_data.rows[].peer_stage_ms.size()");
    fits(row.skipped.size(), "report_data.rows[].skipped.size()");
    fits(row.cut.size(), "report_data.rows[].cut.size()");
  }
  for (const auto& event : data.events)
    require(event.row < data.rows.size(), "report_data.events[].row", event.row, "must be a row");
  const std::size_t counts = data.point_observations.size(), keyframes = data.trajectory.size();
  require(counts == 0 || counts == data.points.size(), "report_data.point_observations.size()", counts,
          "must be the number of points, or 0");
  require(keyframes == 0 || keyframes == data.rows.size(), "report_data.trajectory.size()", keyframes,
          "must be the number of rows, or 0");
}

inline nlohmann::json to_json(const report_data& data) {
  using json = nlohmann::json;
  using vec3 = turbomap::vec3<double>;
  const vec3 origin = origin_of(data);
  const auto itself = [](const vec3& p) { return p; };
  json facts = json::array(), notes = json::array(), stages = json::array(), alive = json::array(),
       events = json::array();
  for (const auto& [name, value] : data.facts) facts.push_back(json::array({name, value}));
  for (const auto& note : data.notes) notes.push_back(note);
  for (const auto& s : data.stages) stages.push_back(stage(s));
  for (const auto& k : data.trajectory) alive.push_back(k.alive ? 1 : 0);
  for (const auto& e : data.events) events.push_back({{"row", e.row}, {"label", e.label}});
  return {{"recording", data.recording},
          {"policy", data.policy},
          {"machine", data.machine},
          {"peer", data.peer},
          {"facts", facts},
          {"notes", notes},
          {"keyframes", number(data.keyframes)},
          {"keyframes_left", number(data.keyframes_left)},
          {"map_points", number(data.map_points)},
          {"skipped", number(data.skipped)},
          {"ate", number(data.ate_rmse_m)},
          {"peer_ate", number(data.peer_ate_rmse_m)},
          {"stages", stages},
          {"total", stage(data.total)},
          {"warm_up", data.warm_up},
          {"rows", columns(data)},
          {"events", events},
          {"origin", {number(origin.x), number(origin.y), number(origin.z)}},
          {"up", {number(data.up.x), number(data.up.y), number(data.up.z)}},
          {"points", packed(data.points, origin, itself)},
          {"point_observations", data.point_observations},
          {"trajectory", packed(data.trajectory, origin, [](const report_keyframe& k) { return k.centre; })},
          {"alive", alive},
          {"ground_truth", packed(data.ground_truth, origin, itself)},
          {"peer_trajectory", packed(data.peer_trajectory, origin, itself)}};
}

/// The JSON as text that may stand in a script element: '<' occurs in strings only and is written as an escape, so
/// neither an end tag nor a comment can begin. Bytes that are not UTF-8 (file names) become U+FFFD.
inline std::string embedded(const nlohmann::json& j) {
  const std::string text = j.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  std::string safe;
  safe.reserve(text.size());
  for (const char c : text) {
    if (c == '<')
      safe += "\\u003c";
    else
      safe += c;
  }
  return safe;
}

}  // namespace report_detail

/// The page: 50 KB, 20 bytes per point, 250 bytes per keyframe. Throws std::invalid_argument when sizes in `data` disagree.
inline std::string report_html(const report_data& data) {
  static constexpr const char* css =
#include "report/report.css.inc"
      ;
  static constexpr const char* body =
#include "report/report.html.inc"
      ;
  static constexpr const char* scripts[] = {
#include "report/common.js.inc"
      ,
#include "report/view.js.inc"
      ,
#include "report/view_controls.js.inc"
      ,
#include "report/plot.js.inc"
      ,
#include "report/charts.js.inc"
      ,
#include "report/report.js.inc"
  };
  report_detail::validate(data);
  std::string page =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
      "script-src 'unsafe-inline'\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<title>TurboMap replay</title>\n<style>";
  page.append(css).append("</style>\n</head>\n").append(body);
  page += "<script type=\"application/json\" id=\"data\">";
  page += report_detail::embedded(report_detail::to_json(data));
  page += "</script>\n<script>\n'use strict';\n(() => {\n";
  for (const char* script : scripts) page += script;
  return page += "})();\n</script>\n</body>\n</html>\n";
}

/// Writes the report. Throws std::invalid_argument when sizes in `data` disagree (nothing is written then), and
/// std::runtime_error, naming the file, when it cannot be written.
inline void write_report(const std::filesystem::path& file, const report_data& data) {
  const std::string page = report_html(data);
  std::ofstream stream(file, std::ios::binary);
  stream.write(page.data(), static_cast<std::streamsize>(page.size()));
  if (!stream.flush()) throw std::runtime_error(file.string() + ": cannot be written");
}

}  // namespace turbomap_replay

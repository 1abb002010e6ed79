// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether mapping becomes slower while the map grows: medians per fifth of a replay, beside how much each keyframe shares with
/// others, and the same as a table (CSV) or a plot (SVG).

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/mapping/duration_statistics.hpp>
#include <turbomap/mapping/mapping_report.hpp>

#include "loop.hpp"

namespace turbomap_replay {

/// One figure of each keyframe, by name.
struct growth_column {
  std::string name;
  std::vector<double> values;

  /// Of the rows [begin, end).
  double median(std::size_t begin, std::size_t end) const {
    turbomap::duration_statistics part;
    for (std::size_t i = begin; i < end; ++i) part.add(values[i]);
    return part.quantile(0.5);
  }
};

/// Stages in ms ('process' with the insertion), their sum, the sum without adjustment, and what they depend on.
inline std::vector<growth_column> growth_columns(const std::vector<replay_row>& rows) {
  std::vector<growth_column> columns;
  const auto add = [&](const char* name, auto value) {
    columns.push_back({name, {}});
    for (const replay_row& row : rows) columns.back().values.push_back(static_cast<double>(value(row)));
  };
  for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) {
    const auto stage = static_cast<turbomap::mapping_stage>(s);
    add(turbomap::to_string(stage), [stage](const replay_row& row) { return row.ms(stage); });
  }
  add("total", [](const replay_row& row) { return row.total_ms; });
  add("without_adjustment",
      [](const replay_row& row) { return row.total_ms - row.report.ms[turbomap::mapping_stage::adjustment]; });
  add("points_seen", [](const replay_row& row) { return row.points_seen; });
  add("views_per_point", [](const replay_row& row) {
    return row.points_seen == 0 ? 0.0 : static_cast<double>(row.views) / static_cast<double>(row.points_seen);
  });
  add("fusion_targets", [](const replay_row& row) { return row.report.fusion_targets; });
  add("free_keyframes", [](const replay_row& row) { return row.report.adjustment.free_keyframes; });
  add("fixed_keyframes", [](const replay_row& row) { return row.report.adjustment.fixed_keyframes; });
  add("points_updated", [](const replay_row& row) { return row.report.points_updated; });
  add("keyframes_culled", [](const replay_row& row) { return row.report.keyframes_culled.size(); });
  add("keyframes", [](const replay_row& row) { return row.keyframes; });
  add("points", [](const replay_row& row) { return row.points; });
  return columns;
}

inline constexpr std::size_t growth_parts = 5;

/// Medians per fifth, as a table; the same by name of the column for the JSON. Nothing for fewer keyframes than parts.
inline nlohmann::json print_growth(const std::vector<growth_column>& columns) {
  nlohmann::json json;
  const std::size_t rows = columns.front().values.size();
  if (rows < growth_parts) return json;
  std::printf("%-20s", "median of fifth");
  for (std::size_t part = 1; part <= growth_parts; ++part) std::printf(" %9zu", part);
  std::printf(" %9s\n", "last/2nd");
  for (const growth_column& c : columns) {
    std::printf("%-20s", c.name.c_str());
    std::vector<double> medians;
    for (std::size_t part = 0; part < growth_parts; ++part) {
      medians.push_back(c.median(part * rows / growth_parts, (part + 1) * rows / growth_parts));
      std::printf(" %9.3f", medians.back());
    }
    std::printf(" %9.2f\n", medians[1] > 0 ? medians.back() / medians[1] : 1.0);
    json[c.name] = medians;
  }
  return json;
}

inline void write_growth_csv(std::ofstream& file, const std::vector<growth_column>& columns) {
  file << "keyframe";
  for (const growth_column& c : columns) file << ',' << c.name;
  file << '\n';
  for (std::size_t i = 0; i < columns.front().values.size(); ++i) {
    file << i;
    for (const growth_column& c : columns) file << ',' << c.values[i];
    file << '\n';
  }
}

/// Running medians of the stages whose time grows, against the keyframe.
inline void write_growth_svg(std::ofstream& file, const std::vector<growth_column>& columns) {
  constexpr double left = 50, right = 560, top = 12, bottom = 270;
  constexpr std::size_t steps = 100;
  const std::pair<const char*, const char*> shown[]{
      {"without_adjustment", "#222"}, {"process", "#06c"},        {"search", "#c60"}, {"fusion", "#090"},
      {"keyframe_culling", "#b0b"},   {"views_per_point", "#999"}};
  const std::size_t rows = columns.front().values.size();
  std::vector<std::vector<double>> lines;
  double most = 1e-3;
  for (const auto& s : shown) {
    const auto c =
        std::find_if(columns.begin(), columns.end(), [&](const growth_column& x) { return x.name == s.first; });
    lines.emplace_back();
    for (std::size_t i = 0; i < std::min(steps, rows); ++i) {
      const std::size_t begin = i * rows / steps, end = std::min(rows, std::max(begin + 1, (i + 1) * rows / steps));
      // Views are drawn at a tenth, to share the axis.
      lines.back().push_back(c->median(begin, end) * (c->name == "views_per_point" ? 0.1 : 1));
      most = std::max(most, lines.back().back());
    }
  }
  file << "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 720 300\" font-family=\"sans-serif\" "
          "font-size=\"12\" "
          "role=\"img\" aria-label=\"Milliseconds per keyframe against the keyframe\">\n<!-- SPDX-FileCopyrightText: "
          "Copyright 2026 The TurboMap authors; SPDX-License-Identifier: Apache-2.0 -->\n<rect width=\"720\" "
          "height=\"300\" fill=\"#fff\"/>\n";
  char text[256];
  for (int tick = 0; tick <= 4; ++tick) {
    const double y = bottom - (bottom - top) * tick / 4;
    std::snprintf(text, sizeof text,
                  "<path d=\"M%g %gH%g\" stroke=\"#ddd\"/><text x=\"%g\" y=\"%g\" text-anchor=\"end\">%.2g</text>\n",
                  left, y, right, left - 6, y + 4, most * tick / 4);
    file << text;
  }
  std::snprintf(text, sizeof text, "<text x=\"%g\" y=\"%g\" text-anchor=\"end\">keyframe %zu</text>\n", right,
                bottom + 20, rows);
  file << text << "<text x=\"" << left << "\" y=\"" << bottom + 20 << "\">ms, medians of 1 %</text>\n";
  for (std::size_t l = 0; l < lines.size(); ++l) {
    file << "<path fill=\"none\" stroke=\"" << shown[l].second << "\" d=\"";
    for (std::size_t i = 0; i < lines[l].size(); ++i) {
      std::snprintf(text, sizeof text, "%c%.1f %.1f", i == 0 ? 'M' : 'L',
                    left + (right - left) * static_cast<double>(i + 1) / static_cast<double>(lines[l].size()),
                    bottom - (bottom - top) * lines[l][i] / most);
      file << text;
    }
    const bool views = std::string(shown[l].first) == "views_per_point";
    file << "\"/><text x=\"" << right + 8 << "\" y=\"" << top + 16 * static_cast<double>(l + 1) << "\" fill=\""
         << shown[l].second << "\">" << (views ? "views per point / 10" : shown[l].first) << "</text>\n";
  }
  file << "</svg>\n";
}

/// Throws std::runtime_error when the file cannot be written.
inline void write_growth(const std::filesystem::path& path, const std::vector<growth_column>& columns) {
  std::ofstream file(path);
  if (path.extension() == ".svg")
    write_growth_svg(file, columns);
  else
    write_growth_csv(file, columns);
  if (!file.flush()) throw std::runtime_error(path.string() + ": cannot be written");
}

}  // namespace turbomap_replay

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The report of a replay: the page holds what it was given, nothing in a name becomes part of the page, nothing is
// fetched, and what cannot be shown or written is refused. How it looks was looked at in a browser (docs/report.md).

#include "replay/report.hpp"
#include "replay/report_paths.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "support/files.hpp"

using turbomap_replay::not_known;
using turbomap_replay::report_data;
using turbomap_test::has;

namespace {

using vec3 = turbomap::vec3<double>;

/// Two stages, three keyframes: one with a gap, one skipped and cut.
report_data small_data() {
  report_data d;
  d.recording = "somewhere/run1", d.policy = "seq", d.machine = "a machine";
  d.keyframes = 3, d.keyframes_left = 2, d.map_points = 4, d.skipped = 1;
  d.ate_rmse_m = 0.01234567, d.peer_ate_rmse_m = 0.02;
  d.stages = {{"search", 1.5, 1.4, 2.5, 3.5, 4.5}, {"fusion", 2.5, 2.25, 3, 4}};
  d.total = {"total", 4, 3.5, 5, 7, 9};
  d.rows.resize(3);
  d.rows[0].time_s = 1000.5, d.rows[1].time_s = 1000.75, d.rows[2].time_s = not_known;
  d.rows[0].stage_ms = {1, 2.00004}, d.rows[1].stage_ms = {3, not_known};
  d.rows[1].peer_stage_ms = {5, 6}, d.rows[1].skipped = {0, 1}, d.rows[2].cut = {1, 0};
  d.rows[2].total_ms = 9;
  d.rows[1].points = 4, d.rows[1].keyframes = 2, d.rows[1].observations = 8, d.rows[1].points_created = 3;
  d.rows[1].points_culled = 1, d.rows[1].merged = 5, d.rows[1].observations_added = 6, d.rows[1].keyframes_culled = 0;
  d.events = {{2, "jump"}};
  d.points = {{4e6 + 0.001, 1, 2}, {4e6, not_known, 2}, {4e6 - 7.5, -1, -2}, {4e6, 0, 0}};
  d.point_observations = {2, 3, 4, 50};
  d.trajectory = {{{4e6, 0, 0}, true}, {{4e6 + 1, 0, 0}, false}, {{4e6 + 2, 0, 0.25}, true}};
  d.ground_truth = {{4e6, 0.5, 0}};
  return d;
}

/// What the page's script reads.
std::string data_text(const std::string& page) {
  const std::string begin = "<script type=\"application/json\" id=\"data\">";
  const std::size_t from = page.find(begin) + begin.size();
  return page.substr(from, page.find("</script>", from) - from);
}
nlohmann::json data_of(const std::string& page) { return nlohmann::json::parse(data_text(page)); }

/// The positions that the page's script decodes, written for reading: six bits a character.
std::vector<float> floats_of(const std::string& base64) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<bool> bits;
  for (const char c : base64) {
    if (c == '=') break;
    for (int b = 5; b >= 0; --b) bits.push_back((digits.find(c) >> b & 1) != 0);
  }
  std::vector<float> values;
  for (std::size_t at = 0; at + 32 <= bits.size(); at += 32) {
    std::uint32_t word = 0;
    for (std::size_t byte = 0; byte < 4; ++byte)
      for (std::size_t b = 0; b < 8; ++b)
        word |= static_cast<std::uint32_t>(bits[at + 8 * byte + b]) << (8 * byte + 7 - b);
    float value = 0;
    std::memcpy(&value, &word, sizeof value);
    values.push_back(value);
  }
  return values;
}

std::size_t occurrences(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

/// What stands between each `begin` and the next `end`.
std::vector<std::string> between(const std::string& text, const std::string& begin, char end) {
  std::vector<std::string> found;
  for (std::size_t at = text.find(begin); at != std::string::npos; at = text.find(begin, at + 1))
    found.push_back(text.substr(at + begin.size(), text.find(end, at + begin.size()) - at - begin.size()));
  return found;
}

/// The message of the std::invalid_argument that writing throws; a message of its own when it throws none.
std::string refusal(const report_data& data) {
  try {
    turbomap_replay::report_html(data);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing thrown";
}

}  // namespace

TEST_CASE("the page holds the figures that it was given, and gaps where there are none") {
  const turbomap_test::temporary_directory folder;
  turbomap_replay::write_report(folder / "report.html", small_data());
  const auto j = data_of(turbomap_test::file_bytes(folder / "report.html"));
  CHECK(j["recording"] == "somewhere/run1");
  CHECK(j["policy"] == "seq");
  CHECK(j["machine"] == "a machine");
  CHECK(j["keyframes"] == 3);
  CHECK(j["keyframes_left"] == 2);
  CHECK(j["map_points"] == 4);
  CHECK(j["skipped"] == 1);
  CHECK(j["ate"] == 0.0123);
  CHECK(j["peer_ate"] == 0.02);
  CHECK(
      j["stages"][0] ==
      nlohmann::json({{"name", "search"}, {"mean", 1.5}, {"median", 1.4}, {"p95", 2.5}, {"max", 3.5}, {"peer", 4.5}}));
  CHECK(j["stages"][1]["peer"].is_null());
  CHECK(j["total"]["p95"] == 5);
  const auto& rows = j["rows"];
  CHECK(rows["time"] == nlohmann::json({0, 0.25, nullptr}));
  CHECK(rows["stage_ms"] == nlohmann::json({{1, 3, nullptr}, {2, nullptr, nullptr}}));
  CHECK(rows["peer_ms"] == nlohmann::json({{nullptr, 5, nullptr}, {nullptr, 6, nullptr}}));
  CHECK(rows["total"] == nlohmann::json({3, 3, 9}));  // sums of what is known; as given in the last
  CHECK(rows["peer_total"] == nlohmann::json({nullptr, 11, nullptr}));
  CHECK(rows["skipped"] == nlohmann::json::parse("[[], [1]]"));
  CHECK(rows["cut"] == nlohmann::json::parse("[[2], []]"));
  const std::vector<std::pair<const char*, int>> counts = {
      {"points", 4},        {"keyframes", 2}, {"observations", 8},       {"points_created", 3},
      {"points_culled", 1}, {"merged", 5},    {"observations_added", 6}, {"keyframes_culled", 0}};
  for (const auto& count : counts) {
    CAPTURE(count.first);
    CHECK(rows[count.first] == nlohmann::json({nullptr, count.second, nullptr}));
  }
  CHECK(j["events"] == nlohmann::json::parse("[{\"row\": 2, \"label\": \"jump\"}]"));
  CHECK(j["up"] == nlohmann::json({0, -1, 0}));
}

TEST_CASE("positions keep their millimetres far from zero, and a NaN stays one") {
  const auto j = data_of(turbomap_replay::report_html(small_data()));
  CHECK(j["origin"] == nlohmann::json({4e6, 0, 0}));
  const auto points = floats_of(j["points"]);
  REQUIRE(points.size() == 12);
  CHECK(points[0] == doctest::Approx(0.001).epsilon(1e-4));
  CHECK(points[1] == 1);
  CHECK(points[2] == 2);
  CHECK(std::isnan(points[4]));
  CHECK(points[6] == -7.5F);
  CHECK(points[8] == -2);
  CHECK(floats_of(j["trajectory"]) == std::vector<float>{0, 0, 0, 1, 0, 0, 2, 0, 0.25F});
  CHECK(floats_of(j["ground_truth"]) == std::vector<float>{0, 0.5F, 0});
  CHECK(j["peer_trajectory"] == "");
  CHECK(j["alive"] == nlohmann::json({1, 0, 1}));
  CHECK(j["point_observations"] == nlohmann::json({2, 3, 4, 50}));

  // Every length of the last group of three bytes, against RFC 4648, section 10.
  const auto encoded = [](const std::string& text) {
    return turbomap_replay::report_detail::base64({text.begin(), text.end()});
  };
  CHECK(encoded("") == "");
  CHECK(encoded("f") == "Zg==");
  CHECK(encoded("fo") == "Zm8=");
  CHECK(encoded("foo") == "Zm9v");
  CHECK(encoded("foobar") == "Zm9vYmFy");
}

TEST_CASE("nothing in a name becomes part of the page") {
  const std::string evil = "</script><script>alert(1)</script><!-- <img src=x onerror=alert(2)> &amp; \"'\\ </SCRIPT >";
  report_data d = small_data();
  const std::string plain = turbomap_replay::report_html(d);
  d.recording = d.policy = d.machine = d.peer = d.stages[0].name = d.total.name = d.events[0].label = evil;
  d.facts = {{evil, evil}};
  d.notes = {evil};
  const std::string page = turbomap_replay::report_html(d);
  for (const char* part : {"<script", "</script", "<!--", "<img", "</SCRIPT"}) {
    CAPTURE(part);
    CHECK(occurrences(page, part) == occurrences(plain, part));
  }
  CHECK(occurrences(page, "<script") == 2);
  CHECK(occurrences(data_text(page), "<") == 0);
  const auto j = data_of(page);
  CHECK(j["recording"] == evil);
  CHECK(j["facts"][0][1] == evil);
  CHECK(j["notes"][0] == evil);
  CHECK(j["stages"][0]["name"] == evil);
  CHECK(j["events"][0]["label"] == evil);
  // The scripts set text; none of them writes HTML or runs strings.
  for (const char* part : {"innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "new Function"})
    CHECK(occurrences(plain, part) == 0);
}

TEST_CASE("a file name that is not UTF-8 is shown with a replacement") {
  report_data d = small_data();
  d.recording =
      "run\xff"
      "1";
  CHECK(data_of(turbomap_replay::report_html(d))["recording"] ==
        "run\xEF\xBF\xBD"
        "1");
}

TEST_CASE("the page is complete: it names no address, and its scripts find their elements") {
  const std::string page = turbomap_replay::report_html(small_data());
  for (const char* part : {"http:", "https:", " src=", "@import", "url(", "fetch(", "<link", "import("}) {
    CAPTURE(part);
    CHECK(occurrences(page, part) == 0);
  }
  CHECK(has(page, "default-src 'none'"));
  // Compilers differ about trigraphs, and JavaScript has operators that look like them.
  for (const char last : std::string("=/'()!<>-")) CHECK(occurrences(page, std::string("?") + "?" + last) == 0);
  CHECK(page.rfind("<!DOCTYPE html>", 0) == 0);

  const auto ids = between(page, "id=\"", '"'), wanted = between(page, "$('", '\'');
  CHECK(std::set<std::string>(ids.begin(), ids.end()).size() == ids.size());
  CHECK(wanted.size() > 10);
  for (const auto& name : wanted) {
    CAPTURE(name);
    CHECK(std::count(ids.begin(), ids.end(), name) == 1);
  }
}

TEST_CASE("sizes that disagree are refused, and the file stays as it was") {
  const auto with = [](auto change) {
    report_data d = small_data();
    change(d);
    return d;
  };
  CHECK(has(refusal(with([](auto& d) { d.rows[0].stage_ms = {1}; })), "stage_ms.size() = 1"));
  CHECK(has(refusal(with([](auto& d) { d.rows[2].peer_stage_ms = {1, 2, 3}; })), "peer_stage_ms.size() = 3"));
  CHECK(has(refusal(with([](auto& d) { d.rows[1].skipped = {1}; })), "skipped.size() = 1"));
  CHECK(has(refusal(with([](auto& d) { d.rows[1].cut = {1, 0, 0}; })), "cut.size() = 3"));
  CHECK(has(refusal(with([](auto& d) { d.point_observations.pop_back(); })), "point_observations.size() = 3"));
  CHECK(has(refusal(with([](auto& d) { d.trajectory.pop_back(); })), "trajectory.size() = 2"));
  CHECK(has(refusal(with([](auto& d) { d.events[0].row = 3; })), "events[].row = 3"));
  CHECK(refusal(small_data()) == "nothing thrown");

  const turbomap_test::temporary_directory folder;
  turbomap_test::write_bytes(folder / "report.html", "before");
  const auto bad = with([](auto& d) { d.trajectory.pop_back(); });
  CHECK_THROWS_AS(turbomap_replay::write_report(folder / "report.html", bad), std::invalid_argument);
  CHECK(turbomap_test::file_bytes(folder / "report.html") == "before");
}

TEST_CASE("a file that cannot be written is named") {
  const turbomap_test::temporary_directory folder;
  std::vector<std::filesystem::path> files = {folder / "no folder" / "report.html", folder.path()};
  if (std::filesystem::exists("/dev/full")) files.push_back("/dev/full");  // opens, but takes nothing
  for (const auto& file : files) {
    CAPTURE(file);
    std::string message;
    try {
      turbomap_replay::write_report(file, small_data());
    } catch (const std::runtime_error& error) {
      message = error.what();
    }
    CHECK(has(message, file.string()));
  }
}

TEST_CASE("ground truth and the recorded trajectory are brought into the frame of the map") {
  // A world whose z is up; the map is turned, its up is -y, and the recorded system had a frame of its own.
  const auto from_world = [](const vec3& p) { return vec3{p.y + 3, -p.z + 1, -p.x + 2}; };
  const auto near = [](const vec3& a, const vec3& b) { return turbomap::squared_norm(a - b) < 1e-12; };
  turbomap::recording r;
  report_data d;
  std::vector<vec3> centres;
  for (std::int64_t i = 0; i < 8; ++i) {
    const double t = static_cast<double>(i);
    centres.push_back({std::sin(t), std::cos(2 * t), 0.3 * t});
    const vec3& c = centres.back();
    r.gt_t_ns.push_back(i * 100);
    r.gt_T_wb.push_back({c.x, c.y, c.z, 1, 0, 0, 0});
    if (i == 0 || i == 7) continue;  // frames before the first keyframe and after the last
    r.t_ns.push_back(i * 100 + 3);
    r.final_T_cw.push_back(
        {0, 0, 0, 1, static_cast<float>(7 - c.x), static_cast<float>(-c.y), static_cast<float>(-c.z)});
    r.final_alive.push_back(i == 2 ? 0 : 1);
    d.trajectory.push_back({from_world(c), true});
  }
  d.trajectory[3] = {{100, 100, 100}, false};                  // culled far away: must not count
  d.trajectory[4].centre = {not_known, not_known, not_known};  // nor what is not known
  turbomap_replay::add_recorded_paths(r, d);
  REQUIRE(d.ground_truth.size() == 5);  // up to the last keyframe's time: frames 2 to 6
  for (std::size_t i = 0; i < 5; ++i) CHECK(near(d.ground_truth[i], from_world(centres[i + 2])));
  REQUIRE(d.peer_trajectory.size() == 5);  // without the one that it culled
  for (std::size_t i = 0; i < 5; ++i)
    CHECK(std::sqrt(turbomap::squared_norm(d.peer_trajectory[i] - from_world(centres[i == 0 ? 1 : i + 2]))) < 1e-5);
  CHECK(near(d.up, {0, -1, 0}));

  report_data two = d;  // two keyframes left do not define an alignment: nothing changes
  for (std::size_t i = 2; i < two.trajectory.size(); ++i) two.trajectory[i].alive = false;
  two.ground_truth = two.peer_trajectory = {{1, 2, 3}};
  two.up = {0, 0, 1};
  turbomap_replay::add_recorded_paths(r, two);
  CHECK(two.ground_truth.size() == 1);
  CHECK(two.peer_trajectory.size() == 1);
  CHECK(near(two.up, {0, 0, 1}));
  two.trajectory.pop_back();
  CHECK_THROWS_AS(turbomap_replay::add_recorded_paths(r, two), std::invalid_argument);
}

TEST_CASE("a replay of nothing has a report, and a large one stays small") {
  const auto empty = data_of(turbomap_replay::report_html({}));
  CHECK(empty["rows"]["time"].empty());
  CHECK(empty["ate"].is_null());

  report_data d;
  d.stages.resize(7);
  for (std::size_t i = 0; i < 50000; ++i) {
    const double t = 1e-3 * static_cast<double>(i);
    d.points.push_back({std::sin(t) * 7, std::cos(t) * 7, t / 3});
    d.point_observations.push_back(static_cast<std::int32_t>(i % 40));
  }
  d.rows.resize(1000);
  d.trajectory.resize(1000);
  for (auto& row : d.rows) row.stage_ms.assign(7, 1.0 / 3), row.peer_stage_ms.assign(7, 100.0 / 3), row.time_s = 0.1;
  CHECK(turbomap_replay::report_html(d).size() < 1500000);
}

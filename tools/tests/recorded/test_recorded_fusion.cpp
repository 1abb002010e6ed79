// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The search for duplicates, the decision about each and the update of map points on every recorded snapshot, against
// what the recorded peer did; and that the checks see a record that was changed.

#include <thrust/execution_policy.h>

#include <algorithm>
#include <functional>
#include <string>
#include <type_traits>

#include "recorded_checks.hpp"
#include "replay/check_fusion.hpp"
#include "replay/check_map_update.hpp"
#include "support/policies.hpp"

using turbomap_replay::fusion_check;
using turbomap_replay::map_update_check;
using namespace turbomap_test;

namespace {

using turbomap_test::sequential;
using snapshot = turbomap::recording_snapshot;

}  // namespace

TEST_CASE_TEMPLATE("recorded duplicates and actions are reproduced exactly", policy, TURBOMAP_TEST_POLICIES) {
  for (const char* name : recordings) {
    const auto directory = data(std::string("recordings/") + name);
    if (!directory) continue;
    const verdict v = check_recording<fusion_check>(*directory, policy{});
    CAPTURE(std::string(name));
    const nlohmann::json& f = v.json["fusion"];
    MESSAGE(std::string(name) << ": " << f.dump());
    CHECK(v.good);
    const std::size_t entries = number(f, "entries"), calls = number(f, "sequential_entries");
    CHECK(entries > 50'000);
    CHECK(number(f, "code_agree") == entries);
    CHECK(number(f, "index_agree") == entries);
    CHECK(number(f, "distance_agree") == entries);
    CHECK(number(f, "level_agree") == entries);
    CHECK(number(f, "from_record") < entries / 2);
    CHECK(number(f, "matched_entries") > 1'000);
    CHECK(number(f, "matched_agree") == number(f, "matched_entries"));
    CHECK(f["plan_equals_trials"] == nlohmann::json(true));
    CHECK(calls > 50'000);
    CHECK(number(f, "sequential_agree") == calls);
    CHECK(number(f, "sequential_matched_entries") > 1'000);
    CHECK(number(f, "sequential_matched_agree") == number(f, "sequential_matched_entries"));
    // What is taken from the record instead of being computed is a small part of what is matched.
    CHECK(number(f, "sequential_actions_from_record") * 7 < number(f, "sequential_matched_entries"));
  }
}

TEST_CASE_TEMPLATE("recorded updates of map points are reproduced", policy, TURBOMAP_TEST_POLICIES) {
  std::size_t all = 0, recordings_there = 0;
  for (const char* name : recordings) {
    const auto directory = data(std::string("recordings/") + name);
    if (!directory) continue;
    ++recordings_there;
    const verdict v = check_recording<map_update_check>(*directory, policy{});
    CAPTURE(std::string(name));
    const nlohmann::json& u = v.json["map_update"];
    MESSAGE(std::string(name) << ": " << u.dump());
    CHECK(v.good);
    const std::size_t points = number(u, "points");
    all += points;
    CHECK(number(u, "descriptor_agree") == points);
    CHECK(number(u, "normal_range_agree") == points);
    CHECK(number(u, "covisibility_agree") == points);
    CHECK(number(u, "covisible_keyframes") > 50);
    CHECK(number(u, "covisible_keyframes_agree") == number(u, "covisible_keyframes"));
  }
  if (recordings_there == 4) CHECK(all == 18'279);
}

TEST_CASE("the check of fusion sees each thing that is changed") {
  const auto directory = data("recordings/tum_room1_stereo");
  if (!directory) return;
  // Snapshot of iteration 3, the smallest.
  const auto result = [&](const std::function<void(turbomap::fusion_snapshot&)>& change) {
    return check_recording<fusion_check>(*directory, sequential{}, 1, [&](snapshot& s) { change(*s.fusion); });
  };
  const auto row_with = [](const turbomap::recorded_trials& t, std::uint8_t code) {
    return static_cast<std::size_t>(std::find(t.code.begin(), t.code.end(), code) - t.code.begin());
  };
  const auto whole = result([](turbomap::fusion_snapshot&) {});
  REQUIRE(whole.good);
  const auto differs = [&](const char* key, const std::function<void(turbomap::fusion_snapshot&)>& change) {
    const auto v = result(change);
    CAPTURE(std::string(key));
    CHECK_FALSE(v.good);
    CHECK(number(v.json["fusion"], key) + 1 == number(whole.json["fusion"], key));
  };
  differs("code_agree", [&](auto& f) { f.forward.found.code[row_with(f.forward.found, 9)] = 8; });
  differs("index_agree", [&](auto& f) { ++f.forward.found.keypoint[row_with(f.forward.found, 0)]; });
  differs("matched_agree", [&](auto& f) { ++f.forward.found.keypoint[row_with(f.forward.found, 0)]; });
  differs("distance_agree", [&](auto& f) { ++f.backward.found.distance[row_with(f.backward.found, 1)]; });
  differs("level_agree", [&](auto& f) { ++f.backward.found.level[row_with(f.backward.found, 8)]; });
  differs("sequential_agree", [&](auto& f) { ++f.calls.found.distance[row_with(f.calls.found, 1)]; });
  differs("sequential_matched_agree", [&](auto& f) {
    auto& action = f.calls.action;
    *std::find(action.begin(), action.end(), 2) = 3;
  });
  differs("sequential_matched_agree", [&](auto& f) {
    auto& action = f.calls.action;
    *std::find(action.begin(), action.end(), 1) = 2;
  });
}

TEST_CASE("the check of the map update sees each thing that is changed") {
  const auto directory = data("recordings/tum_room1_stereo");
  if (!directory) return;
  const auto differs = [&](const char* key, const std::function<void(turbomap::map_update_snapshot&)>& change) {
    const auto v =
        check_recording<map_update_check>(*directory, sequential{}, 1, [&](snapshot& s) { change(*s.map_update); });
    CAPTURE(std::string(key));
    CHECK_FALSE(v.good);
    CHECK(v.json["map_update"][key] != v.json["map_update"]["points"]);
  };
  differs("descriptor_agree", [](auto& u) { u.descriptor[7][31] ^= 1; });
  differs("normal_range_agree", [](auto& u) { u.normal[7].z += 2e-5F; });
  differs("normal_range_agree", [](auto& u) { u.max_distance[7] *= 1.00003F; });
  differs("normal_range_agree", [](auto& u) { u.min_distance[7] *= 0.99997F; });
  differs("covisibility_agree", [](auto& u) { ++u.covis_w[1]; });
  differs("covisibility_agree", [](auto& u) { u.covis_kf.pop_back(), u.covis_w.pop_back(); });
}

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// turbomap-reduce: which keyframes stay, that what stays is a valid recording, and that points keep their names.

#include <algorithm>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "reduce/reduce.hpp"
#include "scenes/recording_samples.hpp"
#include "support/files.hpp"

namespace {

using indices = std::vector<std::size_t>;
using turbomap_reduce::keep_keyframes;
using turbomap_reduce::minimise;

std::vector<std::string> bytes_of(const turbomap::recording& r) {
  std::vector<std::string> all;
  turbomap::visit_arrays(r, [&](const char*, const auto& rows, turbomap::recording_rows, turbomap::presence) {
    all.emplace_back(reinterpret_cast<const char*>(rows.data()), rows.size() * sizeof(*rows.data()));
  });
  return all;
}

bool has_all(const indices& set, const indices& wanted) {
  return std::includes(set.begin(), set.end(), wanted.begin(), wanted.end());
}

/// Each of `count` keyframes sees one point at keypoint 0, named by the keyframe before and the first one. Keyframe i's
/// descriptor is 32 times the letter 'A' + i.
turbomap::recording one_point(std::int32_t count) {
  auto meta = turbomap_test::small_meta(false);
  meta.sensor = "stereo", meta.imu_noise_variance.clear(), meta.imu_walk_variance.clear(), meta.snapshots.clear();
  meta.events = {{3, "jump", 0, 0, 1}};
  turbomap::recorder record(meta);
  for (std::int32_t i = 0; i < count; ++i) {
    const std::vector<turbomap::keypoint> keypoints(2);
    std::vector<turbomap::descriptor_bytes> descriptors(2);
    descriptors[0].fill(static_cast<std::uint8_t>('A' + i));
    const turbomap::keypoint_reference latest{i - 1, 0}, first{0, 0}, own{i, 0};
    const std::vector<turbomap::point_association> associations{
        {0, i == 0 ? own : latest, i == 0 ? own : first, {1, 2, 3}, i == 0}};
    const std::vector<turbomap::recorded_recent_point> recent(i == 0 ? 0 : 1, {latest, 0, 2, 2});
    turbomap::keyframe_record k;
    k.t_ns = 100 * i, k.previous = i - 1, k.keypoints = keypoints, k.descriptors = descriptors;
    k.associations = associations, k.recent = recent;
    record.add(k);
  }
  return record.data();
}

}  // namespace

TEST_CASE("minimise finds what a failure needs, and nothing else") {
  for (const std::size_t count : {1u, 2u, 3u, 7u, 16u, 100u})
    for (std::size_t seed = 0; seed < 20; ++seed) {
      std::set<std::size_t> chosen;
      for (std::size_t n = 0; n <= seed % 4; ++n) chosen.insert((seed * 7919 + n * 104729) % count);
      const indices wanted(chosen.begin(), chosen.end());
      std::size_t calls = 0;
      const indices found = minimise(count, [&](const indices& tried) {
        ++calls;
        CHECK(!tried.empty());
        return has_all(tried, wanted);
      });
      CHECK(found == wanted);
      CHECK(calls <= count * count + 3 * count);
    }
  std::size_t calls = 0;
  minimise(1024, [&](const indices& tried) { return ++calls, has_all(tried, {700}); });
  CHECK(calls <= 20);  // one to blame: two halves, ten times
}

TEST_CASE(
    "minimise: a failure that needs many, and one that is not monotone, end in one that no single index can leave") {
  const auto many = [](const indices& tried) { return tried.size() >= 9; };
  CHECK(minimise(40, many).size() == 9);
  const auto odd = [](const indices& tried) { return tried.size() % 2 == 1 && tried.size() >= 3; };
  const indices found = minimise(21, odd);
  CHECK(odd(found));
}

TEST_CASE("all keyframes kept: the same arrays") {
  for (const bool fisheye : {false, true}) {
    const turbomap::recording r = turbomap_test::small_recording(fisheye);
    CHECK(bytes_of(keep_keyframes(r, {0, 1, 2})) == bytes_of(r));
  }
  const auto r = one_point(8);
  CHECK(bytes_of(keep_keyframes(r, {0, 1, 2, 3, 4, 5, 6, 7})) == bytes_of(r));
}

TEST_CASE("any keyframes kept: a valid recording") {
  for (const bool fisheye : {false, true}) {
    const turbomap::recording r = turbomap_test::small_recording(fisheye);
    for (unsigned mask = 1; mask < 8; ++mask) {
      indices kept;
      for (std::size_t i = 0; i < 3; ++i)
        if ((mask >> i & 1) != 0) kept.push_back(i);
      const auto reduced = keep_keyframes(r, kept);
      CHECK_NOTHROW(turbomap::validate(reduced));
      CHECK(reduced.keyframe_count() == kept.size());
      CHECK(reduced.meta.snapshots.empty());
      for (std::size_t n = 0; n < kept.size(); ++n) {
        CHECK(reduced.t_ns[n] == r.t_ns[kept[n]]);
        CHECK(reduced.descriptors(n)[4] == r.descriptors(kept[n])[4]);
        CHECK(reduced.prev_kf[n] == static_cast<std::int32_t>(n) - 1);
      }
    }
  }
}

TEST_CASE("a point whose observations are gone is named by one that is left, or made anew") {
  const auto reduced = keep_keyframes(one_point(8), {2, 4, 5, 7});
  turbomap::validate(reduced);
  REQUIRE(reduced.assoc_kp.size() == 4);
  CHECK(reduced.assoc_new == std::vector<std::uint8_t>{1, 0, 0, 0});
  for (std::int32_t n = 0; n < 4; ++n) {
    const auto row = static_cast<std::size_t>(n);
    CHECK(reduced.assoc_ref[row].keyframe == (n == 0 ? 0 : n - 1));  // the latest one that is left
    CHECK(reduced.assoc_ref2[row].keyframe == 0);
    CHECK(reduced.assoc_ref[row].keypoint == 0);
  }
  CHECK(reduced.recent_ref.size() == 3);  // of the first one nobody is left that has seen the point
  REQUIRE(reduced.meta.events.size() == 1);
  CHECK(reduced.meta.events[0].iteration == 0);  // between what were 2 and 4
  CHECK(keep_keyframes(one_point(8), {5, 6}).meta.events.empty());
}

TEST_CASE("both keypoints of a rig that show a point without other views make it together") {
  const auto r = turbomap_test::small_recording(true);
  // Keyframe 1 sees the point of keyframe 0 at keypoint 2 and, in the other image, 4.
  turbomap::recorder record(r.meta);
  for (std::int32_t i = 0; i < 2; ++i) {
    const auto keypoints = r.gather_keypoints(static_cast<std::size_t>(i));
    std::vector<turbomap::point_association> associations{{2, {0, 0}, {0, 0}, {}, false},
                                                          {4, {0, 0}, {0, 0}, {}, false}};
    if (i == 0) associations = {{0, {0, 0}, {0, 0}, {}, true}};
    turbomap::keyframe_record k;
    k.t_ns = i, k.previous = i - 1, k.keypoints = keypoints, k.associations = associations;
    k.descriptors = r.descriptors(static_cast<std::size_t>(i));
    record.add(k);
  }
  const auto reduced = keep_keyframes(record.data(), {1});
  turbomap::validate(reduced);
  CHECK(reduced.assoc_new == std::vector<std::uint8_t>{1, 1});
  for (const auto& ref : reduced.assoc_ref) CHECK((ref.keyframe == 0 && ref.keypoint == 2));
}

TEST_CASE("bad lists of keyframes are refused") {
  const auto r = one_point(3);
  for (const indices& kept : {indices{}, indices{3}, indices{1, 1}, indices{2, 1}})
    CHECK_THROWS_AS(keep_keyframes(r, kept), std::invalid_argument);
}

TEST_CASE("a recording shrinks to the keyframes that a command needs to fail") {
  const turbomap_test::temporary_directory folder;
  const auto out = folder / "it's small";  // a path that a shell must be told to take as one word
  std::size_t told = 0;
  const auto tell = [&](const turbomap_reduce::reduction&) { ++told; };
  // Fails with 7 while keyframes 3 and 8 are in; with 5, another failure, while 8 is in without 3.
  const std::string command =
      "f={}/log_kp_desc.npy; grep -q IIII \"$f\" || exit 0; grep -q DDDD \"$f\" && exit 7; exit 5";
  const auto found = turbomap_reduce::reduce(one_point(20), command, out / "", -1, tell);  // with a slash at the end
  CHECK(found.kept == indices{3, 8});
  CHECK(found.status == 7);
  CHECK(told > 1);
  CHECK(turbomap::read_recording(out).keyframe_count() == 2);
  CHECK_FALSE(std::filesystem::exists(out.string() + ".candidate"));

  // Folders that hold anything else are left alone.
  for (const auto& taken : {out, folder / "it's small.candidate"}) {
    std::filesystem::create_directories(taken);
    turbomap_test::write_bytes(taken / "thesis.tex", "all of it");
    CHECK_THROWS_AS(turbomap_reduce::reduce(one_point(20), command, out, -1, tell), std::invalid_argument);
    CHECK(turbomap_test::file_bytes(taken / "thesis.tex") == "all of it");
    CHECK(std::filesystem::remove(taken / "thesis.tex"));
  }

  // Nothing fails, or not in the way that was asked for: what was written before stays.
  CHECK_THROWS_AS(turbomap_reduce::reduce(one_point(4), "test -d {} && true", out, -1, tell), std::invalid_argument);
  CHECK_THROWS_AS(turbomap_reduce::reduce(one_point(20), command, out, 5, tell), std::invalid_argument);
  CHECK(turbomap::read_recording(out).keyframe_count() == 2);
}

TEST_CASE("a reduction ends when its command is interrupted") {
  const turbomap_test::temporary_directory folder;
  const auto out = folder / "small";
  const auto tell = [](const turbomap_reduce::reduction&) {};
  // Fails on the whole, and is interrupted, by a signal or by a program that says so, as soon as something was taken out.
  for (const std::string signal : {"INT", "QUIT", "130"}) {
    const std::string stop = signal == "130" ? "exit 130" : "kill -" + signal + " $$";
    const std::string command = "grep -q DDDD {}/log_kp_desc.npy && grep -q IIII {}/log_kp_desc.npy && exit 7; " + stop;
    CHECK_THROWS_AS(turbomap_reduce::reduce(one_point(20), command, out, -1, tell), std::runtime_error);
    CHECK(turbomap::read_recording(out).keyframe_count() == 10);  // half of it holds both
    CHECK_FALSE(std::filesystem::exists(out.string() + ".candidate"));
  }
  // Unless an interruption is what is looked for.
  CHECK(turbomap_reduce::reduce(one_point(4), "kill -INT $$; {}", out, 130, tell).kept.size() == 1);
}

TEST_CASE("a recording is not written over itself") {
  const turbomap_test::temporary_directory folder;
  const auto recording = folder / "small.candidate";
  std::filesystem::create_directories(recording);
  CHECK_THROWS_AS(turbomap_reduce::require_elsewhere(recording, recording), std::invalid_argument);
  CHECK_THROWS_AS(turbomap_reduce::require_elsewhere(recording, folder / "small" / ""), std::invalid_argument);
  CHECK_THROWS_AS(turbomap_reduce::require_elsewhere(recording, ""), std::invalid_argument);
  CHECK_NOTHROW(turbomap_reduce::require_elsewhere(recording, folder / "other"));
}

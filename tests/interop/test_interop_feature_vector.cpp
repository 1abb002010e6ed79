// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Feature vectors of a bag of words as groups of keypoints. The types are look-alikes of those of DBoW2 and FBoW.

#include <turbomap/interop/feature_vector.hpp>

#include <cstdint>
#include <map>
#include <random>
#include <stdexcept>
#include <vector>

#include <doctest/doctest.h>

namespace {

using dbow_like = std::map<unsigned, std::vector<unsigned>>;
struct fbow_like : std::map<std::uint32_t, std::vector<std::uint32_t>> {};  // derived, as fbow::fBow2 is
constexpr auto none = turbomap::keypoint::no_group;

std::vector<std::uint32_t> groups(const std::vector<turbomap::keypoint>& keypoints) {
  std::vector<std::uint32_t> all;
  for (const auto& k : keypoints) all.push_back(k.group);
  return all;
}

}  // namespace

TEST_CASE("each keypoint gets its node, the others none") {
  std::vector<turbomap::keypoint> keypoints(5);
  keypoints[1].group = 99;  // of an earlier vocabulary
  dbow_like features{{7, {0, 4}}, {12, {3}}};
  turbomap::set_groups(turbomap::span<turbomap::keypoint>(keypoints), features);
  CHECK(groups(keypoints) == std::vector<std::uint32_t>{7, none, none, 12, 7});
  turbomap::set_groups(turbomap::span<turbomap::keypoint>(keypoints), fbow_like{});
  CHECK(groups(keypoints) == std::vector<std::uint32_t>(5, none));
}

TEST_CASE("a rig whose cameras have a feature vector each") {
  std::vector<turbomap::keypoint> keypoints(5);
  const turbomap::span<turbomap::keypoint> all(keypoints);
  fbow_like left, right;
  left[3] = {0, 2}, right[3] = {1}, right[4] = {0};
  turbomap::set_groups(all, left, 0, 3);
  turbomap::set_groups(all, right, 3, 2);
  CHECK(groups(keypoints) == std::vector<std::uint32_t>{3, none, 3, 4, 3});
}

TEST_CASE("random vectors against a search for each keypoint") {
  std::mt19937 random(5);
  for (int round = 0; round < 50; ++round) {
    std::vector<turbomap::keypoint> keypoints(random() % 200);
    dbow_like features;
    for (unsigned i = 0; i < keypoints.size(); ++i)
      if (random() % 5 != 0) features[random() % 20].push_back(i);
    turbomap::set_groups(turbomap::span<turbomap::keypoint>(keypoints), features);
    for (unsigned i = 0; i < keypoints.size(); ++i) {
      std::uint32_t expected = none;
      for (const auto& [node, indices] : features)
        for (const unsigned k : indices)
          if (k == i) expected = node;
      CHECK(keypoints[i].group == expected);
    }
  }
}

TEST_CASE("what is not there is refused, and nothing changed") {
  std::vector<turbomap::keypoint> keypoints(3);
  const turbomap::span<turbomap::keypoint> all(keypoints);
  turbomap::set_groups(all, dbow_like{{1, {0, 1, 2}}});
  CHECK_THROWS_AS(turbomap::set_groups(all, dbow_like{{2, {0}}, {3, {3}}}), std::invalid_argument);
  CHECK_THROWS_AS(turbomap::set_groups(all, dbow_like{{2, {0}}, {3, {0}}}), std::invalid_argument);
  CHECK_THROWS_AS(turbomap::set_groups(all, dbow_like{{none, {0}}}), std::invalid_argument);
  CHECK_THROWS_AS(turbomap::set_groups(all, std::map<int, std::vector<int>>{{2, {-1}}}), std::invalid_argument);
  CHECK_THROWS_AS(turbomap::set_groups(all, std::map<int, std::vector<int>>{{-2, {1}}}), std::invalid_argument);
  CHECK_THROWS_AS(turbomap::set_groups(all, dbow_like{}, 2, 2), std::invalid_argument);
  CHECK_THROWS_AS(turbomap::set_groups(all, dbow_like{}, 4, 0), std::invalid_argument);
  CHECK(groups(keypoints) == std::vector<std::uint32_t>(3, 1));
}

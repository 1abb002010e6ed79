// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A search can be stopped: it ends soon and has no matches; a flag that nobody sets, or that a search does not look at,
/// changes nothing. Whoever sets it may also clear it: no result is half done.

#include <thrust/execution_policy.h>

#include <atomic>
#include <thread>

#include "matching_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::search_options;

std::atomic<bool> stop{false};
std::atomic<long> comparisons{0}, comparisons_until_stop{0};

/// Sets the flag after so many comparisons.
struct stopping_descriptor {
  using element = orb::element;
  using distance_type = orb::distance_type;
  static constexpr int elements = orb::elements, bytes = orb::bytes;
  static constexpr distance_type worst = orb::worst;
  static distance_type distance(const element* a, const element* b) {
    if (++comparisons == comparisons_until_stop) stop = true;
    return orb::distance(a, b);
  }
};

TEST_CASE_TEMPLATE("a search that is stopped ends soon and has no matches", Policy, TURBOMAP_TEST_POLICIES) {
  scene_recipe recipe;
  recipe.seed = 5, recipe.mapped = 0;
  const scene<stopping_descriptor, pinhole_camera> s(pinhole_rig(), recipe);
  for (const auto set : {turbomap::candidates::exhaustive, turbomap::candidates::epipolar_ordered}) {
    search_options options;
    options.candidate_set = set;
    stop = false, comparisons = 0, comparisons_until_stop = -1;
    const auto expected = search_under(Policy{}, s, options);
    const long all = comparisons;
    REQUIRE(expected.size() > 50);

    options.stop = &stop;
    CHECK(same(search_under(Policy{}, s, options), expected));

    stop = false, comparisons = 0, comparisons_until_stop = all / 8;
    CHECK(search_under(Policy{}, s, options).empty());
    CHECK(comparisons < all);

    comparisons = 0;  // the flag is set before it begins
    CHECK(search_under(Policy{}, s, options).empty());
    CHECK(comparisons == 0);

    int asked = 0;  // by the thread that calls, before the search
    const auto ask = [&asked] { return ++asked, stop.load(); };
    options.stop = &ask;
    CHECK(search_under(Policy{}, s, options).empty());
    CHECK(comparisons == 0);
    CHECK(asked >= 1);
    options.stop = nullptr;
    CHECK(same(search_under(Policy{}, s, options), expected));
  }
}

TEST_CASE_TEMPLATE("a grouped search finishes", Policy, TURBOMAP_TEST_POLICIES) {
  scene_recipe recipe;
  recipe.seed = 6, recipe.mapped = 0;
  const scene<stopping_descriptor, pinhole_camera> s(pinhole_rig(), recipe);
  search_options options;
  options.candidate_set = turbomap::candidates::grouped;
  const auto expected = search_under(Policy{}, s, options);
  REQUIRE(expected.size() > 50);
  stop = true, options.stop = &stop;
  CHECK(same(search_under(Policy{}, s, options), expected));
}

TEST_CASE_TEMPLATE("a search whose flag is set and cleared has all matches or none", Policy, TURBOMAP_TEST_POLICIES) {
  scene_recipe recipe;
  recipe.seed = 7, recipe.mapped = 0;
  const scene<orb, pinhole_camera> s(pinhole_rig(), recipe);
  for (const auto set : {turbomap::candidates::exhaustive, turbomap::candidates::epipolar_ordered}) {
    search_options options;
    options.candidate_set = set;
    const auto expected = search_under(Policy{}, s, options);
    REQUIRE(expected.size() > 50);
    options.stop = &stop;
    std::atomic<bool> done{false};
    std::thread other([&done] {
      while (!done) stop = !stop;
    });
    int half_done = 0;
    for (int round = 0; round < 1000; ++round) {
      const auto found = search_under(Policy{}, s, options);
      if (!found.empty() && !same(found, expected)) ++half_done;
    }
    done = true;
    other.join();
    CHECK(half_done == 0);
  }
}

}  // namespace

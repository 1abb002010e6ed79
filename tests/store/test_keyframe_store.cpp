// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The keyframe store under the host policies.

#include <thrust/execution_policy.h>

#include <limits>
#include <stdexcept>

#include "keyframe_large_cases.hpp"
#include "keyframe_paging_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap_test::sequential;

TEST_CASE_TEMPLATE("ten thousand keyframes are inserted, erased and inserted again", Policy, TURBOMAP_TEST_POLICIES) {
  check_ten_thousand<Policy>();
}
TEST_CASE_TEMPLATE("keyframes of 1200 keypoints", Policy, sequential) { check_realistic<Policy>(); }
TEST_CASE_TEMPLATE("stale handles are refused and nothing is pinned", Policy, TURBOMAP_TEST_POLICIES) {
  check_stale_handles<Policy>();
}
TEST_CASE_TEMPLATE("an erased keyframe stays until its readers are done", Policy, TURBOMAP_TEST_POLICIES) {
  check_deferred_reclamation<Policy>();
}
TEST_CASE_TEMPLATE("beyond the budget the least recently used are paged out", Policy, TURBOMAP_TEST_POLICIES) {
  check_paging<Policy>();
}
TEST_CASE_TEMPLATE("a keyframe larger than a chunk takes the place of many", Policy, TURBOMAP_TEST_POLICIES) {
  check_large_keyframe<Policy>();
}
TEST_CASE_TEMPLATE("a failing allocation leaves the store as it was", Policy, sequential) {
  check_failing_allocations<Policy>();
}
TEST_CASE_TEMPLATE("random operations", Policy, sequential) { check_random_operations<Policy>(20000); }

TEST_CASE("bad keyframes and options are refused with the store unchanged") {
  sample_store<sequential> store;
  auto k = make_keyframe(1, 10);
  store.insert(k.data());
  const auto before = state_of(store.statistics());
  k.keypoints[3].x = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_WITH_AS(store.insert(k.data()), "turbomap: keypoints[3].x = nan: must be finite", std::invalid_argument);
  CHECK(state_of(store.statistics()) == before);
  turbomap::keyframe_store_options options;
  options.chunk_bytes = 0;
  CHECK_THROWS_AS(sample_store<sequential>{options}, std::invalid_argument);
  options = {};
  options.packing.grid_rows = 0;
  CHECK_THROWS_AS(sample_store<sequential>{options}, std::invalid_argument);
}

/// A user's camera that fails while the keyframe is being packed, when its place in the store is taken already.
struct throwing_camera {
  using scalar = float;
  template <class S>
  bool project(const turbomap::vec3<S>&, turbomap::vec2<S>&) const {
    return false;
  }
  template <class S>
  bool unproject(const turbomap::vec2<S>&, turbomap::vec3<S>&) const {
    throw std::runtime_error("no ray");
  }
};

TEST_CASE("a camera that throws while it is packed leaves nothing behind") {
  turbomap::keyframe_store<sample_descriptor, throwing_camera> store;
  const auto k = make_keyframe(1, 10);
  const turbomap::rig_camera<throwing_camera> camera{};
  const turbomap::keyframe_data<sample_descriptor, throwing_camera> data{
      10, k.keypoints.data(), k.descriptors.data(), &camera, 1, k.bounds};
  CHECK_THROWS_WITH_AS(store.insert(data), "no ray", std::runtime_error);
  const auto s = store.statistics();
  CHECK(s.keyframes == 0);
  CHECK(s.resident_blocks == 0);
  CHECK(s.uploads == 0);
}

TEST_CASE("pinning and releasing again allocates nothing on the policy's side") {
  counting_resource resource(std::pmr::get_default_resource());
  turbomap::keyframe_store_options options;
  options.resident = options.paging = options.staging = &resource;
  sample_store<sequential> store(options);
  const auto k = make_keyframe(1, 100);
  const handles one{store.insert(k.data())};
  const long before = resource.allocations;
  for (int i = 0; i < 100; ++i) {
    store.pin(thrust::seq, one);
    store.erase(store.insert(k.data()));
  }
  CHECK(resource.allocations == before);
}

TEST_CASE("an emptied store is as a new one, but for what is pinned") {
  sample_store<sequential> store;
  const auto k = make_keyframe(1, 100);
  handles all;
  for (int i = 0; i < 5; ++i) all.push_back(store.insert(k.data()));
  store.erase(all[1]);
  {
    const auto pinned = store.pin(thrust::seq, handles{all[2]});
    store.clear();
    CHECK(store.size() == 0);
    CHECK(pinned.views()[0].keypoint_count == 100);
  }
  for (const auto handle : all) CHECK_FALSE(store.contains(handle));
  CHECK(store.statistics().resident_blocks == 0);
  const auto again = store.insert(k.data());
  CHECK(store.contains(again));
  CHECK(store.size() == 1);
  store.clear();
  store.clear();
  CHECK_FALSE(store.contains(again));
}

TEST_CASE("how the first camera of a keyframe is mounted is known while the keyframe is there") {
  sample_store<sequential> store;
  handles all;
  for (int i = 0; i < 5; ++i) {
    auto k = make_keyframe(1, 10);
    k.cameras[0].T_camera_body.tx = i;
    all.push_back(store.insert(k.data()));
  }
  for (int i = 0; i < 5; ++i) CHECK(store.first_camera(all[static_cast<std::size_t>(i)]).tx == i);
  store.erase(all[1]);
  CHECK_THROWS_AS(store.first_camera(all[1]), turbomap::stale_handle);
  CHECK_THROWS_AS(store.first_camera({}), turbomap::stale_handle);
  CHECK_THROWS_AS(store.first_camera({all[2].slot, 0}), turbomap::stale_handle);
  const auto again = store.insert(make_keyframe(1, 10).data());
  CHECK(again.slot == all[1].slot);
  CHECK_THROWS_AS(store.first_camera(all[1]), turbomap::stale_handle);
  store.clear();
  CHECK_THROWS_AS(store.first_camera(all[2]), turbomap::stale_handle);
}

TEST_CASE("generations: a slot whose generations are used up is never used again") {
  turbomap::slot_table table(3);
  const auto slot = table.acquire();
  for (std::uint32_t g = 1; g <= 3; ++g) {
    if (g > 1) CHECK(table.acquire() == slot);
    CHECK(table.generation(slot) == g);
    CHECK_FALSE(table.alive(slot, g));  // not before it is published
    table.publish(slot);
    CHECK(table.alive(slot, g));
    CHECK(table.alive_count() == 1);
    table.retire(slot);
    CHECK_FALSE(table.alive(slot, g));
    CHECK(table.known(slot, g));
    table.recycle(slot);
    CHECK(table.alive_count() == 0);
  }
  CHECK(table.acquire() != slot);
  for (std::uint32_t g = 0; g <= 3; ++g) CHECK_FALSE(table.alive(slot, g));
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <turbomap/context.hpp>
#include <turbomap/store/keyframe_store.hpp>
#include <turbomap/traits.hpp>

#include <array>
#include <cstring>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <vector>

#include "scenes/keyframe_samples.hpp"

namespace users {

/// Pointer-rich, behind a mutex.
struct feature {
  float u, v;
  int level;
  std::unique_ptr<std::uint8_t[]> bits;
};
struct frame {
  mutable std::mutex mutex;
  mutable bool guarded = false;
  mutable int reads = 0, unguarded_reads = 0;
  std::vector<std::unique_ptr<feature>> features;
};

/// Locks a frame, and marks it as locked.
struct frame_guard {
  explicit frame_guard(const frame& f) : frame_(f), lock_(f.mutex) { f.guarded = true; }
  frame_guard(const frame_guard&) = delete;
  ~frame_guard() { frame_.guarded = false; }

 private:
  const frame& frame_;
  std::lock_guard<std::mutex> lock_;
};

/// Flat, with a rig known at run time only.
struct flat {
  turbomap_test::sample_keyframe arrays;
};

/// Descriptors as objects, which may be too short.
struct loose {
  std::vector<std::vector<std::uint8_t>> bits;
};
struct halved {};

struct incomplete {};
struct unknown {};

}  // namespace users

template <>
struct turbomap::keyframe_traits<users::frame> {
  using descriptor = turbomap_test::sample_descriptor;
  using rig = turbomap::mono_rig<turbomap::pinhole<float>>;
  static std::size_t keypoint_count(const users::frame& f) { return f.features.size(); }
  static turbomap::keypoint keypoint(const users::frame& f, std::size_t i) {
    ++f.reads;
    if (!f.guarded) ++f.unguarded_reads;
    turbomap::keypoint k;
    k.x = f.features[i]->u;
    k.y = f.features[i]->v;
    k.octave = static_cast<std::uint8_t>(f.features[i]->level);
    return k;
  }
  static const std::uint8_t* descriptor_data(const users::frame& f, std::size_t i) { return f.features[i]->bits.get(); }
  static rig cameras(const users::frame&) {
    return turbomap::make_mono_rig(turbomap::pinhole<float>{400, 400, 320, 240});
  }
  static users::frame_guard guard(const users::frame& f) { return users::frame_guard(f); }
};

template <>
struct turbomap::keyframe_traits<users::flat> {
  using descriptor = turbomap_test::sample_descriptor;
  using rig = std::vector<turbomap::rig_camera<turbomap::pinhole<float>>>;
  static int keypoint_count(const users::flat& f) { return static_cast<int>(f.arrays.keypoints.size()); }
  static const turbomap::keypoint& keypoint(const users::flat& f, std::size_t i) { return f.arrays.keypoints[i]; }
  static const std::uint8_t* descriptor_data(const users::flat& f, std::size_t i) {
    return f.arrays.descriptors.data() + 32 * i;
  }
  static const rig& cameras(const users::flat& f) { return f.arrays.cameras; }
  static turbomap::image_bounds bounds(const users::flat& f) { return f.arrays.bounds; }
};

template <>
struct turbomap::keyframe_traits<users::loose> {
  using descriptor = turbomap_test::sample_descriptor;
  using rig = turbomap::mono_rig<turbomap::pinhole<float>>;
  static std::size_t keypoint_count(const users::loose& f) { return f.bits.size(); }
  static turbomap::keypoint keypoint(const users::loose&, std::size_t) { return {}; }
  static std::vector<std::uint8_t> descriptor_data(const users::loose& f, std::size_t i) { return f.bits[i]; }
  static rig cameras(const users::loose&) {
    return turbomap::make_mono_rig(turbomap::pinhole<float>{400, 400, 320, 240});
  }
};
template <>
struct turbomap::keyframe_traits<users::halved> : turbomap::keyframe_traits<users::loose> {
  static std::size_t keypoint_count(const users::halved&) { return 1; }
  static turbomap::keypoint keypoint(const users::halved&, std::size_t) { return {}; }
  static std::array<std::uint8_t, 16> descriptor_data(const users::halved&, std::size_t) { return {}; }
  static rig cameras(const users::halved&) { return {}; }
};
template <>
struct turbomap::keyframe_traits<users::incomplete> {
  using descriptor = turbomap_test::sample_descriptor;
};

namespace {

using namespace turbomap_test;

static_assert(turbomap::has_keyframe_traits_v<users::frame>);
static_assert(turbomap::has_keyframe_traits_v<users::flat>);
static_assert(turbomap::has_keyframe_traits_v<users::loose>);
static_assert(!turbomap::has_keyframe_traits_v<users::halved>);  // 16 of 32 bytes
static_assert(!turbomap::has_keyframe_traits_v<users::incomplete>);
static_assert(!turbomap::has_keyframe_traits_v<users::unknown>);
static_assert(turbomap::require_keyframe_traits<users::flat>());

using store_type = turbomap::keyframe_store<sample_descriptor, sample_camera>;

std::vector<std::byte> content(store_type& store, turbomap::keyframe_handle handle, std::size_t bytes) {
  const auto pinned = store.pin(thrust::seq, std::vector<turbomap::keyframe_handle>{handle});
  const auto* begin = reinterpret_cast<const std::byte*>(pinned[0].pixel);
  return {begin, begin + bytes};
}

TEST_CASE("a pointer-rich keyframe is read under its guard") {
  users::frame f;
  for (int i = 0; i < 50; ++i) {
    auto one = std::make_unique<users::feature>();
    one->u = static_cast<float>(13 * i % 600), one->v = static_cast<float>(7 * i % 400), one->level = i % 8;
    one->bits = std::make_unique<std::uint8_t[]>(32);
    for (int b = 0; b < 32; ++b) one->bits[static_cast<std::size_t>(b)] = static_cast<std::uint8_t>(b * i);
    f.features.push_back(std::move(one));
  }
  store_type store;
  turbomap::keyframe_buffer<sample_descriptor, sample_camera> buffer;
  const auto data = turbomap::gather(f, buffer);
  CHECK(data.keypoint_count == 50);
  CHECK(data.keypoints[3].x == 39);
  CHECK(data.descriptors[32 * 3 + 2] == 6);
  CHECK(data.camera_count == 1);
  CHECK(data.bounds.min_x == 0);
  CHECK(data.bounds.max_x == 599);  // one more than the largest, 46 * 13
  CHECK(f.reads == 50);
  CHECK(f.unguarded_reads == 0);
  CHECK_FALSE(f.guarded);
  const auto handle = store.insert(f);
  CHECK(store.contains(handle));
  f.features[9]->bits.reset();
  CHECK_THROWS_AS(store.insert(f), std::invalid_argument);
  CHECK(store.size() == 1);
  users::frame empty;
  store.insert(empty);
  CHECK(store.size() == 2);
}

TEST_CASE("a descriptor that is too short is refused") {
  users::loose f{{std::vector<std::uint8_t>(32, 1), std::vector<std::uint8_t>(33, 2)}};
  store_type store;
  turbomap::keyframe_buffer<sample_descriptor, sample_camera> buffer;
  CHECK(turbomap::gather(f, buffer).descriptors[32] == 2);
  for (const std::size_t size : {0, 31}) {
    f.bits[1].resize(size);
    CHECK_THROWS_WITH_AS(store.insert(f),
                         "turbomap: keypoint without descriptor_data = 1: there is a descriptor for every keypoint",
                         std::invalid_argument);
  }
  CHECK(store.size() == 0);
}

TEST_CASE("through traits or as arrays, the same bytes are stored") {
  const users::flat f{make_keyframe(4, 700, 3)};
  store_type store;
  const auto expected = packed(f.arrays);
  CHECK(content(store, store.insert(f), expected.size()) == expected);
  CHECK(content(store, store.insert(f.arrays.data()), expected.size()) == expected);
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The tests of the keyframe store, for any execution policy: the same for the host (test_keyframe_store.cpp) and for
/// CUDA (device/test_keyframe_store.cu).

#include <doctest/doctest.h>

#include <turbomap/context.hpp>
#include <turbomap/store/keyframe_store.hpp>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "scenes/keyframe_samples.hpp"

namespace turbomap_test {

template <class Policy>
using sample_store = turbomap::keyframe_store<sample_descriptor, sample_camera, turbomap::memory_of_t<Policy>>;

using handles = std::vector<turbomap::keyframe_handle>;

/// The bytes of a resident keyframe, copied to the host behind the work of the policy.
template <class Policy>
std::vector<std::byte> block_of(const turbomap::context<Policy>& ctx, const sample_view& view, std::size_t bytes) {
  std::vector<std::byte> block(bytes);
  turbomap::copy_out(ctx.policy(), block.data(), view.pixel, bytes);  // the pixels are the start of the block
  turbomap::synchronize(ctx.policy());
  return block;
}

/// Whether the store gives back what was inserted, to the last byte.
template <class Policy>
bool holds(sample_store<Policy>& store, turbomap::context<Policy>& ctx, turbomap::keyframe_handle handle,
           const sample_keyframe& k) {
  const auto expected = packed(k, store.options().packing);
  const auto pinned = store.pin(ctx, handles{handle});
  return pinned[0].keypoint_count == static_cast<int>(k.keypoints.size()) &&
         block_of(ctx, pinned[0], expected.size()) == expected;
}

/// Everything that a failed call must leave alone.
inline auto state_of(const turbomap::keyframe_store_statistics& s) {
  return std::tuple(s.keyframes, s.resident_blocks, s.paged_blocks, s.resident_bytes, s.paged_bytes, s.chunk_bytes,
                    s.paging_chunk_bytes, s.pinned_sets, s.uploads, s.page_ins, s.page_outs);
}

template <class Policy>
void check_ten_thousand() {
  turbomap::context<Policy> ctx{Policy{}};
  sample_store<Policy> store;
  constexpr int count = 10000;
  std::vector<sample_keyframe> kinds;
  for (unsigned i = 0; i < 16; ++i) kinds.push_back(make_keyframe(i, static_cast<int>(i), 1, i % 2 == 0, 3));
  handles all;
  for (int i = 0; i < count; ++i) all.push_back(store.insert(kinds[static_cast<std::size_t>(i) % 16].data()));
  CHECK(store.size() == count);
  for (std::size_t i = 0; i < count; i += 97) CHECK(holds<Policy>(store, ctx, all[i], kinds[i % 16]));
  const auto full = store.statistics();
  CHECK(full.uploads == count);

  const handles gone = all;
  for (int i = 0; i < count; ++i) store.erase(all[static_cast<std::size_t>(i * 7919LL % count)]);
  CHECK(store.size() == 0);
  CHECK(store.statistics().resident_bytes == 0);
  CHECK(store.statistics().chunk_bytes <= store.options().chunk_bytes);
  for (const auto handle : gone) CHECK_FALSE(store.contains(handle));
  CHECK_THROWS_AS(store.erase(gone[5]), turbomap::stale_handle);

  for (std::size_t i = 0; i < count; ++i) all[i] = store.insert(kinds[(i + 3) % 16].data());
  CHECK(store.size() == count);
  CHECK(store.statistics().resident_bytes == full.resident_bytes);
  for (const auto handle : all) CHECK(handle.slot < count);  // slots are used again
  for (const auto handle : gone) CHECK_FALSE(store.contains(handle));
  for (std::size_t i = 0; i < count; i += 89) CHECK(holds<Policy>(store, ctx, all[i], kinds[(i + 3) % 16]));
}

template <class Policy>
void check_realistic() {
  turbomap::context<Policy> ctx{Policy{}};
  sample_store<Policy> store;
  std::vector<sample_keyframe> frames;
  handles all;
  for (unsigned i = 0; i < 40; ++i) frames.push_back(make_keyframe(i, 1200));
  for (int round = 0; round < 6; ++round)
    for (const auto& k : frames) all.push_back(store.insert(k.data()));
  for (std::size_t i = 0; i < all.size(); i += 2) store.erase(all[i]);
  for (std::size_t i = 1; i < all.size(); i += 2) CHECK(holds<Policy>(store, ctx, all[i], frames[i % 40]));
  const auto s = store.statistics();
  CHECK(s.keyframes == 120);
  CHECK(s.bytes_per_keyframe <= 98304);
  CHECK(s.chunk_bytes % store.options().chunk_bytes == 0);
}

template <class Policy>
void check_stale_handles() {
  turbomap::context<Policy> ctx{Policy{}};
  sample_store<Policy> store;
  const auto k = make_keyframe(1, 20);
  const auto a = store.insert(k.data());
  const auto b = store.insert(k.data());
  store.erase(a);
  const auto before = state_of(store.statistics());
  std::string message;
  try {
    store.pin(ctx, handles{b, a});
  } catch (const turbomap::stale_handle& error) {
    message = error.what();
  }
  CHECK(message.find("handles[1]") != std::string::npos);
  CHECK(message.find("slot " + std::to_string(a.slot)) != std::string::npos);
  CHECK(message.find("generation " + std::to_string(a.generation)) != std::string::npos);
  CHECK(state_of(store.statistics()) == before);
  CHECK_THROWS_AS(store.erase(a), turbomap::stale_handle);
  CHECK_THROWS_AS(store.erase(turbomap::keyframe_handle{}), turbomap::stale_handle);
  CHECK_THROWS_AS(store.pin(ctx, handles{{12345, 1}}), turbomap::stale_handle);
  const auto c = store.insert(k.data());
  CHECK(c.slot == a.slot);
  CHECK(c != a);
  CHECK_FALSE(store.contains(a));
  store.erase(b);  // nothing was left pinned by the failed call: its memory is free at once
  CHECK(store.statistics().resident_blocks == 1);
}

template <class Policy>
void check_deferred_reclamation() {
  turbomap::context<Policy> ctx{Policy{}};
  sample_store<Policy> store;
  const auto a = make_keyframe(1, 300), b = make_keyframe(2, 300);
  const auto expected = packed(a);
  const auto handle = store.insert(a.data());
  auto first = store.pin(ctx, handles{handle, handle});
  auto second = store.pin(ctx.policy(), handles{handle});
  CHECK(first.size() == 2);
  CHECK(store.pin(ctx, {handle, handle, handle}).size() == 3);
  CHECK(store.pin(ctx, {}).size() == 0);
  store.erase(handle);
  CHECK_FALSE(store.contains(handle));
  CHECK(store.size() == 0);
  handles others;
  for (int i = 0; i < 50; ++i) others.push_back(store.insert(b.data()));
  for (const auto other : others) CHECK(other.slot != handle.slot);
  CHECK(block_of(ctx, first[1], expected.size()) == expected);
  first.release_after(ctx);
  CHECK(first.views().empty());
  ctx.synchronize();
  CHECK(block_of(ctx, second[0], expected.size()) == expected);
  CHECK(store.statistics().resident_blocks == 51);
  {
    auto moved = std::move(second);
    CHECK(moved.size() == 1);
  }
  ctx.synchronize();
  CHECK(store.statistics().resident_blocks == 50);
  CHECK(store.insert(b.data()).slot == handle.slot);
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The tests of the keyframe store when room is short, for any execution policy.

#include <random>
#include <string>
#include <utility>
#include <vector>

#include "keyframe_store_cases.hpp"

namespace turbomap_test {

/// Options of a store with room for `n` of the keyframe `k` and no more.
inline turbomap::keyframe_store_options room_for(std::size_t n, const sample_keyframe& k) {
  turbomap::keyframe_store_options options;
  const std::size_t block = turbomap::align_up(packed(k).size(), turbomap::chunk_allocator::alignment);
  options.byte_budget = n * block;
  options.chunk_bytes = 2 * block;
  return options;
}

template <class Policy>
void check_paging() {
  turbomap::context<Policy> ctx{Policy{}};
  std::vector<sample_keyframe> frames;
  for (unsigned i = 0; i < 12; ++i) frames.push_back(make_keyframe(i, 200, 1, true, 0));
  sample_store<Policy> store(room_for(4, frames[0]));
  handles all;
  for (const auto& k : frames) all.push_back(store.insert(k.data()));
  auto s = store.statistics();
  CHECK(s.resident_blocks == 4);
  CHECK(s.paged_blocks == 8);
  CHECK(s.page_outs == 8);
  CHECK(s.chunk_bytes <= store.options().byte_budget);
  for (std::size_t i = 0; i < all.size(); ++i) CHECK(holds<Policy>(store, ctx, all[i], frames[i]));
  for (std::size_t i = all.size(); i-- > 0;) CHECK(holds<Policy>(store, ctx, all[i], frames[i]));

  // Resident now: 3, 2, 1, 0, used in this order. Using 3 again makes 2 the least recently used.
  const auto page_ins = [&store] { return store.statistics().page_ins; };
  auto base = page_ins();
  store.pin(ctx, handles{all[3]});
  CHECK(page_ins() == base);
  store.pin(ctx, handles{all[7]});  // pages 2 out
  store.pin(ctx, handles{all[0], all[1], all[3], all[7]});
  CHECK(page_ins() == base + 1);
  store.pin(ctx, handles{all[2]});
  CHECK(page_ins() == base + 2);

  // The same keyframe twice is brought back once; erasing one that is paged out needs no room.
  base = page_ins();
  CHECK(store.pin(ctx, handles{all[9], all[9]}).size() == 2);
  CHECK(page_ins() == base + 1);
  s = store.statistics();
  store.erase(all[10]);
  CHECK(store.statistics().paged_blocks == s.paged_blocks - 1);

  // Everything pinned: no room, nothing changed; the pinned ones are still what they were.
  {
    const auto four = store.pin(ctx, handles{all[0], all[1], all[2], all[3]});
    const auto before = state_of(store.statistics());
    CHECK_THROWS_AS(store.insert(frames[5].data()), turbomap::out_of_memory);
    CHECK_THROWS_AS(store.pin(ctx, handles{all[5]}), turbomap::out_of_memory);
    CHECK(state_of(store.statistics()) == before);
    for (std::size_t i = 0; i < 4; ++i) {
      const auto expected = packed(frames[i]);
      CHECK(block_of(ctx, four[i], expected.size()) == expected);
    }
  }
  // More than the budget in one call: refused with nothing paged out.
  const auto before = state_of(store.statistics());
  CHECK_THROWS_AS(store.pin(ctx, handles{all[4], all[5], all[6], all[7], all[8]}), turbomap::out_of_memory);
  CHECK(state_of(store.statistics()) == before);
  CHECK(holds<Policy>(store, ctx, store.insert(frames[5].data()), frames[5]));
}

/// Lets the k-th allocation fail, for every k, with room left to page out and without: whatever throws leaves
/// statistics and contents as they were, and the store goes on working.
template <class Policy>
void check_failing_allocations() {
  using memory = turbomap::memory_of_t<Policy>;
  std::vector<sample_keyframe> frames;
  for (unsigned i = 0; i < 10; ++i) frames.push_back(make_keyframe(i, 40 + 60 * static_cast<int>(i % 3)));
  int thrown = 0, survived = 0;
  for (long refusals : {1L, 2L, 1000L}) {
    for (bool refuse_paging : {false, true}) {
      for (long k = 0; k < 12; ++k) {
        turbomap::context<Policy> ctx{Policy{}};
        counting_resource resident(turbomap::default_resource(memory{})),
            paging(turbomap::default_staging_resource(memory{}));
        auto& failing = refuse_paging ? paging : resident;
        failing.refuse_from = k, failing.refusals = refusals;
        if (refuse_paging) resident.refuse_from = 2, resident.refusals = 1000;  // so that paging is needed
        {
          turbomap::keyframe_store_options options;
          options.chunk_bytes = 20000;
          options.resident = &resident;
          options.paging = options.staging = &paging;
          sample_store<Policy> store(options);
          std::vector<std::pair<turbomap::keyframe_handle, const sample_keyframe*>> inside;
          for (const auto& k2 : frames) {
            const auto before = state_of(store.statistics());
            const std::size_t resident_out = resident.bytes_out;
            try {
              inside.emplace_back(store.insert(k2.data()), &k2);
              ++survived;
            } catch (const std::bad_alloc&) {
              ++thrown;
              CHECK(state_of(store.statistics()) == before);
              CHECK(resident.bytes_out == resident_out);
            }
          }
          for (const auto& [handle, k2] : inside) {
            const auto before = state_of(store.statistics());
            try {
              const bool unchanged = holds<Policy>(store, ctx, handle, *k2);  // CHECK would swallow the exception
              CHECK(unchanged);
            } catch (const std::bad_alloc&) {
              ++thrown;
              CHECK(state_of(store.statistics()) == before);
            }
          }
          resident.refuse_from = paging.refuse_from = -1;
          for (const auto& [handle, k2] : inside) CHECK(holds<Policy>(store, ctx, handle, *k2));
        }
        CHECK(resident.bytes_out == 0);
        CHECK(paging.bytes_out == 0);
        CHECK(resident.mismatched + paging.mismatched == 0);
      }
    }
  }
  CHECK(thrown > 50);
  CHECK(survived > 50);
}

/// Random insertions, erasures and pins of keyframes of many sizes under a budget, against a list of what should be
/// there.
template <class Policy>
void check_random_operations(int steps) {
  turbomap::context<Policy> ctx{Policy{}};
  std::vector<sample_keyframe> kinds;
  std::vector<std::vector<std::byte>> blocks;
  for (unsigned i = 0; i < 13; ++i) {  // the last one is larger than a chunk
    kinds.push_back(make_keyframe(i, i < 12 ? static_cast<int>(37 * i) : 4500, 1 + static_cast<int>(i % 3)));
    blocks.push_back(packed(kinds.back()));
  }
  turbomap::keyframe_store_options options;
  options.byte_budget = 1 << 20;
  options.chunk_bytes = 1 << 18;
  sample_store<Policy> store(options);
  struct item {
    turbomap::keyframe_handle handle;
    std::size_t kind;
  };
  using pinned_type = typename sample_store<Policy>::pinned_type;
  std::vector<item> inside;
  std::vector<std::pair<pinned_type, std::vector<std::size_t>>> pinned;
  std::mt19937 random(5);
  int full = 0;
  for (int step = 0; step < steps; ++step) {
    const unsigned what = random() % 10;
    if (what < 4) {
      const std::size_t kind = random() % kinds.size();
      try {
        inside.push_back({store.insert(kinds[kind].data()), kind});
      } catch (const turbomap::out_of_memory&) {
        ++full;
      }
    } else if (what < 6 && !inside.empty()) {
      const std::size_t i = random() % inside.size();
      store.erase(inside[i].handle);
      inside.erase(inside.begin() + static_cast<std::ptrdiff_t>(i));
    } else if (what < 8 && !inside.empty()) {
      handles some;
      std::vector<std::size_t> which;
      for (unsigned j = random() % 6; j-- > 0;) {
        const item& one = inside[random() % inside.size()];
        some.push_back(one.handle);
        which.push_back(one.kind);
      }
      try {
        pinned.emplace_back(store.pin(ctx, some), which);
      } catch (const turbomap::out_of_memory&) {
        ++full;
      }
    } else if (!pinned.empty()) {
      const std::size_t i = random() % pinned.size();
      for (std::size_t j = 0; j < pinned[i].second.size(); ++j) {
        const auto& expected = blocks[pinned[i].second[j]];
        REQUIRE(block_of(ctx, pinned[i].first[j], expected.size()) == expected);
      }
      pinned.erase(pinned.begin() + static_cast<std::ptrdiff_t>(i));
    }
    if (pinned.size() > 8) pinned.erase(pinned.begin(), pinned.begin() + 4);
    if (inside.size() > 80) store.erase(inside[0].handle), inside.erase(inside.begin());
    REQUIRE(store.size() == inside.size());
    REQUIRE(store.statistics().peak_chunk_bytes <= options.byte_budget);
  }
  CHECK(store.statistics().page_outs > 20);
  CHECK(store.statistics().page_ins > 20);
  pinned.clear();
  ctx.synchronize();
  const auto s = store.statistics();
  CHECK(s.pinned_sets == 0);
  CHECK(s.resident_blocks + s.paged_blocks == inside.size());
  for (const item& one : inside) CHECK(holds<Policy>(store, ctx, one.handle, kinds[one.kind]));
}

}  // namespace turbomap_test

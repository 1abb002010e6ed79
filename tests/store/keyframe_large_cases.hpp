// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The test of keyframes larger than a chunk when room is short, for any execution policy.

#include <vector>

#include "keyframe_store_cases.hpp"

namespace turbomap_test {

/// A keyframe larger than a chunk finds room under a budget that small chunks have used up: those that were emptied are
/// returned for one of its size. What is in the way of that leaves everything as it was.
template <class Policy>
void check_large_keyframe() {
  using memory = turbomap::memory_of_t<Policy>;
  turbomap::context<Policy> ctx{Policy{}};
  std::vector<sample_keyframe> frames;
  for (unsigned i = 0; i < 30; ++i) frames.push_back(make_keyframe(i, 1200));
  const auto large = make_keyframe(30, 6000), largest = make_keyframe(31, 20000);
  counting_resource resident(turbomap::default_resource(memory{}));
  {
    turbomap::keyframe_store_options options;
    options.byte_budget = std::size_t{1} << 20;
    options.chunk_bytes = std::size_t{1} << 18;
    options.resident = &resident;
    sample_store<Policy> store(options);
    handles all;
    for (const auto& k : frames) all.push_back(store.insert(k.data()));

    auto before = state_of(store.statistics());
    CHECK_THROWS_AS(store.insert(largest.data()), turbomap::out_of_memory);  // above the budget, all chunks given up
    CHECK(state_of(store.statistics()) == before);
    resident.refuse_from = resident.allocations, resident.refusals = 2;
    CHECK_THROWS_AS(store.insert(large.data()),
                    turbomap::out_of_memory);  // a large chunk is refused, the old come back
    CHECK(state_of(store.statistics()) == before);
    CHECK(resident.bytes_out == store.statistics().chunk_bytes);
    resident.refuse_from = resident.allocations, resident.refusals = 1000;
    CHECK_THROWS_AS(store.insert(large.data()), turbomap::out_of_memory);  // not even those come back: nothing is lost
    CHECK(store.statistics().keyframes == frames.size());
    CHECK(store.statistics().resident_blocks + store.statistics().paged_blocks == frames.size());
    CHECK(resident.bytes_out == store.statistics().chunk_bytes);
    resident.refuse_from = -1;
    for (std::size_t i = 0; i < all.size(); ++i) CHECK(holds<Policy>(store, ctx, all[i], frames[i]));

    const auto handle = store.insert(large.data());
    CHECK(holds<Policy>(store, ctx, handle, large));
    CHECK(store.statistics().peak_chunk_bytes <= options.byte_budget);
    for (std::size_t i = 0; i < all.size(); ++i) CHECK(holds<Policy>(store, ctx, all[i], frames[i]));
    // Paged out by now, and brought back together with small ones, named before it.
    CHECK(store.pin(ctx, handles{all[0], all[1], all[2], all[3], handle}).size() == 5);
    CHECK(holds<Policy>(store, ctx, handle, large));

    // One keyframe is read and stays; all the others make room. Then too many are read, and nothing changes.
    const auto second = store.insert(large.data());
    for (const auto& k : frames) all.push_back(store.insert(k.data()));
    {
      const auto held = store.pin(ctx, handles{all.back()});
      CHECK(holds<Policy>(store, ctx, second, large));
      CHECK(block_of(ctx, held[0], packed(frames.back()).size()) == packed(frames.back()));
    }
    for (const auto handle_of_small : all) store.pin(ctx, handles{handle_of_small});
    before = state_of(store.statistics());  // the large ones find room, then a small one does not
    CHECK_THROWS_AS(store.pin(ctx, handles{all[0], all[1], handle, all[2], all[3], second}), turbomap::out_of_memory);
    CHECK(state_of(store.statistics()) == before);
    const auto held = store.pin(ctx, handles{all[30], all[33], all[36], all[39], all[42], all[45], all[48]});
    before = state_of(store.statistics());
    CHECK_THROWS_AS(store.pin(ctx, handles{handle, second}), turbomap::out_of_memory);
    CHECK(state_of(store.statistics()) == before);
    for (std::size_t i = 0; i < held.size(); ++i)
      CHECK(block_of(ctx, held[i], packed(frames[3 * i]).size()) == packed(frames[3 * i]));
    CHECK(store.statistics().peak_chunk_bytes <= options.byte_budget);
  }
  CHECK(resident.bytes_out == 0);
  CHECK(resident.mismatched == 0);

  turbomap::keyframe_store_options tight;  // a chunk and what is too little for a second one make a larger one
  tight.chunk_bytes = std::size_t{256} << 10;
  tight.byte_budget = std::size_t{336} << 10;
  sample_store<Policy> store(tight);
  handles all;
  for (std::size_t i = 0; i < 3; ++i) all.push_back(store.insert(frames[i].data()));
  const auto medium = make_keyframe(32, 4500);
  CHECK(holds<Policy>(store, ctx, store.insert(medium.data()), medium));
  for (std::size_t i = 0; i < 3; ++i) CHECK(holds<Policy>(store, ctx, all[i], frames[i]));
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

#include <doctest/doctest.h>

#include <turbomap/store/chunk_allocator.hpp>

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "scenes/keyframe_samples.hpp"

namespace {

using turbomap::chunk_allocator;
using turbomap::chunk_block;
using turbomap_test::counting_resource;

/// Addresses that nobody may touch: what a device's memory looks like to the host.
class untouchable_resource : public std::pmr::memory_resource {
  std::uintptr_t next_ = 0x10000000;
  void* do_allocate(std::size_t bytes, std::size_t) override {
    next_ += (bytes + 0xFFFF) / 0x10000 * 0x10000;
    return reinterpret_cast<void*>(next_ - (bytes + 0xFFFF) / 0x10000 * 0x10000);
  }
  void do_deallocate(void*, std::size_t, std::size_t) override {}
  bool do_is_equal(const memory_resource& other) const noexcept override { return this == &other; }
};

bool overlap(const chunk_block& a, const chunk_block& b) {
  return a.data < b.data + b.bytes && b.data < a.data + a.bytes;
}

TEST_CASE("blocks are aligned, apart, and in memory that the host does not touch") {
  untouchable_resource memory;
  counting_resource resource(&memory);
  {
    chunk_allocator allocator(&resource, 100000);
    std::vector<chunk_block> blocks;
    for (std::size_t i = 0; i < 300; ++i) blocks.push_back(allocator.allocate(37 * i));
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      CHECK(reinterpret_cast<std::uintptr_t>(blocks[i].data) % 256 == 0);
      CHECK(blocks[i].bytes >= 37 * i);
      CHECK(blocks[i].bytes % 256 == 0);
      for (std::size_t j = 0; j < i; ++j) CHECK_FALSE(overlap(blocks[i], blocks[j]));
    }
    CHECK(allocator.block_count() == 300);
    CHECK(allocator.reserved_bytes() == resource.bytes_out);
    std::shuffle(blocks.begin(), blocks.end(), std::mt19937(1));
    for (const auto& block : blocks) allocator.deallocate(block);
    CHECK(allocator.used_bytes() == 0);
    CHECK(allocator.empty_chunks() == allocator.chunk_count());
    CHECK(allocator.free_range_count() == allocator.chunk_count());  // all neighbours have been joined
    allocator.release_empty(1);
    CHECK(allocator.chunk_count() == 1);
    CHECK(allocator.reserved_bytes() == resource.bytes_out);
  }
  CHECK(resource.bytes_out == 0);
  CHECK(resource.mismatched == 0);
}

TEST_CASE("the smallest hole that fits is used, and neighbours join") {
  untouchable_resource memory;
  chunk_allocator allocator(&memory, 256 * 100);
  std::vector<chunk_block> b;
  for (std::size_t units : {10, 1, 3, 1, 6, 1}) b.push_back(allocator.allocate(256 * units));
  allocator.deallocate(b[0]);
  allocator.deallocate(b[2]);
  allocator.deallocate(b[4]);
  CHECK(allocator.allocate(256 * 2).data == b[2].data);
  CHECK(allocator.allocate(256 * 5).data == b[4].data);
  allocator.deallocate(b[1]);  // joins the ten before it
  CHECK(allocator.allocate(256 * 11).data == b[0].data);
  CHECK(allocator.chunk_count() == 1);
}

TEST_CASE("a limit bounds all chunks; the last one is as small as need be; large blocks get their own chunk") {
  untouchable_resource memory;
  chunk_allocator allocator(&memory, 256 * 10, 256 * 25);
  CHECK(allocator.allocate(256 * 10));
  CHECK(allocator.allocate(256 * 10));
  CHECK(allocator.try_grow(256 * 6) == chunk_allocator::growth::over_limit);
  CHECK_THROWS_AS(allocator.allocate(256 * 6), turbomap::out_of_memory);
  CHECK(allocator.reserved_bytes() == 256 * 20);
  CHECK(allocator.allocate(256 * 5));
  CHECK(allocator.reserved_bytes() == 256 * 25);
  CHECK_THROWS_AS(allocator.allocate(1), turbomap::out_of_memory);
  chunk_allocator unlimited(&memory, 1000);
  CHECK(unlimited.allocate(12345).bytes == 12544);
  CHECK(unlimited.reserved_bytes() == 12544);
  chunk_allocator nothing(&memory, 1000, 100);
  CHECK_THROWS_AS(nothing.allocate(1), turbomap::out_of_memory);
}

TEST_CASE("a resource that refuses leaves everything as it was") {
  counting_resource resource(std::pmr::get_default_resource());
  chunk_allocator allocator(&resource, 4096);
  allocator.allocate(4096);
  resource.refuse_from = 1, resource.refusals = 1;
  CHECK_THROWS_AS(allocator.allocate(100), turbomap::out_of_memory);
  CHECK(allocator.chunk_count() == 1);
  CHECK(allocator.block_count() == 1);
  CHECK(allocator.allocate(100));
}

/// Everything that an undone operation must restore.
std::vector<std::size_t> state_of(const chunk_allocator& a) {
  return {a.reserved_bytes(), a.used_bytes(), a.block_count(), a.chunk_count(), a.free_range_count(), a.empty_chunks()};
}

TEST_CASE("random operations: no overlap, joined neighbours, and claim() undoes deallocate()") {
  untouchable_resource memory;
  chunk_allocator allocator(&memory, 1 << 16);
  std::mt19937 random(3);
  std::vector<chunk_block> live;
  for (int step = 0; step < 20000; ++step) {
    if (random() % 2 == 0 && live.size() < 100) {
      live.push_back(allocator.allocate(random() % 9000));
    } else if (!live.empty()) {
      const std::size_t i = random() % live.size();
      allocator.deallocate(live[i]);
      live[i] = live.back();
      live.pop_back();
      if (step % 7 == 0) allocator.release_empty(random() % 3);
    }
    if (step % 50 == 0 && live.size() > 4) {  // give some back, use the room, take all of it back
      const auto before = state_of(allocator);
      const auto old = live;
      std::shuffle(live.begin(), live.end(), random);
      const std::size_t given = 1 + random() % (live.size() - 1);
      for (std::size_t i = 0; i < given; ++i) allocator.deallocate(live[i]);
      std::vector<chunk_block> between;
      for (int i = 0; i < 5; ++i)
        if (const auto block = allocator.try_allocate(random() % 5000)) between.push_back(block);
      for (const auto& block : between) allocator.deallocate(block);
      for (std::size_t i = given; i-- > 0;) {
        const std::byte* where = live[i].data;
        const std::size_t bytes = live[i].bytes;
        allocator.claim(live[i]);
        REQUIRE(live[i].data == where);
        REQUIRE(live[i].bytes == bytes);
      }
      REQUIRE(state_of(allocator) == before);
    }
    if (step % 100 == 0)
      for (std::size_t i = 0; i < live.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) REQUIRE_FALSE(overlap(live[i], live[j]));
  }
  for (const auto& block : live) allocator.deallocate(block);
  CHECK(allocator.free_range_count() == allocator.chunk_count());
  allocator.release_empty(0);
  CHECK(allocator.reserved_bytes() == 0);
}

}  // namespace

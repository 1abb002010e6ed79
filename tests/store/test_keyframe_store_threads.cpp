// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Threads insert and erase while others pin and read; made for the thread sanitizer.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <turbomap/context.hpp>
#include <turbomap/store/keyframe_store.hpp>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <mutex>
#include <random>
#include <thread>
#include <vector>

#include "scenes/keyframe_samples.hpp"

namespace {

using namespace turbomap_test;
using store_type = turbomap::keyframe_store<sample_descriptor, sample_camera>;

/// Handles that are believed to be alive, with the kind of keyframe behind each.
class shared_list {
 public:
  struct item {
    turbomap::keyframe_handle handle;
    std::size_t kind;
  };
  void add(item one) {
    const std::lock_guard<std::mutex> lock(mutex_);
    items_.push_back(one);
  }
  bool take(unsigned number, item& one) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (items_.empty()) return false;
    std::swap(items_[number % items_.size()], items_.back());
    one = items_.back();
    items_.pop_back();
    return true;
  }
  std::vector<item> some(unsigned number, std::size_t count) {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::vector<item> result;
    for (std::size_t i = 0; i < count && !items_.empty(); ++i)
      result.push_back(items_[(number + i * 31) % items_.size()]);
    return result;
  }
  std::size_t size() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return items_.size();
  }

 private:
  std::mutex mutex_;
  std::vector<item> items_;
};

void hammer(const turbomap::keyframe_store_options& options, int steps) {
  std::vector<sample_keyframe> kinds;
  std::vector<std::vector<std::byte>> blocks;
  for (unsigned i = 0; i < 8; ++i) {
    kinds.push_back(make_keyframe(i, 20 + 30 * static_cast<int>(i), 1 + static_cast<int>(i % 2)));
    blocks.push_back(packed(kinds.back()));
  }
  store_type store(options);
  shared_list list;
  std::atomic<int> wrong{0}, inserted{0}, erased{0}, read{0}, stale{0}, full{0};
  std::atomic<bool> stop{false};

  std::vector<std::thread> writers, readers;
  for (unsigned t = 0; t < 2; ++t)
    writers.emplace_back([&, t] {
      std::mt19937 random(t);
      for (int step = 0; step < steps; ++step) {
        if (list.size() < 40 || random() % 2 == 0) {
          const std::size_t kind = random() % kinds.size();
          try {
            list.add({store.insert(kinds[kind].data()), kind});
            ++inserted;
          } catch (const turbomap::out_of_memory&) {
            ++full;
          }
        } else if (shared_list::item one; list.take(random(), one)) {
          store.erase(one.handle);
          ++erased;
        }
      }
    });
  for (unsigned t = 0; t < 2; ++t)
    readers.emplace_back([&, t] {
      std::mt19937 random(100 + t);
      while (!stop) {
        const auto some = list.some(random(), 1 + random() % 4);
        std::vector<turbomap::keyframe_handle> handles;
        for (const auto& one : some) handles.push_back(one.handle);
        try {
          const auto pinned = store.pin(thrust::seq, handles);
          std::this_thread::yield();  // time for it to be erased meanwhile
          for (std::size_t i = 0; i < some.size(); ++i) {
            const auto& expected = blocks[some[i].kind];
            if (std::memcmp(pinned[i].pixel, expected.data(), expected.size()) != 0) ++wrong;
            ++read;
          }
        } catch (const turbomap::stale_handle&) {
          ++stale;
        } catch (const turbomap::out_of_memory&) {
          ++full;
        }
      }
    });
  std::thread watcher([&] {
    while (!stop) {
      const auto s = store.statistics();
      if (options.byte_budget != 0 && s.chunk_bytes > options.byte_budget) ++wrong;
      std::this_thread::yield();
    }
  });
  for (auto& thread : writers) thread.join();
  stop = true;
  for (auto& thread : readers) thread.join();
  watcher.join();

  CHECK(wrong == 0);
  CHECK(read > 0);
  CHECK(inserted - erased == static_cast<int>(store.size()));
  CHECK(list.size() == store.size());
  const auto s = store.statistics();
  CHECK(s.pinned_sets == 0);
  CHECK(s.resident_blocks + s.paged_blocks == s.keyframes);
  if (options.byte_budget != 0) CHECK(s.page_outs > 0);
  MESSAGE(inserted.load(), " inserted, ", erased.load(), " erased, ", read.load(), " read, ", stale.load(), " stale, ",
          full.load(), " without room, ", s.page_outs, " paged out");
}

TEST_CASE("insertions and erasures while others read") {
  turbomap::keyframe_store_options options;
  options.chunk_bytes = 1 << 17;
  hammer(options, 1500);
}

TEST_CASE("the same with paging") {
  turbomap::keyframe_store_options options;
  options.chunk_bytes = 1 << 17;
  options.byte_budget = 1 << 18;
  hammer(options, 1500);
}

}  // namespace

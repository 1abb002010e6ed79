// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Replaces operator new of a test program: allocations and their bytes are counted, and they fail when the test says so. For one
/// file of a program, which no other part may include.

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <new>

namespace turbomap_test {

inline constexpr long no_limit = std::numeric_limits<long>::max();

inline std::atomic<long> allocations{0};
inline std::atomic<std::size_t> allocated_bytes{0};   ///< of all allocations, those that were given back included
inline std::atomic<long> allocations_left{no_limit};  ///< until they fail
inline std::atomic<bool> fails_once{false};           ///< one of them, not all that follow

/// Lets allocation number `n` from now on fail, and all after it until it is destroyed; or that one only.
template <bool Once>
struct failing_memory {
  explicit failing_memory(long n) { fails_once = Once, allocations_left = n; }
  failing_memory(const failing_memory&) = delete;
  failing_memory& operator=(const failing_memory&) = delete;
  ~failing_memory() { allocations_left = no_limit; }
};
using no_memory_after = failing_memory<false>;
using no_memory_once = failing_memory<true>;

inline void* counted_new(std::size_t bytes, std::size_t alignment) {
  if (allocations_left != no_limit && allocations_left-- <= 0) {
    if (fails_once) allocations_left = no_limit;
    throw std::bad_alloc();
  }
  ++allocations;
  allocated_bytes += bytes;
  bytes = (bytes + alignment - 1) / alignment * alignment;
  void* memory = std::aligned_alloc(alignment, bytes == 0 ? alignment : bytes);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace turbomap_test

// Out of line: a compiler that inlines only one of the two sees aligned_alloc() freed by operator delete.
[[gnu::noinline]] void* operator new(std::size_t n) { return turbomap_test::counted_new(n, alignof(std::max_align_t)); }
[[gnu::noinline]] void* operator new(std::size_t n, std::align_val_t a) {
  return turbomap_test::counted_new(n, static_cast<std::size_t>(a));
}
[[gnu::noinline]] void operator delete(void* p) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }

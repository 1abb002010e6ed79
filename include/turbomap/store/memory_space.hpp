// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the keyframe store needs to know about a kind of memory: how bytes get there and back, and when work that reads
/// it is done. Here for host memory; for device memory in cuda/memory_space.cuh.

#include <cstddef>
#include <cstring>
#include <memory_resource>

#include "../config.hpp"
#include "../memory.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Carries blocks between the host and the memory of a store. One thread at a time; copies are done after wait().
template <class Memory>
class transfer_lane {
  static_assert(
      sizeof(Memory) == 0,
      "turbomap: a keyframe_store in device memory needs a compiler for CUDA: keep it behind your own type in a .cu "
      "file (docs/traits.md)");
};

/// Copies within host memory; a block is packed where it is to lie, and then nothing is copied.
template <>
class transfer_lane<host_memory> {
 public:
  /// Needs no memory of its own.
  explicit transfer_lane(std::pmr::memory_resource*) {}
  /// Makes room to pack a block of this size.
  void reserve(std::size_t) {}
  /// Where to pack a block that is to lie at `resident`: there.
  std::byte* packing_area(std::byte* resident) { return resident; }
  /// Copies `bytes` bytes, unless they are there.
  void upload(std::byte* resident, const std::byte* host, std::size_t bytes) {
    if (resident != host) std::memcpy(resident, host, bytes);
  }
  /// Copies `bytes` bytes back.
  void download(std::byte* host, const std::byte* resident, std::size_t bytes) { std::memcpy(host, resident, bytes); }
  /// Copies are done: nothing to wait for.
  void wait() {}
  /// After a failed copy: none is under way any more, so that memory can be given back. Nothing to wait for.
  void settle() noexcept {}
};

/// Where memory is taken, whichever thread asks: made when a store is.
template <class Memory>
class memory_home;

/// There is one host.
template <>
class memory_home<host_memory> {
 public:
  /// Nothing to do.
  struct visit {
    explicit visit(const memory_home&) noexcept {}  ///< nothing to do
    ~visit() {}
  };
};

/// The order in which a policy's work is done: nothing for host policies, whose calls return when they are done; the
/// stream of a CUDA policy.
template <class Memory>
struct work_order {};

/// The order of a host policy: none.
template <class Derived>
work_order<host_memory> order_of(const thrust::execution_policy<Derived>&) {
  return {};
}

/// A mark behind the work enqueued so far.
template <class Memory>
class fence;

/// Work of a host policy is done when its call returns.
template <>
class fence<host_memory> {
 public:
  /// Nothing to mark.
  void record(work_order<host_memory>) noexcept {}
  /// Always.
  bool passed() noexcept { return true; }
  /// Nothing to wait for.
  void wait() noexcept {}
};

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/memory_space.cuh"
#endif

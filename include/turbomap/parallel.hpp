// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What every algorithm asks of an execution policy: run a function object for each index, move bytes between the host
/// and the policy's memory, wait. The overloads for CUDA stand in cuda/parallel.cuh and are chosen by partial ordering.

#include <cstddef>
#include <cstring>

#include "config.hpp"
#include "index_iterator.hpp"
#include "memory.hpp"
#include "sequential_policy.hpp"

#if TURBOMAP_HAS_CUDA
#include "cuda/parallel.cuh"
#endif

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Calls f(i) from the one compiled body that all host policies share.
template <class Function>
TURBOMAP_ONE_BODY void run_index(const void* f, int i) {
  (*static_cast<const Function*>(f))(i);
}

/// What Thrust runs under a host policy. It knows no function object, so Thrust is compiled once per policy, not once per
/// piece of work.
struct index_caller {
  const void* f;
  void (*run)(const void* f, int i);
  void operator()(int i) const { run(f, i); }
};

/// for_each_index of a host policy. Thrust's own for_each_n() of the policy is found by its argument, as Thrust finds it; none of
/// Thrust's algorithms is included here. Who makes the policy includes the header of its loops, as <thrust/execution_policy.h>.
template <class Policy>
void call_indices(Policy& policy, int n, const index_caller& caller) {
  for_each_n(policy, plain_detail::index_iterator(0), n, caller);
}
inline void call_indices(sequential_policy&, int n, const index_caller& caller) {
  for (int i = 0; i < n; ++i) caller(i);
}
inline void call_indices(thrust::detail::seq_t& policy, int n, const index_caller& caller) {
  sequential_policy same(policy);
  call_indices(same, n, caller);
}

}  // namespace detail

/// Calls f(i) for i in [0, n), in any order and possibly concurrently, as the policy says. On a device `f` is copied by value
/// and must hold plain views only. Returns when the work is done (host) or enqueued (CUDA).
///
/// All host policies run the same instructions, so they give the same bits, whatever flags the program is compiled with;
/// the type of `f` must not depend on the policy for that. The call costs about 1 ns per index.
template <class Derived, class Function>
void for_each_index(const thrust::execution_policy<Derived>& policy, int n, const Function& f) {
  detail::call_indices(thrust::detail::derived_cast(thrust::detail::strip_const(policy)), n,
                       {&f, &detail::run_index<Function>});
}

/// Copies bytes from the host into the policy's memory. On CUDA: enqueued; the source must be pinned and stay unchanged
/// until the stream has passed.
template <class Derived>
void copy_in(const thrust::execution_policy<Derived>&, void* destination, const void* source, std::size_t bytes) {
  if (bytes != 0 && destination != source) std::memcpy(destination, source, bytes);
}

/// Whether copy_in() from there returns before it is done and takes nothing of the host: of page-locked memory under CUDA.
template <class Derived>
bool is_page_locked(const thrust::execution_policy<Derived>&, const void*, std::size_t) {
  return false;
}

/// Copies bytes from the policy's memory to the host. On CUDA: enqueued; read the destination after synchronize().
template <class Derived>
void copy_out(const thrust::execution_policy<Derived>&, void* destination, const void* source, std::size_t bytes) {
  if (bytes != 0 && destination != source) std::memcpy(destination, source, bytes);
}

/// Sets bytes in the policy's memory.
template <class Derived>
void fill_bytes(const thrust::execution_policy<Derived>&, void* destination, unsigned char value, std::size_t bytes) {
  if (bytes != 0) std::memset(destination, value, bytes);
}

/// Waits until everything enqueued under the policy is done.
template <class Derived>
void synchronize(const thrust::execution_policy<Derived>&) {}

TURBOMAP_END_NAMESPACE

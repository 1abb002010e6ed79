// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which memory an execution policy computes in, and the default resources of that memory. Every buffer of the library
/// takes a std::pmr::memory_resource, so a user's own allocator serves the host and the device alike.

#include <cstddef>
#include <memory_resource>
#include <utility>

#include <thrust/detail/execution_policy.h>

#include "config.hpp"
#include "error.hpp"
#include "sequential_policy.hpp"

#if TURBOMAP_HAS_CUDA
#include <thrust/system/cuda/detail/execution_policy.h>
#endif

namespace turbomap {

/// Memory that the host reads and writes directly.
struct host_memory {};

/// Memory of a CUDA device.
struct device_memory {};

/// Whether the host reads and writes a kind of memory directly: then nothing is copied there or back.
template <class Memory>
inline constexpr bool is_host_accessible_v = true;
/// False: bytes of a device are copied.
template <>
inline constexpr bool is_host_accessible_v<device_memory> = false;

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// \name The memory a policy computes in
/// Both stand here because memory_of_t finds only what is declared before it, whichever header of the library comes first.
/// @{

/// Host memory, unless the overload for CUDA is chosen. Declared only, for decltype.
template <class Derived>
host_memory memory_of(const thrust::execution_policy<Derived>&);
/// The same of thrust::seq, whose type may be incomplete here.
host_memory memory_of(const thrust::detail::seq_t&);
#if TURBOMAP_HAS_CUDA
template <class Derived>
device_memory memory_of(const thrust::cuda_cub::execution_policy<Derived>&);
#endif
/// @}

/// host_memory or device_memory.
template <class Policy>
using memory_of_t = decltype(memory_of(std::declval<const Policy&>()));

/// The policy itself, of a reference to its base class: what a launcher hands on, so that overloads for the policy are
/// found.
template <class Derived>
const Derived& derived(const thrust::execution_policy<Derived>& policy) {
  return static_cast<const Derived&>(policy);
}

/// Bytes start at multiples of this in every packed block of the library: the widest vector load of host and device.
inline constexpr std::size_t block_alignment = 64;

/// `n` rounded up to a multiple of `alignment`.
TURBOMAP_HD constexpr std::size_t align_up(std::size_t n, std::size_t alignment = block_alignment) {
  return (n + alignment - 1) / alignment * alignment;
}

/// The resources of host memory: where a host policy computes, and where its calls are staged, are the same.
inline std::pmr::memory_resource* default_resource(host_memory) { return std::pmr::get_default_resource(); }
/// Where the calls of a host policy are staged; see above.
inline std::pmr::memory_resource* default_staging_resource(host_memory) { return std::pmr::get_default_resource(); }

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/memory.cuh"
#endif

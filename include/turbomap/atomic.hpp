// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The two atomic operations that bodies run under any policy need. Only operations whose result does not depend on the
/// order are here: integers, minimum and count.

#include <cstdint>

#include "config.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Adds one.
TURBOMAP_HD inline void atomic_increment(std::int32_t* counter) {
#if defined(__CUDA_ARCH__)
  atomicAdd(counter, 1);
#else
  __atomic_fetch_add(counter, 1, __ATOMIC_RELAXED);
#endif
}

/// Replaces *least by value if that is less.
TURBOMAP_HD inline void atomic_min(std::uint64_t* least, std::uint64_t value) {
#if defined(__CUDA_ARCH__)
  atomicMin(reinterpret_cast<unsigned long long*>(least), static_cast<unsigned long long>(value));
#else
  std::uint64_t current = __atomic_load_n(least, __ATOMIC_RELAXED);
  while (value < current &&
         !__atomic_compare_exchange_n(least, &current, value, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {
  }
#endif
}

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reads and writes of a few numbers that follow each other, two at a time where they can be: a warp whose lanes are far apart
/// pays for every access of each lane.

#include <type_traits>

#include "../../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class A>
using number_pair = std::conditional_t<sizeof(A) == 4, float2, double2>;

/// \param from  where N is even: aligned to two numbers
template <int N, class A>
__device__ inline void load_numbers(const A* from, A (&to)[N]) {
  if constexpr (N % 2 == 0) {
    const auto* const pairs = reinterpret_cast<const number_pair<A>*>(from);
#pragma unroll
    for (int i = 0; i < N / 2; ++i) {
      const number_pair<A> p = pairs[i];
      to[2 * i] = p.x, to[2 * i + 1] = p.y;
    }
  } else {
#pragma unroll
    for (int i = 0; i < N; ++i) to[i] = from[i];
  }
}

/// \param to  as `from`
template <int N, class A>
__device__ inline void store_numbers(const A (&from)[N], A* to) {
  if constexpr (N % 2 == 0) {
    auto* const pairs = reinterpret_cast<number_pair<A>*>(to);
#pragma unroll
    for (int i = 0; i < N / 2; ++i) {
      number_pair<A> p;
      p.x = from[2 * i], p.y = from[2 * i + 1];
      pairs[i] = p;
    }
  } else {
#pragma unroll
    for (int i = 0; i < N; ++i) to[i] = from[i];
  }
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Descriptors of real numbers (SIFT, SuperPoint, ...): float, 16-bit or 8-bit storage, squared Euclidean distance.

#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../math/strict.hpp"
#include "half.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

TURBOMAP_HD inline float as_float(float a) { return a; }
TURBOMAP_HD inline float as_float(half a) { return to_float(a); }

/// Under -ffast-math keeps sums in their order, at the price of SIMD; nothing otherwise.
TURBOMAP_HD inline float in_order(float a) {
#if defined(__FAST_MATH__)
  return rounded(a);
#else
  return a;
#endif
}

/// (a - b)^2 + sum: the difference is rounded, then the rest once.
TURBOMAP_HD inline float add_square(float a, float b, float sum) {
  const float d = in_order(in_order(a) - in_order(b));
#if defined(__CUDA_ARCH__)
  return __fmaf_rn(d, d, sum);
#else
  return in_order(std::fma(d, d, sum));
#endif
}

inline constexpr int lanes =
    16;  ///< partial sums of squared_distance; the length of the widest SIMD register in floats

/// lane[l] += (a[16 B + l] - b[16 B + l])^2, block after block. Lane by lane with the blocks unrolled inside, since
/// that is one innermost loop with unit strides, which g++ vectorises wherever it is inlined; the other way round it
/// does not.
template <class Storage, int... Blocks>
TURBOMAP_HD inline void add_blocks(const Storage* a, const Storage* b, float* lane,
                                   std::integer_sequence<int, Blocks...>) {
  for (int l = 0; l < lanes; ++l) {
    float sum = lane[l];
    ((sum = add_square(as_float(a[lanes * Blocks + l]), as_float(b[lanes * Blocks + l]), sum)), ...);
    lane[l] = sum;
  }
}

/// lane l += lane l + Lanes / 2, until one is left. By constants, so that it unrolls.
template <int Lanes>
TURBOMAP_HD inline float sum_of_lanes(float* lane) {
  if constexpr (Lanes > 1) {
    for (int l = 0; l < Lanes / 2; ++l) lane[l] = in_order(lane[l] + lane[l + Lanes / 2]);
    return sum_of_lanes<Lanes / 2>(lane);
  }
  return lane[0];
}

/// Sum of (a - b)^2. The order of the sum is part of the result: element i goes to lane i % 16 by a fused multiply-add,
/// then lane l takes lane l + 8, l + 4, l + 2, l + 1. So all compilers and policies agree to the last bit, and the
/// lanes are SIMD.
template <int Length, class Storage>
TURBOMAP_HD inline float squared_distance(const Storage* a, const Storage* b) {
  constexpr int chunk = 8, chunks = Length / (lanes * chunk), rest = Length / lanes % chunk;
  float lane[lanes] = {};
  for (int c = 0; c < chunks; ++c)
    add_blocks(a + c * chunk * lanes, b + c * chunk * lanes, lane, std::make_integer_sequence<int, chunk>());
  constexpr int done = chunks * chunk * lanes, whole = done + rest * lanes;
  if constexpr (rest > 0) add_blocks(a + done, b + done, lane, std::make_integer_sequence<int, rest>());
  for (int l = 0; l < Length - whole; ++l) {
    lane[l] = add_square(as_float(a[whole + l]), as_float(b[whole + l]), lane[l]);
  }
  return sum_of_lanes<lanes>(lane);
}

/// Whole numbers: exact in any order.
template <int Length>
TURBOMAP_HD inline std::int32_t squared_distance(const std::int8_t* a, const std::int8_t* b) {
  std::int32_t sum = 0;
  for (int i = 0; i < Length; ++i) {
    const std::int32_t d = static_cast<std::int32_t>(a[i]) - static_cast<std::int32_t>(b[i]);
    sum += d * d;
  }
  return sum;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

namespace turbomap {

/// A descriptor of `Length` numbers stored as float, half or std::int8_t, compared by the squared Euclidean distance: a
/// float, or for std::int8_t an exact std::int32_t. On the host compile for a processor with fused multiply-add
/// (x86-64-v3): without one the same bits take a library call per element.
template <class Storage, int Length>
struct real_descriptor {
  static_assert(Length > 0, "turbomap: a descriptor has at least one element");
  static_assert(std::is_same_v<Storage, float> || std::is_same_v<Storage, half> || std::is_same_v<Storage, std::int8_t>,
                "turbomap: a real descriptor is stored as float, turbomap::half or std::int8_t");
  static_assert(!std::is_same_v<Storage, std::int8_t> || Length <= 33025,
                "turbomap: the distance of longer 8-bit descriptors does not fit 32 bits");
  using element = Storage;  ///< as it is stored.
  /// Of the square of a distance.
  using distance_type = std::conditional_t<std::is_same_v<Storage, std::int8_t>, std::int32_t, float>;
  static constexpr bool squared = true;                                              ///< see distance_type
  static constexpr int elements = Length;                                            ///< of one descriptor
  static constexpr int bytes = Length * static_cast<int>(sizeof(Storage));           ///< of one descriptor
  static constexpr distance_type worst = std::numeric_limits<distance_type>::max();  ///< no pair is farther

  /// Squared Euclidean distance; both aligned to their element.
  /// (Always inlined: nothing is left that the linker could merge with a version for another processor.)
  [[gnu::always_inline]] static inline TURBOMAP_HD distance_type distance(const element* a, const element* b) {
    return detail::squared_distance<Length>(a, b);
  }
};

}  // namespace turbomap

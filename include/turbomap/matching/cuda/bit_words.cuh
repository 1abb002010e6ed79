// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Descriptors as a kernel keeps them while it compares them with many others: bits as words in registers, all others where
/// they are.

#include <cstdint>
#include <type_traits>

#include "../../config.hpp"
#include "../../descriptor/binary.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The number of bits that are set in eight words. Counting bits is the slowest step, so three words at a time are added bit
/// by bit first (a full adder is two instructions): four counts instead of eight [Harley and Seal].
__device__ inline int count_bits(const std::uint32_t (&w)[8]) {
  const auto sum = [](std::uint32_t a, std::uint32_t b, std::uint32_t c) { return a ^ b ^ c; };
  const auto carry = [](std::uint32_t a, std::uint32_t b, std::uint32_t c) { return (a & b) | (a & c) | (b & c); };
  const std::uint32_t s1 = sum(w[0], w[1], w[2]), c1 = carry(w[0], w[1], w[2]);
  const std::uint32_t s2 = sum(w[3], w[4], w[5]), c2 = carry(w[3], w[4], w[5]);
  const std::uint32_t ones = sum(s1, s2, w[6]), c3 = carry(s1, s2, w[6]);
  const std::uint32_t twos = sum(c1, c2, c3), fours = carry(c1, c2, c3);
  return __popc(ones) + __popc(w[7]) + 2 * __popc(twos) + 4 * __popc(fours);
}

}  // namespace detail

/// Any descriptor: read anew for each comparison.
template <class Descriptor>
struct kept_descriptor {
  const typename Descriptor::element* at;  ///< the descriptor, where it is

  /// Whether descriptors that begin at `first` can be kept this way.
  __device__ static bool fits(const typename Descriptor::element*) { return true; }
  /// Notes where a descriptor is.
  __device__ static kept_descriptor load(const typename Descriptor::element* from) { return {from}; }
  /// As of the descriptor.
  __device__ typename Descriptor::distance_type distance(const kept_descriptor& b) const {
    return Descriptor::distance(at, b.at);
  }
};

/// Bits in rows of whole words, which begin at multiples of 16 bytes where a row is as long, else of 4.
template <int Bits>
struct kept_bits {
  using element = std::uint8_t;                        ///< of a row
  static constexpr int words = Bits / 32;              ///< of 32 bits
  static constexpr int step = words % 4 == 0 ? 4 : 1;  ///< words per load
  std::uint32_t word[words];                           ///< the bits

  /// Whether descriptors that begin at `first` can be kept this way.
  __device__ static bool fits(const element* first) {
    return reinterpret_cast<std::uintptr_t>(first) % (4 * step) == 0;
  }
  /// Loads a descriptor for which fits() held.
  __device__ static kept_bits load(const element* from) {
    kept_bits r;
    if constexpr (step == 4) {
#pragma unroll
      for (int i = 0; i < words / 4; ++i) {
        const uint4 w = reinterpret_cast<const uint4*>(from)[i];
        r.word[4 * i] = w.x, r.word[4 * i + 1] = w.y, r.word[4 * i + 2] = w.z, r.word[4 * i + 3] = w.w;
      }
    } else {
#pragma unroll
      for (int i = 0; i < words; ++i) r.word[i] = reinterpret_cast<const std::uint32_t*>(from)[i];
    }
    return r;
  }
  /// Number of bits that differ.
  __device__ std::int32_t distance(const kept_bits& b) const {
    int count = 0;
#pragma unroll
    for (int i = 0; i < words / 8 * 8; i += 8) {
      std::uint32_t w[8];
#pragma unroll
      for (int k = 0; k < 8; ++k) w[k] = word[i + k] ^ b.word[i + k];
      count += detail::count_bits(w);
    }
#pragma unroll
    for (int i = words / 8 * 8; i < words; ++i) count += __popc(word[i] ^ b.word[i]);
    return count;
  }
};

/// How descriptors are kept where their rows fit.
template <class Descriptor>
struct kept_form {
  using type = kept_descriptor<Descriptor>;  ///< read anew for each comparison
};
/// Bits: in registers where rows are whole words.
template <int Bits>
struct kept_form<binary_descriptor<Bits>> {
  using type = std::conditional_t<Bits % 32 == 0, kept_bits<Bits>,
                                  kept_descriptor<binary_descriptor<Bits>>>;  ///< as its rows allow
};

TURBOMAP_END_NAMESPACE

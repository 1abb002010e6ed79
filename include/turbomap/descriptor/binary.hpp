// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Binary descriptors (ORB, BRISK, AKAZE, ...) and their Hamming distance.

#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>

#include "../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

TURBOMAP_HD inline std::uint64_t popcount(std::uint64_t bits) {
#if defined(__CUDA_ARCH__)
  return static_cast<std::uint64_t>(__popcll(bits));
#else
  return static_cast<std::uint64_t>(__builtin_popcountll(bits));
#endif
}

/// Word `Word` of an array of `Bytes` bytes at any address; a short last word is filled with zeros.
template <int Bytes, int Word>
TURBOMAP_HD inline std::uint64_t load_word(const std::uint8_t* a) {
  constexpr int left = Bytes - 8 * Word;
  std::uint64_t word = 0;
  std::memcpy(&word, a + 8 * Word, left < 8 ? left : 8);
  return word;
}

/// The bits in which two arrays differ. A fold, not a loop: compilers unroll it at every level, without a pragma.
template <int Bytes, int... Words>
TURBOMAP_HD inline std::int32_t hamming_words(const std::uint8_t* a, const std::uint8_t* b,
                                              std::integer_sequence<int, Words...>) {
  return static_cast<std::int32_t>((popcount(load_word<Bytes, Words>(a) ^ load_word<Bytes, Words>(b)) + ...));
}

template <int Bytes>
TURBOMAP_HD inline std::int32_t hamming_distance(const std::uint8_t* a, const std::uint8_t* b) {
#if defined(__CUDA_ARCH__)
  // The device cannot load an unaligned word: there memcpy falls apart into bytes. Descriptors in a row are aligned.
  using word = std::uint32_t;
  constexpr int size = sizeof(word), whole = Bytes / size * size;
  if ((reinterpret_cast<std::uintptr_t>(a) | reinterpret_cast<std::uintptr_t>(b)) % size == 0) {
    std::int32_t sum = 0;
#pragma unroll
    for (int i = 0; i < whole; i += size)
      sum += __popc(*reinterpret_cast<const word*>(a + i) ^ *reinterpret_cast<const word*>(b + i));
#pragma unroll
    for (int i = whole; i < Bytes; ++i) sum += __popc(static_cast<word>(a[i] ^ b[i]));
    return sum;
  }
#endif
  return hamming_words<Bytes>(a, b, std::make_integer_sequence<int, (Bytes + 7) / 8>());
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

namespace turbomap {

/// A descriptor of `Bits` bits, compared by the Hamming distance.
template <int Bits>
struct binary_descriptor {
  static_assert(Bits > 0 && Bits % 8 == 0, "turbomap: the bits of a binary descriptor are whole bytes");
  using element = std::uint8_t;              ///< what it is an array of.
  using distance_type = std::int32_t;        ///< what distance() gives.
  static constexpr int elements = Bits / 8;  ///< of one descriptor.
  static constexpr int bytes = Bits / 8;     ///< of one descriptor.
  /// Farther than any two descriptors.
  static constexpr distance_type worst = std::numeric_limits<distance_type>::max();
  /// No two are farther apart.
  static constexpr distance_type greatest = Bits;

  /// Number of different bits, 0 to Bits. The descriptors may lie at any address.
  /// (Always inlined: nothing is left that the linker could merge with a version for another processor.)
  [[gnu::always_inline]] static inline TURBOMAP_HD distance_type distance(const element* a, const element* b) {
    return detail::hamming_distance<bytes>(a, b);
  }
  /// That of the first half: never more than distance(), at half the cost. Most descriptors that are not alike differ by
  /// more than a match may already there.
  [[gnu::always_inline]] static inline TURBOMAP_HD distance_type at_least(const element* a, const element* b) {
    return detail::hamming_distance<(bytes + 1) / 2>(a, b);
  }
};

}  // namespace turbomap

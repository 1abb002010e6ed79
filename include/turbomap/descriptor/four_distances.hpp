// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Hamming distances of four pairs of binary descriptors at once, where the processor has vectors of 256 bits: the different bits of
/// each pair in four parts, then the sums of four pairs together.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

#include "../config.hpp"
#include "../math/native_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

#if TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES >= 32

namespace detail {

/// Whether the processor counts the bits of a vector by one instruction: four pairs together are faster than one by one then,
/// whatever is done with their distances.
#if defined(__AVX512VPOPCNTDQ__) && defined(__AVX512VL__)
inline constexpr bool counts_bits_of_vectors = true;
#else
inline constexpr bool counts_bits_of_vectors = false;
#endif

template <std::size_t Vector>
[[gnu::always_inline]] inline __m256i add_different_bits(__m256i sum, const std::uint8_t* a, const std::uint8_t* b) {
  __m256i of_a, of_b;
  std::memcpy(&of_a, a + Vector * sizeof of_a, sizeof of_a);
  std::memcpy(&of_b, b + Vector * sizeof of_b, sizeof of_b);
  const __m256i differ = _mm256_xor_si256(of_b, of_a);
#if defined(__AVX512VPOPCNTDQ__) && defined(__AVX512VL__)
  return _mm256_add_epi64(sum, _mm256_popcnt_epi64(differ));
#else
  const __m256i bits =
      _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4, 0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4);
  const __m256i low = _mm256_set1_epi8(15);
  return _mm256_add_epi8(
      sum, _mm256_add_epi8(_mm256_shuffle_epi8(bits, _mm256_and_si256(differ, low)),
                           _mm256_shuffle_epi8(bits, _mm256_and_si256(_mm256_srli_epi16(differ, 4), low))));
#endif
}
/// Different bits of two descriptors of so many vectors, 31 at most (a byte counts 8 bits of each), in four parts.
template <std::size_t... Vectors>
[[gnu::always_inline]] inline __m256i different_bits(const std::uint8_t* a, const std::uint8_t* b,
                                                     std::index_sequence<Vectors...>) {
  __m256i sum = _mm256_setzero_si256();
  ((sum = add_different_bits<Vectors>(sum, a, b)), ...);
  if constexpr (counts_bits_of_vectors)
    return sum;
  else
    return _mm256_sad_epu8(sum, _mm256_setzero_si256());
}
/// The sums of the parts of four pairs, in 16 bits each: word_of_four says where.
[[gnu::always_inline]] inline __m128i sums_of_four(__m256i a, __m256i b, __m256i c, __m256i d) {
  const __m256i ab = _mm256_packs_epi32(a, b), cd = _mm256_packs_epi32(c, d);  // each in two parts per half
  const __m256i parts = _mm256_or_si256(ab, _mm256_slli_epi32(cd, 16));
  const __m128i halves = _mm_add_epi16(_mm256_castsi256_si128(parts), _mm256_extracti128_si256(parts, 1));
  return _mm_add_epi16(halves, _mm_shuffle_epi32(halves, 0xB1));
}
inline constexpr int word_of_four[] = {0, 4, 1, 5};

}  // namespace detail

#endif

TURBOMAP_END_NAMESPACE

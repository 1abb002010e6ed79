// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Distances of pairs of descriptors: a query's, and one of a list. Pairs of many queries are compared in one loop, because the
/// end of a short loop for each query could not be predicted. Where the processor has vectors of 256 bits, binary descriptors
/// of whole vectors are compared four at a time, with no branch until one of them is near.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../descriptor/binary.hpp"
#include "../descriptor/descriptor_concept.hpp"
#include "../math/native_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One descriptor after the other.
template <class Descriptor, class = void>
struct listed_distances {
  using element = typename Descriptor::element;              ///< of a descriptor
  using distance_type = typename Descriptor::distance_type;  ///< of two

  const element* rows;  ///< descriptors

  /// Calls consider(i, d) for those i of [0, count), ascending, whose query queries[owners[i]] and row places[i] have a distance d
  /// of at most `most`. Three more owners and places are overwritten.
  template <class Consider>
  void visit_near(const element* const* queries, const std::uint8_t* owners, const std::int32_t* places, int count,
                  distance_type most, Consider consider) const {
    for (int i = 0; i < count; ++i) {
      const element* const query = queries[owners[i]];
      const element* const row = rows + static_cast<std::ptrdiff_t>(places[i]) * Descriptor::elements;
      if constexpr (detail::has_at_least_v<Descriptor>)
        if (Descriptor::at_least(query, row) > most) continue;
      const distance_type d = Descriptor::distance(query, row);
      if (d <= most) consider(i, d);
    }
  }
};

#if TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES >= 32

/// Up to 7936 bits: a byte counts 8 bits of each vector.
template <int Bits>
struct listed_distances<binary_descriptor<Bits>, std::enable_if_t<Bits % 256 == 0 && Bits / 256 <= 31>> {
  using element = std::uint8_t;        ///< of a descriptor
  using distance_type = std::int32_t;  ///< of two

  const element* rows;  ///< descriptors

  /// The same.
  template <class Consider>
  void visit_near(const element* const* queries, std::uint8_t* owners, std::int32_t* places, int count,
                  distance_type most, Consider consider) const {
    for (int i = count; i < count + 3; ++i) owners[i] = 0, places[i] = 0;  // the first pair's query and row are there
    const auto apart = [&](int i) {
      return differences(queries[owners[i]], rows + static_cast<std::ptrdiff_t>(places[i]) * (Bits / 8),
                         std::make_index_sequence<Bits / 256>());
    };
    const __m128i limit = _mm_set1_epi16(static_cast<short>(most < Bits ? most : Bits));
    for (int i = 0; i < count; i += 4) {
      // Sums of four, each in two parts per half: a b, then a c b d.
      const __m256i ab = _mm256_packs_epi32(apart(i), apart(i + 1)),
                    cd = _mm256_packs_epi32(apart(i + 2), apart(i + 3));
      const __m256i parts = _mm256_or_si256(ab, _mm256_slli_epi32(cd, 16));
      const __m128i halves = _mm_add_epi16(_mm256_castsi256_si128(parts), _mm256_extracti128_si256(parts, 1));
      const __m128i sums = _mm_add_epi16(halves, _mm_shuffle_epi32(halves, 0xB1));
      constexpr int used = 0x0505;  // a, c, b, d: words 0, 1, 4, 5
      if ((~_mm_movemask_epi8(_mm_cmpgt_epi16(sums, limit)) & used) == 0) continue;
      std::int16_t d[8];
      std::memcpy(d, &sums, sizeof d);
      const int word[] = {0, 4, 1, 5};
      for (int k = 0; k < 4 && i + k < count; ++k)
        if (d[word[k]] <= most) consider(i + k, std::int32_t{d[word[k]]});
    }
  }

 private:
  /// Different bits of a query and a row, in four parts.
  template <std::size_t... Vectors>
  [[gnu::always_inline]] static __m256i differences(const element* query, const element* row,
                                                    std::index_sequence<Vectors...>) {
    __m256i sum = _mm256_setzero_si256();
    ((sum = add_bits<Vectors>(sum, query, row)), ...);
#if defined(__AVX512VPOPCNTDQ__) && defined(__AVX512VL__)
    return sum;
#else
    return _mm256_sad_epu8(sum, _mm256_setzero_si256());
#endif
  }
  template <std::size_t Vector>
  [[gnu::always_inline]] static __m256i add_bits(__m256i sum, const element* query, const element* row) {
    __m256i words, candidate;
    std::memcpy(&words, query + Vector * sizeof words, sizeof words);
    std::memcpy(&candidate, row + Vector * sizeof candidate, sizeof candidate);
    const __m256i differ = _mm256_xor_si256(candidate, words);
#if defined(__AVX512VPOPCNTDQ__) && defined(__AVX512VL__)
    return _mm256_add_epi64(sum, _mm256_popcnt_epi64(differ));
#else
    const __m256i bits = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4, 0, 1, 1, 2, 1, 2, 2, 3, 1, 2,
                                          2, 3, 2, 3, 3, 4);
    const __m256i low = _mm256_set1_epi8(15);
    return _mm256_add_epi8(
        sum, _mm256_add_epi8(_mm256_shuffle_epi8(bits, _mm256_and_si256(differ, low)),
                             _mm256_shuffle_epi8(bits, _mm256_and_si256(_mm256_srli_epi16(differ, 4), low))));
#endif
  }
};

#endif

TURBOMAP_END_NAMESPACE

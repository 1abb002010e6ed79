// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The descriptors of a sorted list of candidates, laid out for comparing one query descriptor with a short run of them. Where the
/// processor has vectors of 256 bits, binary descriptors lie word by word, and eight are compared at once without a branch:
/// a window of a few candidates costs less than one mispredicted branch for each. Others lie one after the other.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

#include "../config.hpp"
#include "../descriptor/binary.hpp"
#include "../descriptor/descriptor_concept.hpp"
#include "../math/native_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One descriptor after the other.
template <class Descriptor>
struct window_descriptors {
  using element = typename Descriptor::element;              ///< of a descriptor
  using distance_type = typename Descriptor::distance_type;  ///< of descriptors

  /// Elements of memory for so many candidates.
  static constexpr std::size_t room(std::size_t candidates) { return candidates * Descriptor::elements; }

  element* data;         ///< not owned: room(capacity) elements
  std::size_t capacity;  ///< candidates

  /// Writes the descriptor of candidate k (not checked).
  void set(std::size_t k, const element* descriptor) const {
    std::memcpy(data + k * Descriptor::elements, descriptor, Descriptor::bytes);
  }
  /// Calls consider(k, d) for the candidates begin <= k < end whose distance d to the query is at most most(), which may shrink
  /// on the way.
  template <class Most, class Consider>
  void visit_near(const element* query, std::int32_t begin, std::int32_t end, Most most, Consider consider) const {
    const element* candidate = data + static_cast<std::ptrdiff_t>(begin) * Descriptor::elements;
    for (std::int32_t k = begin; k < end; ++k, candidate += Descriptor::elements) {
      if constexpr (detail::has_at_least_v<Descriptor>)
        if (Descriptor::at_least(query, candidate) > most()) continue;
      const distance_type d = Descriptor::distance(query, candidate);
      if (d <= most()) consider(k, d);
    }
  }
};

#if TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES >= 32

/// Word w of all candidates, then word w + 1 of all.
template <int Bits>
struct window_descriptors<binary_descriptor<Bits>> {
  using element = std::uint8_t;
  using distance_type = std::int32_t;
  static constexpr std::size_t lanes = 8, words = (Bits + 31) / 32, bytes = Bits / 8;

  /// Some more than there are: the last ones are read in eights.
  static constexpr std::size_t room(std::size_t candidates) { return (candidates + lanes) * words * 4; }

  element* data;
  std::size_t capacity;

  void set(std::size_t k, const element* descriptor) const {
    constexpr std::size_t whole = bytes / 4;
    for (std::size_t w = 0; w < whole; ++w) std::memcpy(data + (w * (capacity + lanes) + k) * 4, descriptor + 4 * w, 4);
    if constexpr (whole < words) {
      element* const to = data + (whole * (capacity + lanes) + k) * 4;
      std::memset(to, 0, 4);
      std::memcpy(to, descriptor + 4 * whole, bytes % 4);
    }
  }
  template <class Most, class Consider>
  void visit_near(const element* query, std::int32_t begin, std::int32_t end, Most most, Consider consider) const {
    for (std::int32_t k = begin; k < end; k += lanes) {
      const __m256i distance = distances(query, static_cast<std::size_t>(k), std::make_index_sequence<words>());
      const __m256i far = _mm256_cmpgt_epi32(distance, _mm256_set1_epi32(most()));
      auto near = ~static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(far))) & 0xFFU;
      if (end - k < static_cast<std::int32_t>(lanes)) near &= (1U << (end - k)) - 1;
      if (near == 0) continue;
      std::int32_t d[lanes];
      std::memcpy(d, &distance, sizeof d);
      for (; near != 0; near &= near - 1) {
        const int lane = __builtin_ctz(near);
        if (d[lane] <= most()) consider(k + lane, d[lane]);
      }
    }
  }

 private:
  /// Of the query to candidates k to k + 7. A fold, not a loop: compilers unroll it at every level.
  template <std::size_t... Words>
  __m256i distances(const element* query, std::size_t k, std::index_sequence<Words...>) const {
    __m256i sum = _mm256_setzero_si256(), in_bytes = sum;
    (add_word<Words>(query, k, sum, in_bytes), ...);
    return sum;
  }
  template <std::size_t Word>
  [[gnu::always_inline]] void add_word(const element* query, std::size_t k, __m256i& sum,
                                       [[maybe_unused]] __m256i& in_bytes) const {
    constexpr std::size_t left = bytes - 4 * Word;
    std::int32_t word = 0;
    std::memcpy(&word, query + 4 * Word, left < 4 ? left : 4);
    __m256i candidates;
    std::memcpy(&candidates, data + (Word * (capacity + lanes) + k) * 4, sizeof candidates);
    const __m256i differ = _mm256_xor_si256(candidates, _mm256_set1_epi32(word));
#if defined(__AVX512VPOPCNTDQ__) && defined(__AVX512VL__)
    sum = _mm256_add_epi32(sum, _mm256_popcnt_epi32(differ));
#else
    in_bytes = _mm256_add_epi8(in_bytes, bits_of_bytes(differ));
    if constexpr (Word % 31 == 30 || Word + 1 == words) {  // a byte counts 8 bits per word: 31 words fit
      const __m256i halves = _mm256_maddubs_epi16(in_bytes, _mm256_set1_epi8(1));
      sum = _mm256_add_epi32(sum, _mm256_madd_epi16(halves, _mm256_set1_epi16(1)));
      in_bytes = _mm256_setzero_si256();
    }
#endif
  }
  [[gnu::always_inline]] static __m256i bits_of_bytes(__m256i v) {
    const __m256i bits = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4, 0, 1, 1, 2, 1, 2, 2, 3, 1, 2,
                                          2, 3, 2, 3, 3, 4);
    const __m256i low = _mm256_set1_epi8(15);
    return _mm256_add_epi8(_mm256_shuffle_epi8(bits, _mm256_and_si256(v, low)),
                           _mm256_shuffle_epi8(bits, _mm256_and_si256(_mm256_srli_epi16(v, 4), low)));
  }
};

#endif

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Intervals of epipolar planes in sixteen bits, and the choice of those that meet a given one. A window of the epipolar order is
/// as wide as its widest candidate needs: most candidates in it are narrower, and lie too far off. So intervals are compared before
/// any descriptor is read, 16 or 32 at once where the processor has vectors of 256 or 512 bits.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "../config.hpp"
#include "../math/native_vector.hpp"
#include "../math/pack.hpp"

// Only where the namespace is that of AVX-512 (config.hpp): one of AVX2 must not hold such code.
#if TURBOMAP_X86_VECTORS && defined(__AVX512VPOPCNTDQ__) && defined(__AVX512VL__) && defined(__AVX512BW__)
#define TURBOMAP_DETAIL_CODES_512 1
#else
#define TURBOMAP_DETAIL_CODES_512 0
#endif

TURBOMAP_BEGIN_NAMESPACE

/// The parts of a plane_code before they are cut to whole numbers, all within what their types hold. F: float, or a pack of them.
template <class F>
struct plane_code_numbers {
  F angle;       ///< of the plane
  F half_width;  ///< of the plane
  F least;       ///< of the angle to the baseline
  F most;        ///< likewise

  /// Of a plane_interval. Rounded outwards; what is no number is no limit. \param half_width  < 0: unbounded
  static plane_code_numbers of(F angle, F half_width, F least, F most) {
    const F units(65536 / 6.28318531F), steps(8192.0F), zero(0.0F), unbounded(65535.0F);
    const F lowest(-32768.0F), highest(32766.0F);  // below plane_code::nowhere
    const F low = least * steps - F(2.0F), high = most * steps + F(2.0F);
    // Two more: the angles of both lose up to one each, the width another.
    const F width = half_width * units + F(2.0F);
    const F turned = angle * units;
    return {select_greater(zero, half_width, zero, select_greater(unbounded, turned, turned, unbounded)),
            select_greater(zero, half_width, unbounded, select_greater(unbounded, width, width, unbounded)),
            select_greater(low, lowest, select_greater(highest, low, low, highest), lowest),
            select_greater(highest, high, select_greater(high, lowest, high, lowest), highest)};
  }
};

/// The circle has 65536 units, so that differences of angles wrap as the angles do.
struct plane_code {
  static constexpr std::uint16_t unbounded = 65535;  ///< a half-width that meets every angle
  static constexpr std::int16_t nowhere = 32767;     ///< a `least` above every `most`

  std::uint16_t angle;       ///< of the plane, in units of the circle / 65536
  std::uint16_t half_width;  ///< in the same units
  std::int16_t least;        ///< of the angle to the baseline, in units of 2^-13 rad
  std::int16_t most;         ///< in the same units

  /// Of a plane_interval. \param half_width  < 0: unbounded
  static plane_code of(float angle, float half_width, float least, float most) {
    const auto n = plane_code_numbers<float>::of(angle, half_width, least, most);
    return {static_cast<std::uint16_t>(static_cast<std::int32_t>(n.angle)), static_cast<std::uint16_t>(n.half_width),
            static_cast<std::int16_t>(n.least), static_cast<std::int16_t>(n.most)};
  }
  /// Whether the intervals of a query (this) and a candidate have a plane in common, or nearly, and the candidate is on the right
  /// side of the baseline.
  bool meets(plane_code other) const {
    const auto apart = static_cast<std::uint16_t>(angle - other.angle);
    const int shorter = apart > 32768 ? 65536 - apart : apart;
    return shorter <= int{half_width} + int{other.half_width} && other.least <= most;
  }
};

/// The codes of keypoints that are measured together. Places behind the last hold nothing that means anything.
struct plane_code_batch {
  static constexpr int size = 64;  ///< codes in a batch
  /// @{
  /// The parts of each code.
  std::uint16_t angles[size], half_widths[size];
  std::int16_t least[size], most[size];
  /// @}

  /// Code i (not checked).
  plane_code operator[](int i) const { return {angles[i], half_widths[i], least[i], most[i]}; }
  /// Sets as many codes from i on as a pack has lanes.
  template <class Pack>
  void set(int i, const plane_code_numbers<Pack>& numbers) {
    cut(numbers.angle, angles + i), cut(numbers.half_width, half_widths + i);
    cut(numbers.least, least + i), cut(numbers.most, most + i);
  }

 private:
  template <class Pack, class Part>
  static void cut(const Pack& numbers, Part* parts) {
#if TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES >= 32
    static_assert(Pack::lanes == 8);
    const __m256i whole = _mm256_cvttps_epi32(numbers.v);
    const __m128i low = _mm256_castsi256_si128(whole), high = _mm256_extracti128_si256(whole, 1);
    const __m128i halves = std::is_signed_v<Part> ? _mm_packs_epi32(low, high) : _mm_packus_epi32(low, high);
    std::memcpy(parts, &halves, sizeof halves);
#else
    float n[Pack::lanes];
    numbers.store(n);
    for (int l = 0; l < Pack::lanes; ++l) parts[l] = static_cast<Part>(static_cast<std::int32_t>(n[l]));
#endif
  }
};

/// The codes of a list of keypoints, in arrays.
struct plane_codes {
  /// Elements of each array behind the last code. They are read; set_end() makes them meet nothing.
  static constexpr int padding = 32;

  std::uint16_t* angles;       ///< of the planes
  std::uint16_t* half_widths;  ///< of the planes
  std::int16_t* least;         ///< angles to the baseline

  /// The codes from `first` on.
  plane_codes from(std::int64_t first) const { return {angles + first, half_widths + first, least + first}; }
  /// Codes [k, k + count) from a batch, all but `most`.
  void set(std::int64_t k, const plane_code_batch& batch, int count) const {
    const auto n = static_cast<std::size_t>(count);
    std::memcpy(angles + k, batch.angles, n * sizeof *angles);
    std::memcpy(half_widths + k, batch.half_widths, n * sizeof *half_widths);
    std::memcpy(least + k, batch.least, n * sizeof *least);
  }
  /// Code k.
  void set(std::int32_t k, plane_code code) const {
    angles[k] = code.angle, half_widths[k] = code.half_width, least[k] = code.least;
  }
  /// Ends a list of `count` codes.
  void set_end(std::int32_t count) const {
    for (std::int32_t k = count; k < count + padding; ++k) set(k, {0, 0, plane_code::nowhere, 0});
  }
  /// Appends those k of [begin, end) that the query q meets to list[0, count), ascending, and perhaps some just behind `end` that
  /// it meets too. Returns how many there are then. Writes up to `padding` elements behind them.
  int list_meeting(plane_code q, std::int32_t begin, std::int32_t end, std::int32_t* list, int count) const {
#if TURBOMAP_DETAIL_CODES_512
    const __m512i angle = _mm512_set1_epi16(static_cast<short>(q.angle)), most = _mm512_set1_epi16(q.most);
    const __m512i half_width = _mm512_set1_epi16(static_cast<short>(q.half_width));
    for (std::int32_t k = begin; k < end; k += 32) {
      const __m512i apart = _mm512_abs_epi16(_mm512_sub_epi16(load<__m512i>(angles + k), angle));
      const __m512i reach = _mm512_adds_epu16(load<__m512i>(half_widths + k), half_width);
      const auto mask = static_cast<unsigned>(
          _mm512_mask_cmple_epi16_mask(_mm512_cmple_epu16_mask(apart, reach), load<__m512i>(least + k), most));
      count = append(k, mask & 0xFFFFU, list, count);
      count = append(k + 16, mask >> 16, list, count);
    }
#elif TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES >= 32
    const __m256i angle = _mm256_set1_epi16(static_cast<short>(q.angle)), most = _mm256_set1_epi16(q.most);
    const __m256i half_width = _mm256_set1_epi16(static_cast<short>(q.half_width)), zero = _mm256_setzero_si256();
    for (std::int32_t k = begin; k < end; k += 16) {
      const __m256i apart = _mm256_abs_epi16(_mm256_sub_epi16(load<__m256i>(angles + k), angle));
      const __m256i too_far = _mm256_subs_epu16(apart, _mm256_adds_epu16(load<__m256i>(half_widths + k), half_width));
      const __m256i meets =
          _mm256_andnot_si256(_mm256_cmpgt_epi16(load<__m256i>(least + k), most), _mm256_cmpeq_epi16(too_far, zero));
      const __m128i bytes = _mm_packs_epi16(_mm256_castsi256_si128(meets), _mm256_extracti128_si256(meets, 1));
      const auto mask = static_cast<unsigned>(_mm_movemask_epi8(bytes));
      count = append(k, mask & 0xFFU, list, count);
      count = append(k + 8, mask >> 8, list, count);
    }
#else
    for (std::int32_t k = begin; k < end; ++k) {
      list[count] = k;  // without a branch: it could not be predicted
      count += q.meets({angles[k], half_widths[k], least[k], 0}) ? 1 : 0;
    }
#endif
    return count;
  }

#if TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES >= 32
 private:
  template <class Vector>
  static Vector load(const void* from) {
    Vector v;
    std::memcpy(&v, from, sizeof v);
    return v;
  }
#if TURBOMAP_DETAIL_CODES_512
  static int append(std::int32_t first, unsigned mask, std::int32_t* list, int count) {
    const __m512i numbers = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    // Stored whole: some processors take a hundred cycles to store the chosen ones alone.
    const __m512i chosen =
        _mm512_maskz_compress_epi32(static_cast<__mmask16>(mask), _mm512_add_epi32(numbers, _mm512_set1_epi32(first)));
    std::memcpy(list + count, &chosen, sizeof chosen);
    return count + __builtin_popcount(mask);
  }
#else
  /// The numbers of the bits that are set in a byte, ascending, one byte each.
  struct bit_numbers {
    std::uint64_t of[256];

    constexpr bit_numbers() : of() {
      for (unsigned mask = 0; mask < 256; ++mask) {
        unsigned set = 0;
        for (unsigned bit = 0; bit < 8; ++bit)
          if ((mask >> bit & 1U) != 0) of[mask] |= std::uint64_t{bit} << (8 * set++);
      }
    }
  };
  static int append(std::int32_t first, unsigned mask, std::int32_t* list, int count) {
    static constexpr bit_numbers bits;
    const __m256i numbers = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(bits.of[mask])));
    const __m256i chosen = _mm256_add_epi32(numbers, _mm256_set1_epi32(first));
    std::memcpy(list + count, &chosen, sizeof chosen);
    return count + __builtin_popcount(mask);
  }
#endif
#endif
};

TURBOMAP_END_NAMESPACE

#undef TURBOMAP_DETAIL_CODES_512

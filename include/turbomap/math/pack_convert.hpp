// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Packs between kinds of numbers, and between columns (one number of many rows, a pack) and rows in memory.

#include "pack.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The same numbers as T.
template <class T, class U, int N>
TURBOMAP_HD pack<T, N> convert(const pack<U, N>& a) {
  if constexpr (std::is_same_v<T, U>) {
    return a;
  } else {
#if TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES >= 32
    if constexpr (N == 8 && std::is_same_v<T, float>)
      return pack<float, 8>(typename pack<float, 8>::vector(
          _mm256_set_m128(_mm256_cvtpd_ps(__m256d(a.hi.v)), _mm256_cvtpd_ps(__m256d(a.lo.v)))));
    if constexpr (N == 4 && std::is_same_v<T, double>)
      return pack<double, 4>(typename pack<double, 4>::vector(_mm256_cvtps_pd(__m128(a.v))));
#endif
    U from[N];
    T to[N];
    a.store(from);
    for (int i = 0; i < N; ++i) to[i] = static_cast<T>(from[i]);
    return pack<T, N>::load(to);
  }
}

namespace detail {

#if TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES >= 32
/// Row i of the result holds lane i of each column.
inline void transpose(__m256 (&r)[8]) {
  __m256 a[8], b[8];
  for (int i = 0; i < 4; ++i) {
    a[2 * i] = _mm256_unpacklo_ps(r[2 * i], r[2 * i + 1]);
    a[2 * i + 1] = _mm256_unpackhi_ps(r[2 * i], r[2 * i + 1]);
  }
  for (int i = 0; i < 2; ++i) {
    b[4 * i] = _mm256_shuffle_ps(a[4 * i], a[4 * i + 2], 0x44);
    b[4 * i + 1] = _mm256_shuffle_ps(a[4 * i], a[4 * i + 2], 0xEE);
    b[4 * i + 2] = _mm256_shuffle_ps(a[4 * i + 1], a[4 * i + 3], 0x44);
    b[4 * i + 3] = _mm256_shuffle_ps(a[4 * i + 1], a[4 * i + 3], 0xEE);
  }
  for (int i = 0; i < 4; ++i) {
    r[i] = _mm256_permute2f128_ps(b[i], b[i + 4], 0x20);
    r[i + 4] = _mm256_permute2f128_ps(b[i], b[i + 4], 0x31);
  }
}
inline void transpose(__m256d (&r)[4]) {
  const __m256d a = _mm256_unpacklo_pd(r[0], r[1]), b = _mm256_unpackhi_pd(r[0], r[1]);
  const __m256d c = _mm256_unpacklo_pd(r[2], r[3]), d = _mm256_unpackhi_pd(r[2], r[3]);
  r[0] = _mm256_permute2f128_pd(a, c, 0x20), r[1] = _mm256_permute2f128_pd(b, d, 0x20);
  r[2] = _mm256_permute2f128_pd(a, c, 0x31), r[3] = _mm256_permute2f128_pd(b, d, 0x31);
}

/// As many columns as a vector has lanes, of up to 8 rows.
inline void scatter_block(const pack<float, 8>* column, float* base, const int* index, int stride, int count) {
  __m256 r[8];
  for (int i = 0; i < 8; ++i) r[i] = __m256(column[i].v);
  transpose(r);
  for (int i = 0; i < count; ++i) _mm256_storeu_ps(base + static_cast<long>(index[i]) * stride, r[i]);
}
inline void scatter_block(const pack<double, 8>* column, double* base, const int* index, int stride, int count) {
  for (int half = 0; half < 2; ++half) {
    __m256d r[4];
    for (int i = 0; i < 4; ++i) r[i] = __m256d(half == 0 ? column[i].lo.v : column[i].hi.v);
    transpose(r);
    for (int i = 0; i < 4; ++i)
      if (4 * half + i < count) _mm256_storeu_pd(base + static_cast<long>(index[4 * half + i]) * stride, r[i]);
  }
}
#endif

}  // namespace detail

/// Writes lane l of column[k] to base[index[l] * stride + k], for l < count: columns become rows.
template <int K, class T, int N>
TURBOMAP_HD void scatter(const pack<T, N> (&column)[K], T* base, const int* index, int stride, int count) {
#if TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES >= 32
  constexpr int block = 32 / static_cast<int>(sizeof(T));
  if constexpr (N == 8 && K >= block) {
    constexpr int rest = K % block, whole = K - rest;
    for (int k = 0; k < whole; k += block) detail::scatter_block(column + k, base + k, index, stride, count);
    if constexpr (rest != 0) {  // one by one: cheaper than one more block
      T lanes[rest][N];
      for (int k = 0; k < rest; ++k) column[whole + k].store(lanes[k]);
      for (int l = 0; l < count; ++l)
        for (int k = 0; k < rest; ++k) base[static_cast<long>(index[l]) * stride + whole + k] = lanes[k][l];
    }
    return;
  }
#endif
  T lanes[K][N];
  for (int k = 0; k < K; ++k) column[k].store(lanes[k]);
  for (int l = 0; l < count; ++l)
    for (int k = 0; k < K; ++k) base[static_cast<long>(index[l]) * stride + k] = lanes[k][l];
}

TURBOMAP_END_NAMESPACE

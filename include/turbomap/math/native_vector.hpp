// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The vectors that the compiler and the processor have: what packs are made of on the host (pack.hpp).

#include <cmath>

#include "../config.hpp"

// <immintrin.h> declares every vector extension there is, and takes longer to read than the rest of the library.
#if TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES > 16
#include <immintrin.h>
#elif TURBOMAP_X86_VECTORS
#include <emmintrin.h>
#endif

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The compiler's vector of so many bytes, and the integers that its comparisons give.
template <class T, int Bytes>
struct native_vector;
#if TURBOMAP_VECTOR_BYTES > 0
template <>
struct native_vector<float, 16> {
  typedef float type __attribute__((vector_size(16)));
  typedef int bits __attribute__((vector_size(16)));
};
template <>
struct native_vector<double, 16> {
  typedef double type __attribute__((vector_size(16)));
  typedef long long bits __attribute__((vector_size(16)));
};
#endif
#if TURBOMAP_VECTOR_BYTES > 16
template <>
struct native_vector<float, 32> {
  typedef float type __attribute__((vector_size(32)));
  typedef int bits __attribute__((vector_size(32)));
};
template <>
struct native_vector<double, 32> {
  typedef double type __attribute__((vector_size(32)));
  typedef long long bits __attribute__((vector_size(32)));
};
#endif

template <class T, int N>
inline constexpr bool is_native = N* static_cast<int>(sizeof(T)) == 16
                                      ? TURBOMAP_VECTOR_BYTES >= 16
                                      : N* static_cast<int>(sizeof(T)) == 32 && TURBOMAP_VECTOR_BYTES >= 32;
template <class T, int N>
inline constexpr bool is_split = N* static_cast<int>(sizeof(T)) > 16 && TURBOMAP_VECTOR_BYTES > 0 && !is_native<T, N>;

#if TURBOMAP_X86_VECTORS
inline __m128 vector_sqrt(__m128 v) { return _mm_sqrt_ps(v); }
inline __m128d vector_sqrt(__m128d v) { return _mm_sqrt_pd(v); }
#if defined(__FMA__) && !TURBOMAP_REPRODUCIBLE
inline __m128 vector_fma(__m128 a, __m128 b, __m128 c) { return _mm_fmadd_ps(a, b, c); }
inline __m128d vector_fma(__m128d a, __m128d b, __m128d c) { return _mm_fmadd_pd(a, b, c); }
inline __m256 vector_fma(__m256 a, __m256 b, __m256 c) { return _mm256_fmadd_ps(a, b, c); }
inline __m256d vector_fma(__m256d a, __m256d b, __m256d c) { return _mm256_fmadd_pd(a, b, c); }
#else
template <class V>
V vector_fma(V a, V b, V c) {
  return a * b + c;
}
#endif
#if TURBOMAP_VECTOR_BYTES >= 32
inline __m256 vector_sqrt(__m256 v) { return _mm256_sqrt_ps(v); }
inline __m256d vector_sqrt(__m256d v) { return _mm256_sqrt_pd(v); }
#endif
#else
template <class V>
V vector_sqrt(V v) {
  for (unsigned i = 0; i < sizeof(V) / sizeof(v[0]); ++i) v[i] = std::sqrt(v[i]);
  return v;
}
template <class V>
V vector_fma(V a, V b, V c) {
  return a * b + c;
}
#endif

}  // namespace detail

TURBOMAP_END_NAMESPACE

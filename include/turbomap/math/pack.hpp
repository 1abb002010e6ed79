// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// `pack<T, N>`: N numbers that are computed with at once, lane by lane. A function template written for a scalar runs
/// on packs as it is, as long as it does not branch on values: larger() and select_greater() do that, for scalars too.
/// Made of the compiler's vectors where it has some, else of a plain array; the results are the same.

#include <cmath>
#include <type_traits>

#include "../config.hpp"
#include "native_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Prefetches memory that is read soon. Its address comes from a list, so the processor cannot predict it.
TURBOMAP_HD inline void prefetch(const void* at, int bytes) {
#if TURBOMAP_VECTOR_BYTES > 0
  for (int i = 0; i < bytes; i += 64) __builtin_prefetch(static_cast<const char*>(at) + i);
#else
  (void)at, (void)bytes;
#endif
}

/// N numbers of T. This one: a plain array; the only one that a device knows.
template <class T, int N, class = void>
struct pack {
  static constexpr int lanes = N;  ///< numbers at once
  T v[N];                          ///< the numbers

  pack() = default;
  /// The same number in all lanes.
  TURBOMAP_HD pack(T a) {
    for (int i = 0; i < N; ++i) v[i] = a;
  }
  /// N numbers in a row, aligned as T.
  TURBOMAP_HD static pack load(const T* a) {
    pack r;
    for (int i = 0; i < N; ++i) r.v[i] = a[i];
    return r;
  }
  /// a[index[i] * stride] in lane i.
  template <class U, class Index>
  TURBOMAP_HD static pack gather(const U* a, const Index* index, int stride) {
    pack r;
    for (int i = 0; i < N; ++i) r.v[i] = static_cast<T>(a[static_cast<long>(index[i]) * stride]);
    return r;
  }
  /// Writes N numbers in a row, aligned as T.
  TURBOMAP_HD void store(T* a) const {
    for (int i = 0; i < N; ++i) a[i] = v[i];
  }
  /// @{
  /// Lane by lane.
  TURBOMAP_HD friend pack operator+(pack a, const pack& b) {
    for (int i = 0; i < N; ++i) a.v[i] += b.v[i];
    return a;
  }
  TURBOMAP_HD friend pack operator-(pack a, const pack& b) {
    for (int i = 0; i < N; ++i) a.v[i] -= b.v[i];
    return a;
  }
  TURBOMAP_HD friend pack operator*(pack a, const pack& b) {
    for (int i = 0; i < N; ++i) a.v[i] *= b.v[i];
    return a;
  }
  TURBOMAP_HD friend pack operator/(pack a, const pack& b) {
    for (int i = 0; i < N; ++i) a.v[i] /= b.v[i];
    return a;
  }
  TURBOMAP_HD friend pack operator-(pack a) {
    for (int i = 0; i < N; ++i) a.v[i] = -a.v[i];
    return a;
  }
  /// @}
  /// a b + c, rounded once where the processor can.
  TURBOMAP_HD friend pack multiply_add(const pack& a, const pack& b, pack c) {
    for (int i = 0; i < N; ++i) c.v[i] += a.v[i] * b.v[i];
    return c;
  }
  /// Square roots, lane by lane.
  TURBOMAP_HD friend pack sqrt(pack a) {
    for (int i = 0; i < N; ++i) a.v[i] = ::sqrt(a.v[i]);
    return a;
  }
  /// In each lane x where a > b, else y.
  TURBOMAP_HD friend pack select_greater(const pack& a, const pack& b, const pack& x, const pack& y) {
    pack r;
    for (int i = 0; i < N; ++i) r.v[i] = a.v[i] > b.v[i] ? x.v[i] : y.v[i];
    return r;
  }
  /// In each lane the larger one; b where one is not a number.
  TURBOMAP_HD friend pack larger(const pack& a, const pack& b) { return select_greater(a, b, a, b); }
  /// Sum of the lanes, halves first: the order of every kind of pack.
  TURBOMAP_HD friend T sum(pack a) {
    for (int n = N / 2; n > 0; n /= 2)
      for (int i = 0; i < n; ++i) a.v[i] += a.v[i + n];
    return a.v[0];
  }
};

#if TURBOMAP_VECTOR_BYTES > 0

/// One vector of the compiler's.
template <class T, int N>
struct pack<T, N, std::enable_if_t<detail::is_native<T, N>>> {
  using native = detail::native_vector<T, N* static_cast<int>(sizeof(T))>;
  using vector = typename native::type;
  static constexpr int lanes = N;
  vector v;

  pack() = default;
  pack(vector a) : v(a) {}
  pack(T a) : v(a - vector{}) {}
  static pack load(const T* a) {
    pack r;
    __builtin_memcpy(&r.v, a, sizeof r.v);
    return r;
  }
  template <class U, class Index>
  static pack gather(const U* a, const Index* index, int stride) {
    const auto at = [&](int i) { return static_cast<T>(a[static_cast<long>(index[i]) * stride]); };
    if constexpr (N == 2)
      return pack(vector{at(0), at(1)});
    else if constexpr (N == 4)
      return pack(vector{at(0), at(1), at(2), at(3)});
    else
      return pack(vector{at(0), at(1), at(2), at(3), at(4), at(5), at(6), at(7)});
  }
  void store(T* a) const { __builtin_memcpy(a, &v, sizeof v); }
  friend pack operator+(const pack& a, const pack& b) { return pack(a.v + b.v); }
  friend pack operator-(const pack& a, const pack& b) { return pack(a.v - b.v); }
  friend pack operator*(const pack& a, const pack& b) { return pack(a.v * b.v); }
  friend pack operator/(const pack& a, const pack& b) { return pack(a.v / b.v); }
  friend pack operator-(const pack& a) { return pack(-a.v); }
  friend pack multiply_add(const pack& a, const pack& b, const pack& c) {
    return pack(vector(detail::vector_fma(a.v, b.v, c.v)));
  }
  friend pack select_greater(const pack& a, const pack& b, const pack& x, const pack& y) {
    using bits = typename native::bits;
    const bits m = a.v > b.v;
    return pack((vector)((m & (bits)x.v) | (~m & (bits)y.v)));
  }
  friend pack larger(const pack& a, const pack& b) { return select_greater(a, b, a, b); }
  friend pack sqrt(const pack& a) { return pack(vector(detail::vector_sqrt(a.v))); }
  friend T sum(const pack& a) {
    T r[N];
    a.store(r);
    for (int n = N / 2; n > 0; n /= 2)
      for (int i = 0; i < n; ++i) r[i] += r[i + n];
    return r[0];
  }
};

/// Two packs of half the lanes: what the processor has no vector for.
template <class T, int N>
struct pack<T, N, std::enable_if_t<detail::is_split<T, N>>> {
  using half = pack<T, N / 2>;
  static constexpr int lanes = N;
  half lo, hi;

  pack() = default;
  pack(const half& a, const half& b) : lo(a), hi(b) {}
  pack(T a) : lo(a), hi(a) {}
  static pack load(const T* a) { return {half::load(a), half::load(a + N / 2)}; }
  template <class U, class Index>
  static pack gather(const U* a, const Index* index, int stride) {
    return {half::gather(a, index, stride), half::gather(a, index + N / 2, stride)};
  }
  void store(T* a) const {
    lo.store(a);
    hi.store(a + N / 2);
  }
  friend pack operator+(const pack& a, const pack& b) { return {a.lo + b.lo, a.hi + b.hi}; }
  friend pack operator-(const pack& a, const pack& b) { return {a.lo - b.lo, a.hi - b.hi}; }
  friend pack operator*(const pack& a, const pack& b) { return {a.lo * b.lo, a.hi * b.hi}; }
  friend pack operator/(const pack& a, const pack& b) { return {a.lo / b.lo, a.hi / b.hi}; }
  friend pack operator-(const pack& a) { return {-a.lo, -a.hi}; }
  friend pack multiply_add(const pack& a, const pack& b, const pack& c) {
    return {multiply_add(a.lo, b.lo, c.lo), multiply_add(a.hi, b.hi, c.hi)};
  }
  friend pack select_greater(const pack& a, const pack& b, const pack& x, const pack& y) {
    return {select_greater(a.lo, b.lo, x.lo, y.lo), select_greater(a.hi, b.hi, x.hi, y.hi)};
  }
  friend pack larger(const pack& a, const pack& b) { return {larger(a.lo, b.lo), larger(a.hi, b.hi)}; }
  friend pack sqrt(const pack& a) { return {sqrt(a.lo), sqrt(a.hi)}; }
  friend T sum(const pack& a) { return sum(a.lo + a.hi); }
};

#endif

/// The larger of two numbers; b where one is not a number.
template <class T, class = std::enable_if_t<std::is_floating_point_v<T>>>
TURBOMAP_HD T larger(T a, T b) {
  return a > b ? a : b;
}
/// x where a > b, else y.
template <class T, class = std::enable_if_t<std::is_floating_point_v<T>>>
TURBOMAP_HD T select_greater(T a, T b, T x, T y) {
  return a > b ? x : y;
}

TURBOMAP_END_NAMESPACE

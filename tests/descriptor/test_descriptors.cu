// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Descriptor distances on a device are those of the host to the bit, at every length, and binary ones at every
/// alignment.

#include <turbomap/cuda/memory.cuh>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/descriptor/real.hpp>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

using turbomap::binary_descriptor;
using turbomap::real_descriptor;

namespace {

template <class D>
__global__ void all_pairs(const typename D::element* a, const typename D::element* b, int stride, int rows,
                          typename D::distance_type* distance) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i < rows * rows) distance[i] = D::distance(a + i / rows * stride, b + i % rows * stride);
}

/// Memory that host and device read.
template <class T>
struct pinned {
  T* data = nullptr;
  explicit pinned(std::size_t n) { turbomap::check_cuda(cudaMallocHost(&data, n * sizeof(T)), "pinned memory"); }
  ~pinned() { cudaFreeHost(data); }
};

template <class E>
E random_element(std::mt19937& random) {
  if constexpr (std::is_same_v<E, float>) {
    // Few and many digits, small and large: sums that round.
    return std::ldexp(static_cast<float>(static_cast<int>(random())), static_cast<int>(random() % 20) - 41);
  } else if constexpr (std::is_same_v<E, turbomap::half>) {
    return turbomap::half{static_cast<std::uint16_t>(random() & 0xBFFFu)};  // any finite number below 2
  } else {
    return static_cast<E>(random());
  }
}

/// `offset` elements from an aligned address, rows `gap` elements apart.
template <class D>
void check(int offset = 0, int gap = 0) {
  using E = typename D::element;
  using R = typename D::distance_type;
  constexpr int rows = 48;
  const int stride = D::elements + gap;
  const std::size_t size = static_cast<std::size_t>(rows * stride + offset);
  std::mt19937 random(D::elements);
  pinned<E> a(size), b(size);
  pinned<R> distance(rows * rows);
  for (std::size_t i = 0; i < size; ++i) a.data[i] = random_element<E>(random), b.data[i] = random_element<E>(random);
  std::memcpy(b.data + offset, a.data + offset, D::bytes);  // one pair is equal
  all_pairs<D><<<(rows * rows + 127) / 128, 128>>>(a.data + offset, b.data + offset, stride, rows, distance.data);
  REQUIRE(cudaDeviceSynchronize() == cudaSuccess);
  int different = 0;
  for (int i = 0; i < rows * rows; ++i) {
    const R host = D::distance(a.data + offset + i / rows * stride, b.data + offset + i % rows * stride);
    different += std::memcmp(&host, &distance.data[i], sizeof host) != 0 ? 1 : 0;
  }
  CHECK(different == 0);
  CHECK(distance.data[0] == 0);
  CHECK(distance.data[1] > 0);
}

}  // namespace

TEST_CASE_TEMPLATE("binary descriptors", D, binary_descriptor<8>, binary_descriptor<64>, binary_descriptor<200>,
                   binary_descriptor<256>, binary_descriptor<384>, binary_descriptor<488>, binary_descriptor<512>) {
  for (int offset = 0; offset < 9; ++offset)
    for (const int gap : {0, 1, 4}) check<D>(offset, gap);
}
TEST_CASE_TEMPLATE("real descriptors", D, real_descriptor<float, 1>, real_descriptor<float, 61>,
                   real_descriptor<float, 64>, real_descriptor<float, 128>, real_descriptor<float, 256>,
                   real_descriptor<turbomap::half, 64>, real_descriptor<turbomap::half, 100>,
                   real_descriptor<turbomap::half, 256>, real_descriptor<std::int8_t, 33>,
                   real_descriptor<std::int8_t, 128>) {
  check<D>();
  check<D>(1, 3);
}

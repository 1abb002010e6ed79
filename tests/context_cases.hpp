// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a context must do under every execution policy, host or device.

#include <turbomap/context.hpp>

#include <cstdint>
#include <cstring>
#include <vector>

#include <doctest/doctest.h>

namespace turbomap_test {

struct square_index {
  std::int64_t* out;
  TURBOMAP_HD void operator()(int i) const { out[i] += static_cast<std::int64_t>(i) * i + 1; }
};

/// The content of an array in the policy's memory.
template <class Policy, class T, class Memory>
std::vector<T> content(turbomap::context<Policy>& ctx, const turbomap::array<T, Memory>& a) {
  std::vector<T> host(a.size());
  turbomap::copy_out(ctx.policy(), host.data(), a.data(), a.size() * sizeof(T));
  ctx.synchronize();
  return host;
}

/// Every index once, whatever their number; fills and copies of nothing do nothing.
template <class Policy>
void check_parallel(const Policy& policy) {
  turbomap::context<Policy> ctx(policy);
  turbomap::array<std::int64_t, turbomap::memory_of_t<Policy>> numbers;
  for (const int n : {0, 1, 31, 257, 100003}) {
    numbers.resize_discard(static_cast<std::size_t>(n) + 1);
    turbomap::fill_bytes(ctx.policy(), numbers.data(), 0, numbers.size() * sizeof(std::int64_t));
    turbomap::for_each_index(ctx.policy(), n, square_index{numbers.data()});
    const auto host = content(ctx, numbers);
    bool right = host.back() == 0;
    for (int i = 0; i < n; ++i)
      right = right && host[static_cast<std::size_t>(i)] == static_cast<std::int64_t>(i) * i + 1;
    CHECK(right);
  }
  turbomap::fill_bytes(ctx.policy(), nullptr, 1, 0);
  turbomap::copy_in(ctx.policy(), nullptr, nullptr, 0);
  turbomap::copy_out(ctx.policy(), nullptr, nullptr, 0);
}

/// Pieces of scratch do not overlap, and a call may use them while the next one is being enqueued.
template <class Policy>
void check_scratch(const Policy& policy) {
  turbomap::context<Policy> ctx(policy);
  using memory = turbomap::memory_of_t<Policy>;
  turbomap::array<std::int64_t, memory> kept;
  kept.resize_discard(3000);
  for (int call = 0; call < 5; ++call) {
    ctx.begin_call();
    auto* first = ctx.template scratch<std::int64_t>(1000);
    auto* second = ctx.template scratch<std::int64_t>(2000 + 20000 * static_cast<std::size_t>(call));
    turbomap::fill_bytes(ctx.policy(), first, 0, 1000 * sizeof(std::int64_t));
    turbomap::fill_bytes(ctx.policy(), second, 0, 2000 * sizeof(std::int64_t));
    turbomap::for_each_index(ctx.policy(), 1000, square_index{first});
    turbomap::for_each_index(ctx.policy(), 2000, square_index{second});
    std::vector<std::int64_t> a(1000), b(2000);
    turbomap::copy_out(ctx.policy(), a.data(), first, sizeof(std::int64_t) * a.size());
    turbomap::copy_out(ctx.policy(), b.data(), second, sizeof(std::int64_t) * b.size());
    ctx.synchronize();
    bool right = true;
    for (std::size_t i = 0; i < b.size(); ++i)
      right = right && b[i] == static_cast<std::int64_t>(i * i) + 1 && (i >= 1000 || a[i] == b[i]);
    CHECK(right);
  }
}

/// What is packed arrives, also when the block is packed again at once.
template <class Policy>
void check_upload(const Policy& policy) {
  turbomap::context<Policy> ctx(policy);
  turbomap::array<std::byte, turbomap::memory_of_t<Policy>> first, second;
  for (std::uint8_t round = 1; round < 20; ++round) {
    const std::size_t bytes = 1 + 997u * round;
    auto block = ctx.begin_upload(first, bytes);
    std::memset(block.host, round, bytes);
    ctx.send(block, bytes);
    block = ctx.begin_upload(second, bytes);
    std::memset(block.host, 100 + round, bytes);
    ctx.send(block, bytes);
    const auto a = content(ctx, first), b = content(ctx, second);
    bool right = a.size() == bytes && b.size() == bytes;
    for (std::size_t i = 0; i < bytes; ++i) right = right && a[i] == std::byte{round} && b[i] == std::byte(100 + round);
    CHECK(right);
  }
}

/// Arrays that are placed in one block arrive each as it was, aligned, empty ones too.
template <class Policy>
void check_packed_inputs(const Policy& policy) {
  turbomap::context<Policy> ctx(policy);
  turbomap::array<std::byte, turbomap::memory_of_t<Policy>> memory;
  turbomap::packed_inputs inputs;
  const auto bytes = inputs.place<std::uint8_t>(3);
  const auto nothing = inputs.place<double>(0);
  const auto numbers = inputs.place<double>(1000);
  const auto block = ctx.begin_upload(memory, inputs.bytes());
  std::vector<double> source(1000);
  for (std::size_t i = 0; i < source.size(); ++i) source[i] = static_cast<double>(i) / 3;
  for (std::uint8_t i = 0; i < 3; ++i) bytes.host(block)[i] = i;
  const double* volatile null = nullptr;  // g++ 13 with -O1 and sanitizers warns where it sees that it is null
  nothing.copy(block, null);
  numbers.copy(block, source.data());
  ctx.send(block, inputs.bytes());
  CHECK(numbers.at % turbomap::block_alignment == 0);
  CHECK(inputs.bytes() >= 3 + 1000 * sizeof(double));
  std::vector<double> buffer;
  std::vector<std::uint8_t> byte_buffer;
  const double* arrived = ctx.on_host(numbers.resident(block), 1000, buffer);
  const std::uint8_t* three = ctx.on_host(bytes.resident(block), 3, byte_buffer);
  ctx.synchronize();
  CHECK(std::memcmp(arrived, source.data(), source.size() * sizeof(double)) == 0);
  CHECK((three[0] == 0 && three[1] == 1 && three[2] == 2));
}

}  // namespace turbomap_test

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// One piece of work on the host and on a device, as `automatic` chooses: the same answer wherever it ran.

#include <turbomap/automatic.hpp>

#include <thrust/detail/seq.h>
#include <thrust/system/cuda/execution_policy.h>

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

#include "context_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::work_kind;
using turbomap::work_side;

/// Squares of the first n numbers, wherever ctx computes.
struct squares {
  int n;
  int& on_device;

  template <class Policy>
  std::vector<std::int64_t> operator()(turbomap::context<Policy>& ctx) const {
    on_device += std::is_same_v<Policy, stream_policy> ? 1 : 0;
    ctx.begin_call();
    const auto count = static_cast<std::size_t>(n);
    auto* out = ctx.template scratch<std::int64_t>(count);
    turbomap::fill_bytes(ctx.policy(), out, 0, count * sizeof(std::int64_t));
    turbomap::for_each_index(ctx.policy(), n, square_index{out});
    std::vector<std::int64_t> result(count);
    turbomap::copy_out(ctx.policy(), result.data(), out, count * sizeof(std::int64_t));
    ctx.synchronize();
    return result;
  }
};

TEST_CASE("the same answer on both sides, which both are measured") {
  const stream on;
  turbomap::automatic both{thrust::detail::seq_t{}, on.policy()};
  constexpr int calls = 2 * turbomap::crossover_measurement::samples;
  for (const int n : {1, 1000, 100000}) {
    int on_device = 0;
    const auto expected = squares{n, on_device}(both.host());
    for (int i = 0; i < calls; ++i) CHECK(both.run(work_kind::search, n, squares{n, on_device}) == expected);
    CHECK(on_device == calls / 2);
    both.pin(work_side::device);
    CHECK(both.run(work_kind::search, n, squares{n, on_device}) == expected);
    CHECK(on_device == calls / 2 + 1);
    both.pin(work_side::host);
    CHECK(both.run(work_kind::search, n, squares{n, on_device}) == expected);
    CHECK(on_device == calls / 2 + 1);
    both.measure();
  }
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Sums of the frames on a device, block by block: as on the host, for frames of any size and any number of parts.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include <turbomap/adjustment/frame_sums.hpp>
#include <turbomap/adjustment/uploaded.hpp>

#include "adjustment_results.hpp"
#include "reference/larger_or_nan.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

/// Frames with 0, 1, 2, ... chunks and factors each, in an order of their own.
template <int V, int D>
struct parts {
  static constexpr int frames = 40;
  std::vector<std::int32_t> frame_partial{0}, partial_list, frame_factor{0}, frame_factor_list;
  std::vector<double> chunk, factor;

  parts() {
    std::mt19937 random(D);
    std::normal_distribution<double> normal;
    for (int f = 0; f < frames; ++f) {
      frame_partial.push_back(frame_partial.back() + f);
      frame_factor.push_back(frame_factor.back() + (frames - f) % 7);
    }
    const auto shuffled = [&](int n, std::vector<std::int32_t>& list) {
      for (int i = 0; i < n; ++i) list.push_back(i);
      for (std::size_t i = list.size(); i > 1; --i) std::swap(list[i - 1], list[random() % i]);
    };
    shuffled(frame_partial.back(), partial_list), shuffled(frame_factor.back(), frame_factor_list);
    chunk.resize(partial_list.size() * turbomap::landmark_block<V>::partial);
    factor.resize(frame_factor_list.size() * turbomap::frame_block<D>::partial);
    for (auto* values : {&chunk, &factor})
      for (double& x : *values) x = normal(random);
  }

  /// H of all frames, then b.
  template <class Policy>
  std::vector<double> sum(const Policy& policy) const {
    using memory = turbomap::memory_of_t<Policy>;
    using turbomap::frame_block;
    turbomap::context<Policy> ctx{policy};
    turbomap::resident_copy<std::int32_t, memory> lists[4];
    turbomap::resident_copy<double, memory> values[2];
    turbomap::schur_view<float> s;
    lists[0].send(policy, frame_partial.data(), frame_partial.size()),
        lists[1].send(policy, partial_list.data(), partial_list.size());
    lists[2].send(policy, frame_factor.data(), frame_factor.size()),
        lists[3].send(policy, frame_factor_list.data(), frame_factor_list.size());
    values[0].send(policy, chunk.data(), chunk.size()), values[1].send(policy, factor.data(), factor.size());
    s.frame_partial = lists[0].data(), s.partial_list = lists[1].data();
    s.frame_factor = lists[2].data(), s.frame_factor_list = lists[3].data();
    s.sums.chunk_partial = const_cast<double*>(values[0].data());
    s.sums.factor_partial = const_cast<double*>(values[1].data());
    const std::size_t triangles = frames * frame_block<D>::triangle, n = triangles + frames * D;
    s.free_frames = frames;
    s.H = ctx.template scratch<double>(n), s.b = s.H + triangles;
    turbomap::launch_sum_frames<V, D>(ctx.policy(), s);
    std::vector<double> result(n);
    turbomap::copy_out(ctx.policy(), result.data(), s.H, n * sizeof(double));
    ctx.synchronize();
    return result;
  }
};

template <int V, int D>
void check() {
  CAPTURE(D);
  const stream on;
  const parts<V, D> p;
  const auto host = p.sum(thrust::seq), device = p.sum(on.policy());
  REQUIRE(host.size() == device.size());
  double largest = 0;
  for (std::size_t i = 0; i < host.size(); ++i) largest = larger_or_nan(largest, std::abs(device[i] - host[i]));
  CHECK(largest < 1e-13);
  CHECK(same_bits(p.sum(on.policy()), device));
}

TEST_CASE("frames of six, nine and fifteen unknowns") {
  check<6, 6>();
  check<9, 9>();
  check<6, 15>();
  check<3, 3>();
}

}  // namespace

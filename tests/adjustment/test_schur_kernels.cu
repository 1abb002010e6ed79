// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Elimination, blocks of the reduced system, products with it and back-substitution on a device: as on the host, for frames of any size, lists
/// of any length, and the same bits each time.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <type_traits>
#include <vector>

#include <turbomap/adjustment/eliminate_landmarks.hpp>
#include <turbomap/adjustment/reduced_system.hpp>
#include <turbomap/adjustment/schur_product.hpp>
#include <turbomap/adjustment/substitute_landmarks.hpp>
#include <turbomap/adjustment/uploaded.hpp>

#include "adjustment_results.hpp"
#include "reference/larger_or_nan.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::frame_block;

/// Landmarks that 0, 1, 2, ... frames see, once or twice each, with rows of fixed frames beside; factors between frames.
template <class A, int V, int D>
struct random_system {
  int frames, landmarks, factors = 9;
  std::vector<std::int32_t> landmark_row{0}, landmark_slot{0}, slot_coupling{0}, slot_frame, slot_landmark;
  std::vector<std::int32_t> frame_slot{0}, slot_list, block_row, block_column, block_pair{0}, block_factor{0},
      factor_list;
  std::vector<turbomap::slot_pair> pairs;
  std::vector<std::int32_t> frame_pair{0};
  std::vector<turbomap::frame_neighbour> neighbours;
  std::vector<std::uint8_t> fixed;
  std::vector<A> row, coupling;
  std::vector<double> square, H, b, step, from;

  random_system(int frame_count, int landmark_count) : frames(frame_count), landmarks(landmark_count) {
    std::mt19937 random(V * 100 + D);
    std::normal_distribution<double> normal;
    std::vector<std::vector<std::int32_t>> slots_of(static_cast<std::size_t>(frames));
    for (int l = 0; l < landmarks; ++l) {
      fixed.push_back(l % 11 == 5 || l % 41 == 0 ? 1 : 0);  // also those without rows
      std::vector<int> seen(static_cast<std::size_t>(frames));
      for (int f = 0; f < frames; ++f) seen[static_cast<std::size_t>(f)] = f;
      std::shuffle(seen.begin(), seen.end(), random);
      seen.resize(static_cast<std::size_t>(l % (frames + 1)));
      std::sort(seen.begin(), seen.end());
      for (const int f : seen) {
        slots_of[static_cast<std::size_t>(f)].push_back(static_cast<std::int32_t>(slot_frame.size()));
        slot_frame.push_back(f), slot_landmark.push_back(l);
        slot_coupling.push_back(slot_coupling.back() + 1 + static_cast<int>(random() % 2));
      }
      landmark_slot.push_back(static_cast<std::int32_t>(slot_frame.size()));
      landmark_row.push_back(landmark_row.back() + l % 41);
    }
    for (std::int32_t r = 0; r < landmark_row.back(); ++r) {  // H of a row is that of a Jacobian
      const double x = normal(random), y = normal(random), z = normal(random);
      for (const double e : {x * x, y * x, y * y, z * x, z * y, z * z, normal(random), normal(random), normal(random)})
        row.push_back(static_cast<A>(e));
    }
    for (std::int32_t c = 0; c < slot_coupling.back() * 3 * V; ++c) coupling.push_back(static_cast<A>(normal(random)));
    row.resize(row.size() + turbomap::column_slack), coupling.resize(coupling.size() + turbomap::column_slack);
    for (const auto& list : slots_of) {
      slot_list.insert(slot_list.end(), list.begin(), list.end());
      frame_slot.push_back(static_cast<std::int32_t>(slot_list.size()));
    }
    for (int f = 0; f < frames; ++f)
      for (int g = f + 1; g < frames; ++g) {
        block_row.push_back(f), block_column.push_back(g);
        for (const auto a : slots_of[static_cast<std::size_t>(f)])
          for (const auto c : slots_of[static_cast<std::size_t>(g)])
            if (slot_landmark[static_cast<std::size_t>(a)] == slot_landmark[static_cast<std::size_t>(c)])
              pairs.push_back({a, c});
        if ((f + g) % 4 == 0)
          for (int k = 0; k < 1 + f % 3; ++k) factor_list.push_back(static_cast<int>(random() % 18));
        block_pair.push_back(static_cast<std::int32_t>(pairs.size()));
        block_factor.push_back(static_cast<std::int32_t>(factor_list.size()));
      }
    for (int f = 0; f < frames; ++f) {
      for (int g = 0; g < frames; ++g)
        if (f != g && (f + g) % 3 == 0) neighbours.push_back({(f + g) % factors, g, f < g ? 1 : 0});
      frame_pair.push_back(static_cast<std::int32_t>(neighbours.size()));
    }
    const auto fill = [&](std::vector<double>& x, int n) {
      for (int i = 0; i < n; ++i) x.push_back(normal(random));
    };
    fill(square, factors * D * D), fill(H, frames * frame_block<D>::triangle), fill(b, frames * D);
    fill(step, frames * D), fill(from, landmarks * turbomap::landmark_stride);
  }

  /// Everything that the launchers write, one after the other.
  template <class Policy>
  std::vector<double> run(const Policy& policy, bool dense, bool scaled) const {
    turbomap::context<Policy> ctx{policy};
    ctx.begin_call();
    const auto send = [&](const auto& x) {
      using T = typename std::decay_t<decltype(x)>::value_type;
      T* to = ctx.template scratch<T>(x.size());
      turbomap::copy_in(policy, to, x.data(), x.size() * sizeof(T));
      return to;
    };
    turbomap::schur_view<A> s;
    s.free_frames = frames, s.landmarks = landmarks, s.blocks = static_cast<int>(block_row.size());
    s.landmark_row = send(landmark_row), s.landmark_slot = send(landmark_slot), s.slot_coupling = send(slot_coupling);
    s.slot_frame = send(slot_frame), s.slot_landmark = send(slot_landmark), s.frame_slot = send(frame_slot);
    s.slot_list = send(slot_list), s.block_row = send(block_row), s.block_column = send(block_column);
    s.block_pair = send(block_pair), s.pairs = send(pairs), s.block_factor = send(block_factor);
    s.factor_list = send(factor_list), s.landmark_fixed = send(fixed);
    s.frame_pair = send(frame_pair), s.neighbours = send(neighbours);
    s.sums.row = send(row), s.sums.coupling = send(coupling), s.sums.factor_square = send(square);
    s.H = send(H), s.b = send(b);
    const std::size_t eliminated = slot_frame.size() * 3 * V, count = static_cast<std::size_t>(landmarks);
    s.eliminated = ctx.template scratch<A>(eliminated + turbomap::column_slack);
    s.landmark = ctx.template scratch<turbomap::eliminated_landmark>(count);
    const turbomap::damping damping{0.3, scaled};
    turbomap::launch_eliminate_landmarks<V>(ctx.policy(), s, damping);

    const int n = frames * D, stride = n + 3;
    const std::size_t size = dense ? static_cast<std::size_t>(stride) * static_cast<std::size_t>(n)
                                   : static_cast<std::size_t>(frames + s.blocks) * D * D;
    double* S = ctx.template scratch<double>(size + static_cast<std::size_t>(n));
    turbomap::fill_bytes(policy, S, 0, size * sizeof(double));
    turbomap::launch_reduce_blocks<V, D>(ctx.policy(), s, turbomap::reduced_layout{S, S + size, stride, dense},
                                         damping);

    const auto gains = static_cast<std::size_t>(turbomap::landmark_gain_count(landmarks));
    double* to = ctx.template scratch<double>(from.size() + gains);
    turbomap::launch_substitute_landmarks<V, D>(ctx.policy(), s, send(step), damping, send(from), to, to + from.size());

    double* y = ctx.template scratch<double>(3 * count + static_cast<std::size_t>(n));
    const double* p = send(step);
    turbomap::launch_gather_landmarks<V, D>(ctx.policy(), s, p, y);
    turbomap::launch_multiply_frames<V, D>(ctx.policy(), s, p, y, damping, y + 3 * count);

    std::vector<double> product(3 * count + static_cast<std::size_t>(n));
    turbomap::copy_out(policy, product.data(), y, product.size() * sizeof(double));
    std::vector<A> z(eliminated);
    std::vector<turbomap::eliminated_landmark> e(count);
    std::vector<double> result(size + static_cast<std::size_t>(n) + from.size() + gains);
    turbomap::copy_out(policy, z.data(), s.eliminated, z.size() * sizeof(A));
    turbomap::copy_out(policy, e.data(), s.landmark, e.size() * sizeof(e[0]));
    turbomap::copy_out(policy, result.data(), S, (size + static_cast<std::size_t>(n)) * sizeof(double));
    turbomap::copy_out(policy, result.data() + size + static_cast<std::size_t>(n), to,
                       (from.size() + gains) * sizeof(double));
    ctx.synchronize();
    result.insert(result.end(), z.begin(), z.end());
    result.insert(result.end(), product.begin(), product.end());
    for (const auto& x : e) {
      result.insert(result.end(), x.inverse, x.inverse + 6);
      result.insert(result.end(), x.c, x.c + 3), result.insert(result.end(), x.b, x.b + 3);
    }
    return result;
  }
};

template <class A, int V, int D>
void check(int frames, int landmarks) {
  CAPTURE(sizeof(A));
  CAPTURE(V);
  CAPTURE(D);
  const stream on;
  const random_system<A, V, D> p(frames, landmarks);
  for (const bool dense : {true, false})
    for (const bool scaled : {true, false}) {
      CAPTURE(dense);
      CAPTURE(scaled);
      const auto host = p.run(thrust::seq, dense, scaled), device = p.run(on.policy(), dense, scaled);
      REQUIRE(host.size() == device.size());
      double largest = 0;
      for (std::size_t i = 0; i < host.size(); ++i)
        largest = larger_or_nan(largest, std::abs(device[i] - host[i]) / std::max(1.0, std::abs(host[i])));
      CHECK(largest < (sizeof(A) == 8 ? 1e-9 : 1e-3));
      CHECK(same_bits(p.run(on.policy(), dense, scaled), device));
    }
}

TEST_CASE("frames of one to fifteen unknowns, of which landmarks see all or some") {
  check<double, 6, 6>(12, 300);
  check<float, 6, 6>(12, 300);
  check<double, 6, 15>(12, 100);
  check<float, 6, 15>(5, 100);
  check<double, 9, 9>(12, 100);
  check<float, 9, 9>(7, 100);
  check<double, 3, 3>(33, 100);
  check<double, 1, 3>(9, 100);
  check<float, 1, 1>(9, 100);
  check<double, 2, 3>(9, 100);
  check<float, 2, 4>(9, 100);
  check<double, 13, 15>(7, 60);  // more than a thread keeps the square of
  check<float, 15, 15>(7, 60);
}

TEST_CASE("one frame, no landmark, lists longer than a block has threads") {
  check<double, 6, 6>(1, 1);
  check<double, 6, 6>(2, 0);
  check<double, 6, 6>(3, 17);
  check<double, 6, 6>(3, 1500);
  check<float, 6, 6>(2, 2000);
}

}  // namespace

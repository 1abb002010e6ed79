// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The reduced system against sums in long double, however its blocks are shared out.

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <tuple>
#include <vector>

#include <turbomap/adjustment/block_finder.hpp>
#include <turbomap/adjustment/reduced_system.hpp>
#include <turbomap/adjustment/structure_builder.hpp>

#include "reference/larger_or_nan.hpp"
#include "support/policies.hpp"

namespace {

constexpr int V = 6, D = 6, triangle = turbomap::frame_block<D>::triangle;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// Eliminated landmarks that random frames see, the first frame most of them: its row is far longer than the others.
struct scene {
  turbomap::adjustment_structure structure;
  std::vector<double> columns, H, b;
  std::vector<turbomap::eliminated_landmark> landmark;
  turbomap::schur_view<double> s;

  scene(int frames, int landmarks, int rows, bool blocks) {
    std::mt19937 random(static_cast<unsigned>(frames * 1000 + rows));
    std::uniform_real_distribution<double> number(-1, 1);
    std::vector<std::int32_t> frame, seen;
    for (int r = 0; r < rows; ++r) {
      frame.push_back(random() % 3 == 0 ? 0 : static_cast<int>(random() % at(frames)));
      seen.push_back(static_cast<int>(random() % at(landmarks)));
    }
    const turbomap::landmark_group_input group{{frame.data(), frame.size()}, {seen.data(), seen.size()}, nullptr, 1};
    turbomap::structure_builder().build({frames, landmarks, {}, {&group, 1}, {}, 8}, structure);
    if (blocks) turbomap::block_finder().find(structure);
    const auto fill = [&](std::vector<double>& x, std::size_t n) {
      for (std::size_t i = 0; i < n; ++i) x.push_back(number(random));
    };
    fill(columns, structure.slots() * 3 * V + turbomap::column_slack);
    fill(H, at(frames) * triangle), fill(b, at(frames) * D);
    for (int l = 0; l < landmarks; ++l) landmark.push_back({{number(random), number(random), number(random)}, {}, {}});
    s.free_frames = frames, s.landmarks = landmarks, s.blocks = static_cast<int>(structure.block_row.size());
    turbomap::for_each_sum_list(s, structure, [](auto& to, const auto& from) { to = from.data(); });
    turbomap::for_each_block_list(s, structure, [](auto& to, const auto& from) { to = from.data(); });
    s.eliminated = columns.data(), s.landmark = landmark.data(), s.H = H.data(), s.b = b.data();
  }

  std::size_t size() const { return (at(s.free_frames) + at(s.blocks)) * D * D; }
};

/// The blocks, then the right hand side. What is not written is not a number.
std::vector<double> reduced(const scene& x, const turbomap::damping& damping, int parts) {
  std::vector<double> out(x.size() + at(x.s.free_frames) * D, std::numeric_limits<double>::quiet_NaN());
  const turbomap::reduced_layout layout{out.data(), out.data() + x.size(), 0, false};
  turbomap::for_each_index(turbomap_test::sequential{}, parts,
                           turbomap::reduce_blocks<double, V, D>{x.s, layout, damping, parts});
  return out;
}

std::vector<double> expected(const scene& x, const turbomap::damping& damping) {
  const int frames = x.s.free_frames;
  std::vector<long double> S(at(frames) * at(frames) * D * D, 0), right(at(frames) * D, 0);
  const auto element = [&](int f, int r, int g, int c) -> long double& {
    return S[(at(f) * at(frames) + at(g)) * D * D + at(r * D + c)];
  };
  for (int f = 0; f < frames; ++f)
    for (int r = 0; r < D; ++r) {
      right[at(f * D + r)] = x.b[at(f * D + r)];
      for (int c = 0; c < D; ++c)
        element(f, r, f, c) = x.H[at(f * triangle + (r >= c ? r * (r + 1) / 2 + c : c * (c + 1) / 2 + r))];
      element(f, r, f, r) += damping(x.H[at(f * triangle + r * (r + 3) / 2)]);
    }
  for (int l = 0; l < x.s.landmarks; ++l)
    for (int i = x.s.landmark_slot[l]; i < x.s.landmark_slot[l + 1]; ++i)
      for (int m = 0; m < 3; ++m)
        for (int r = 0; r < V; ++r) {
          const long double z = x.columns[at(i * 3 * V + m * V + r)];
          right[at(x.s.slot_frame[i] * D + r)] -= z * x.landmark[at(l)].c[m];
          for (int k = i; k < x.s.landmark_slot[l + 1]; ++k)
            for (int c = 0; c < V; ++c)
              element(x.s.slot_frame[i], r, x.s.slot_frame[k], c) -= z * x.columns[at(k * 3 * V + m * V + c)];
        }
  std::vector<double> out;
  const auto add = [&](int f, int g) {
    for (int r = 0; r < D; ++r)
      for (int c = 0; c < D; ++c) out.push_back(static_cast<double>(element(f, r, g, c)));
  };
  for (int f = 0; f < frames; ++f) add(f, f);
  for (int k = 0; k < x.s.blocks; ++k) add(x.s.block_row[k], x.s.block_column[k]);
  for (const long double v : right) out.push_back(static_cast<double>(v));
  return out;
}

TEST_CASE("blocks of S are those of plain sums, each written by one index, in any number of parts") {
  const turbomap::damping damping{0.5};
  for (const auto& [frames, landmarks, rows] :
       {std::tuple{12, 60, 400}, {30, 500, 900}, {5, 3, 12}, {1, 4, 9}, {4, 9, 0}})
    for (const bool blocks : {true, false}) {
      const scene x(frames, landmarks, rows, blocks);
      const auto want = expected(x, damping), once = reduced(x, damping, 1);
      double most = 0;
      REQUIRE(once.size() == want.size());
      for (std::size_t i = 0; i < want.size(); ++i)
        most = turbomap_test::larger_or_nan(most, std::fabs(once[i] - want[i]));
      CHECK(most < 1e-11);
      for (const int parts : {2, 3, 7, 64, 1000}) CHECK(reduced(x, damping, parts) == once);
    }
}

TEST_CASE("a lambda where the policy computes is the one that is used") {
  scene x(12, 60, 400, true);
  const auto want = reduced(x, {2.0}, 3);
  const double lambda = 2;
  x.s.lambda = &lambda;
  CHECK(reduced(x, {0.5}, 3) == want);
}

TEST_CASE("no frames") {
  const scene x(1, 1, 0, true);
  turbomap::schur_view<double> none = x.s;
  none.free_frames = 0;
  std::vector<double> out(at(2 * D * D), 7);
  turbomap::launch_reduce_blocks<V, D>(turbomap_test::sequential{}, none, {out.data(), out.data() + D * D, 0, false},
                                       {0.5});
  CHECK(out == std::vector<double>(out.size(), 7));
}

}  // namespace

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Windows of descriptors against one distance after the other: every width, every window, limits that shrink on the way. With vectors
/// of 256 bits where this file is compiled for them.

#include <doctest/doctest.h>

#include <random>
#include <turbomap/descriptor/real.hpp>
#include <turbomap/matching/window_descriptors.hpp>
#include <vector>

using namespace turbomap;

namespace {

template <class D>
class sample {
 public:
  explicit sample(std::size_t count)
      : rows(count * D::elements), memory(row::room(count)), windows{memory.data(), count}, query(D::elements) {
    for (auto& e : rows) e = static_cast<typename D::element>(random_());
    for (auto& e : query) e = static_cast<typename D::element>(random_());
    // Some are nearly alike, or there would be nothing near.
    for (std::size_t k = 0; k < count; k += 3)
      std::copy(query.begin() + static_cast<std::ptrdiff_t>(random_() % D::elements), query.end(),
                rows.begin() + static_cast<std::ptrdiff_t>(k) * D::elements);
    for (std::size_t k = 0; k < count; ++k) windows.set(k, rows.data() + k * D::elements);
  }
  auto distance(std::int32_t k) const { return D::distance(query.data(), rows.data() + k * D::elements); }

  using row = window_descriptors<D>;
  std::vector<typename D::element> rows, memory;
  row windows;
  std::vector<typename D::element> query;

 private:
  std::mt19937 random_{7};
};

}  // namespace

TEST_CASE_TEMPLATE("a window is what one distance after the other gives", D, binary_descriptor<8>,
                   binary_descriptor<72>, binary_descriptor<256>, binary_descriptor<488>, binary_descriptor<512>,
                   binary_descriptor<1024>, real_descriptor<float, 8>) {
  using distance_type = typename D::distance_type;
  for (const std::size_t count : {0, 1, 7, 8, 9, 40}) {
    const sample<D> s(count);
    const auto last = static_cast<std::int32_t>(count);
    for (std::int32_t begin = 0; begin <= last; ++begin)
      for (std::int32_t end = begin; end <= last; ++end)
        for (const bool shrinks : {false, true}) {
          // A limit that is met exactly.
          const distance_type limit = count == 0 ? distance_type(1) : s.distance((begin + end) / 2 % last);
          std::vector<std::int32_t> expected, found;
          distance_type most = limit;
          for (std::int32_t k = begin; k < end; ++k) {
            if (!(s.distance(k) <= most)) continue;
            expected.push_back(k);
            if (shrinks) most = s.distance(k);
          }
          most = limit;
          s.windows.visit_near(
              s.query.data(), begin, end, [&] { return most; },
              [&](std::int32_t k, distance_type d) {
                CHECK(d == s.distance(k));
                found.push_back(k);
                if (shrinks) most = d;
              });
          CHECK(found == expected);
        }
  }
}

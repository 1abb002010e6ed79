// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Distances to some rows of a list against one distance after the other: every width, lists of every length, limits that shrink on the
/// way. With vectors of 256 bits where this file is compiled for them.

#include <doctest/doctest.h>

#include <random>
#include <turbomap/descriptor/real.hpp>
#include <turbomap/matching/listed_distances.hpp>
#include <vector>

using namespace turbomap;

namespace {

template <class D>
class sample {
 public:
  explicit sample(std::size_t count) : rows(count * D::elements), query(D::elements) {
    for (auto& e : rows) e = static_cast<typename D::element>(random_());
    for (auto& e : query) e = static_cast<typename D::element>(random_());
    // Some are nearly alike, or there would be nothing near.
    for (std::size_t k = 0; k < count; k += 3)
      std::copy(query.begin() + static_cast<std::ptrdiff_t>(random_() % D::elements), query.end(),
                rows.begin() + static_cast<std::ptrdiff_t>(k) * D::elements);
  }
  auto distance(std::int32_t k) const { return D::distance(query.data(), rows.data() + k * D::elements); }
  /// So many places of rows, and the room that a visit writes to.
  std::vector<std::int32_t> places(std::size_t count) {
    std::vector<std::int32_t> result(count + 3, -1);
    for (std::size_t k = 0; k < count; ++k)
      result[k] = static_cast<std::int32_t>(random_() % (rows.size() / D::elements));
    return result;
  }

  std::vector<typename D::element> rows, query;

 private:
  std::mt19937 random_{7};
};

}  // namespace

TEST_CASE_TEMPLATE("the near ones of a list are those that one distance after the other gives", D, binary_descriptor<8>,
                   binary_descriptor<72>, binary_descriptor<256>, binary_descriptor<488>, binary_descriptor<512>,
                   binary_descriptor<7936>, binary_descriptor<8192>, real_descriptor<float, 8>) {
  using distance_type = typename D::distance_type;
  sample<D> s(40);
  for (int round = 0; round < 200; ++round) {
    const int count = round % 20;
    auto places = s.places(static_cast<std::size_t>(count));
    const auto listed = places;
    for (const bool shrinks : {false, true}) {
      // A limit that is met exactly, one that all meet, and one that none meets.
      distance_type limit = count == 0 ? distance_type(1) : s.distance(listed[static_cast<std::size_t>(count) / 2]);
      if (round % 5 == 0) limit = D::worst;
      if (round % 7 == 0) limit = distance_type(-1);
      std::vector<std::int32_t> expected, found;
      distance_type most = limit;
      for (int i = 0; i < count; ++i) {
        const std::int32_t k = listed[static_cast<std::size_t>(i)];
        if (!(s.distance(k) <= most)) continue;
        expected.push_back(k);
        if (shrinks) most = s.distance(k);
      }
      most = limit;
      const listed_distances<D> rows{s.rows.data()};
      rows.visit_near(
          s.query.data(), places.data(), count, [&] { return most; },
          [&](std::int32_t k, distance_type d) {
            CHECK(d == s.distance(k));
            found.push_back(k);
            if (shrinks) most = d;
          });
      CHECK(found == expected);
    }
  }
}

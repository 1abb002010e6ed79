// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Distances of listed pairs of descriptors against one distance after the other: every width, lists of every length, several
/// queries. With vectors of 256 bits where this file is compiled for them.

#include <doctest/doctest.h>

#include <algorithm>
#include <random>
#include <turbomap/descriptor/real.hpp>
#include <turbomap/matching/listed_distances.hpp>
#include <vector>

using namespace turbomap;

namespace {

constexpr int query_count = 5;

template <class D>
class sample {
 public:
  explicit sample(int count) : rows_(static_cast<std::size_t>(count * D::elements)), row_count_(count) {
    for (auto& e : rows_) e = static_cast<typename D::element>(random_());
    queries_.resize(static_cast<std::size_t>(query_count * D::elements));
    for (auto& e : queries_) e = static_cast<typename D::element>(random_());
    for (int q = 0; q < query_count; ++q) queries.push_back(queries_.data() + q * D::elements);
    // Some are nearly alike, or there would be nothing near.
    for (int k = 0; k < count; k += 2)
      std::copy(queries[static_cast<std::size_t>(k % query_count)] + random_() % D::elements,
                queries[static_cast<std::size_t>(k % query_count)] + D::elements, rows_.begin() + k * D::elements);
  }
  const typename D::element* rows() const { return rows_.data(); }
  auto distance(int query, std::int32_t place) const {
    return D::distance(queries[static_cast<std::size_t>(query)], rows() + place * D::elements);
  }
  /// So many pairs, and the room that a visit writes to.
  void draw_pairs(std::size_t count) {
    owners.assign(count + 3, 255), places.assign(count + 3, -1);
    for (std::size_t i = 0; i < count; ++i) {
      owners[i] = static_cast<std::uint8_t>(random_() % query_count);
      places[i] = static_cast<std::int32_t>(random_() % static_cast<unsigned>(row_count_));
    }
  }

  std::vector<const typename D::element*> queries;
  std::vector<std::uint8_t> owners;
  std::vector<std::int32_t> places;

 private:
  std::mt19937 random_{7};
  std::vector<typename D::element> rows_, queries_;
  int row_count_;
};

}  // namespace

TEST_CASE_TEMPLATE("the near pairs of a list are those that one distance after the other gives", D,
                   binary_descriptor<8>, binary_descriptor<72>, binary_descriptor<256>, binary_descriptor<488>,
                   binary_descriptor<512>, binary_descriptor<7936>, binary_descriptor<8192>,
                   real_descriptor<float, 8>) {
  using distance_type = typename D::distance_type;
  sample<D> s(40);
  for (int round = 0; round < 400; ++round) {
    const int count = round % 20;
    s.draw_pairs(static_cast<std::size_t>(count));
    std::vector<distance_type> all;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i)
      all.push_back(s.distance(s.owners[i], s.places[i]));
    // A limit that is met exactly, one that all meet, and one that none meets.
    distance_type limit = count == 0 ? distance_type(1) : all[static_cast<std::size_t>(count) / 2];
    if (round % 5 == 0) limit = D::worst;
    if (round % 7 == 0) limit = distance_type(-1);
    std::vector<int> expected, found;
    for (int i = 0; i < count; ++i)
      if (all[static_cast<std::size_t>(i)] <= limit) expected.push_back(i);
    const listed_distances<D> distances{s.rows()};
    distances.visit_near(s.queries.data(), s.owners.data(), s.places.data(), count, limit, [&](int i, distance_type d) {
      CHECK(d == all[static_cast<std::size_t>(i)]);
      found.push_back(i);
    });
    CHECK(found == expected);
  }
}

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Distances of pairs of descriptors: a query's, and one of a list. Pairs of many queries are compared in one loop, because the
/// end of a short loop for each query could not be predicted. Where the processor has vectors of 256 bits, binary descriptors
/// of whole vectors are compared four at a time, with no branch until one of them is near.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../descriptor/binary.hpp"
#include "../descriptor/descriptor_concept.hpp"
#include "../descriptor/four_distances.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One descriptor after the other.
template <class Descriptor, class = void>
struct listed_distances {
  using element = typename Descriptor::element;              ///< of a descriptor
  using distance_type = typename Descriptor::distance_type;  ///< of two

  const element* rows;  ///< descriptors

  /// Calls consider(i, d) for those i of [0, count), ascending, whose query queries[owners[i]] and row places[i] have a distance d
  /// of at most `most`. Three more owners and places are overwritten.
  template <class Consider>
  void visit_near(const element* const* queries, const std::uint8_t* owners, const std::int32_t* places, int count,
                  distance_type most, Consider consider) const {
    for (int i = 0; i < count; ++i) {
      const element* const query = queries[owners[i]];
      const element* const row = rows + static_cast<std::ptrdiff_t>(places[i]) * Descriptor::elements;
      if constexpr (detail::has_at_least_v<Descriptor>)
        if (Descriptor::at_least(query, row) > most) continue;
      const distance_type d = Descriptor::distance(query, row);
      if (d <= most) consider(i, d);
    }
  }
};

#if TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES >= 32

/// Up to 7936 bits: a byte counts 8 bits of each vector.
template <int Bits>
struct listed_distances<binary_descriptor<Bits>, std::enable_if_t<Bits % 256 == 0 && Bits / 256 <= 31>> {
  using element = std::uint8_t;        ///< of a descriptor
  using distance_type = std::int32_t;  ///< of two

  const element* rows;  ///< descriptors

  /// The same.
  template <class Consider>
  void visit_near(const element* const* queries, std::uint8_t* owners, std::int32_t* places, int count,
                  distance_type most, Consider consider) const {
    for (int i = count; i < count + 3; ++i) owners[i] = 0, places[i] = 0;  // the first pair's query and row are there
    const auto apart = [&](int i) {
      return detail::different_bits(queries[owners[i]], rows + static_cast<std::ptrdiff_t>(places[i]) * (Bits / 8),
                                    std::make_index_sequence<Bits / 256>());
    };
    const __m128i limit = _mm_set1_epi16(static_cast<short>(most < Bits ? most : Bits));
    for (int i = 0; i < count; i += 4) {
      const __m128i sums = detail::sums_of_four(apart(i), apart(i + 1), apart(i + 2), apart(i + 3));
      constexpr int used = 0x0505;  // words 0, 1, 4, 5: word_of_four
      if ((~_mm_movemask_epi8(_mm_cmpgt_epi16(sums, limit)) & used) == 0) continue;
      std::int16_t d[8];
      std::memcpy(d, &sums, sizeof d);
      for (int k = 0; k < 4 && i + k < count; ++k)
        if (const std::int16_t distance = d[detail::word_of_four[k]]; distance <= most)
          consider(i + k, std::int32_t{distance});
    }
  }
};

#endif

TURBOMAP_END_NAMESPACE

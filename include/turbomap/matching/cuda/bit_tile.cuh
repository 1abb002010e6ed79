// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Hamming distances of 16 x 8 pairs at once by the tensor cores of a warp, from compute capability 8.0 on: the instruction
/// mma.m16n8k256 with exclusive or and a count of bits [PTX ISA, 'Matrix fragments for mma.m16n8k256'].

#include <cstdint>
#include <type_traits>

#include "../../config.hpp"
#include "../../descriptor/binary.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Rows of whole words of 32 bits. Lane l holds rows l / 4 and l / 4 + 8 of the 16, and column l / 4 of the 8; of each chunk
/// of 256 bits the words 2 (l % 4) and the one after it. (The instruction wants words l % 4 and l % 4 + 4; the order of bits does
/// not matter as long as rows and columns have the same one, and neighbouring words are one load.)
template <int Bits>
struct bit_tile {
  static_assert(Bits % 32 == 0);
  static constexpr int rows = 16, columns = 8, words = Bits / 32, chunks = (words + 7) / 8;

  /// Whether descriptors that begin at `first` can be loaded.
  __device__ static bool fits(const std::uint8_t* first) {
    return reinterpret_cast<std::uintptr_t>(first) % (words % 2 == 0 ? 8 : 4) == 0;
  }

  /// The lane's words of one descriptor; zeros beyond its end.
  struct part {
    std::uint32_t word[chunks][2];

    __device__ void load(const std::uint8_t* from) {
      const int first = 2 * (static_cast<int>(threadIdx.x) % 4);
#pragma unroll
      for (int c = 0; c < chunks; ++c) {
        const int w = 8 * c + first;
        word[c][0] = word[c][1] = 0;
        if constexpr (words % 2 == 0) {
          if (w < words) {
            const uint2 both = *reinterpret_cast<const uint2*>(from + 4 * w);
            word[c][0] = both.x, word[c][1] = both.y;
          }
        } else {
          if (w < words) word[c][0] = *reinterpret_cast<const std::uint32_t*>(from + 4 * w);
          if (w + 1 < words) word[c][1] = *reinterpret_cast<const std::uint32_t*>(from + 4 * w + 4);
        }
      }
    }
  };

  /// distance[0], [1]: of row l / 4 with columns 2 (l % 4) and the next one; [2], [3]: of row l / 4 + 8. All lanes take part.
  __device__ static void distances(const part& upper, const part& lower, const part& column, std::int32_t (&d)[4]) {
#if __CUDA_ARCH__ >= 800
    d[0] = d[1] = d[2] = d[3] = 0;
#pragma unroll
    for (int c = 0; c < chunks; ++c)
      asm("mma.sync.aligned.m16n8k256.row.col.s32.b1.b1.s32.xor.popc {%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, "
          "{%0, %1, %2, %3};"
          : "+r"(d[0]), "+r"(d[1]), "+r"(d[2]), "+r"(d[3])
          : "r"(upper.word[c][0]), "r"(lower.word[c][0]), "r"(upper.word[c][1]), "r"(lower.word[c][1]),
            "r"(column.word[c][0]), "r"(column.word[c][1]));
#endif
  }
};

/// The tile of a descriptor; void: it has none.
template <class Descriptor>
struct tile_of {
  using type = void;
};
template <int Bits>
struct tile_of<binary_descriptor<Bits>> {
  using type = std::conditional_t<Bits % 32 == 0, bit_tile<Bits % 32 == 0 ? Bits : 32>, void>;
};

}  // namespace detail

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// 16-bit floating-point numbers as storage: IEEE-754 binary16, the layout of CUDA's __half, torch.float16 and
/// numpy.float16.

#include <cstdint>
#include <cstring>
#include <type_traits>

#include "../config.hpp"

namespace turbomap {

/// Storage only: arithmetic is done in float.
struct half {
  std::uint16_t bits;  ///< sign 1, exponent 5, fraction 10
};
static_assert(std::is_trivially_copyable_v<half> && sizeof(half) == 2);

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// The same number as a float: exact, with subnormals, infinities and NaN (whose fraction is kept).
/// No branches and no subnormal float on the way: it vectorises, and flush-to-zero cannot hurt it.
TURBOMAP_HD inline float to_float(half a) {
  const std::uint32_t sign = static_cast<std::uint32_t>(a.bits & 0x8000u) << 16;
  const std::uint32_t magnitude = a.bits & 0x7FFFu;
  const std::uint32_t is_special = static_cast<std::uint32_t>(magnitude >= 0x7C00u);  // infinity or NaN
  const std::uint32_t normal = (magnitude << 13) + ((127u - 15u) << 23) + is_special * ((127u - 15u) << 23);
  const float tiny = static_cast<float>(static_cast<std::int32_t>(magnitude)) * 0x1p-24F;
  std::uint32_t tiny_bits;
  std::memcpy(&tiny_bits, &tiny, sizeof tiny);
  const std::uint32_t is_tiny = 0u - static_cast<std::uint32_t>(magnitude < 0x0400u);  // a mask: `?:` would be a branch
  const std::uint32_t bits = (tiny_bits & is_tiny) | (normal & ~is_tiny) | sign;
  float result;
  std::memcpy(&result, &bits, sizeof result);
  return result;
}

TURBOMAP_END_NAMESPACE

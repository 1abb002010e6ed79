// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Copies of results into lists of the caller's on the host. A device copies into pinned memory at full rate and goes on; into other
/// memory it copies piece by piece, while the host waits.

#include <cstddef>
#include <cstring>
#include <initializer_list>

#include "array.hpp"
#include "config.hpp"
#include "context.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Some bytes of a result.
struct result_copy {
  void* to;           ///< on the host
  const void* from;   ///< in the memory of the policy
  std::size_t bytes;  ///< how many
};

/// The memory that they pass. Make one and use it for every call. Move-only.
class result_copies {
 public:
  /// Takes its memory from the context.
  template <class Policy>
  explicit result_copies(const context<Policy>& ctx) : staging_(ctx.staging_resource()) {}

  /// Copies, and waits for the policy.
  template <class Policy>
  void fetch(context<Policy>& ctx, std::initializer_list<result_copy> copies) {
    if constexpr (is_host_accessible_v<memory_of_t<Policy>>) {
      for (const result_copy& c : copies) copy_out(ctx.policy(), c.to, c.from, c.bytes);
      ctx.synchronize();
    } else {
      std::size_t bytes = 0;
      for (const result_copy& c : copies) bytes += align_up(c.bytes);
      staging_.resize_discard(bytes);
      std::byte* at = staging_.data();
      for (const result_copy& c : copies) {
        copy_out(ctx.policy(), at, c.from, c.bytes);
        at += align_up(c.bytes);
      }
      ctx.synchronize();
      at = staging_.data();
      for (const result_copy& c : copies) {
        if (c.bytes != 0) std::memcpy(c.to, at, c.bytes);
        at += align_up(c.bytes);
      }
    }
  }

 private:
  array<std::byte, host_memory> staging_;
};

TURBOMAP_END_NAMESPACE

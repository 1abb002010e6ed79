// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The arguments of one call in one block: places for arrays are reserved first, then the block is allocated, filled on the
/// host and sent to the memory of the policy in one copy.
///
///     packed_inputs inputs;
///     const auto poses = inputs.place<rigid_transform<double>>(count);
///     const auto scale = inputs.place<float>(scale_table_size);
///     const upload_block block = ctx.begin_upload(memory, inputs.bytes());
///     poses.copy(block, source);
///     fill_scales(options.scales, scale.host(block), nullptr);
///     ctx.send(block, inputs.bytes());
///     ... scale.resident(block) ...                               // the table where the policy computes

#include <cstddef>
#include <cstring>
#include <type_traits>

#include "config.hpp"
#include "memory.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A block of host memory that is filled by the caller and then sent to the policy's memory in one copy.
struct upload_block {
  std::byte* host;      ///< where the caller writes
  std::byte* resident;  ///< where the policy reads after send(); the same place for a host policy
};

/// The place of `size` elements in a block.
template <class T>
struct input_slot {
  static_assert(__is_trivially_copyable(T), "turbomap: arguments of a call are sent as bytes");

  std::size_t at = 0;    ///< bytes from the start of the block
  std::size_t size = 0;  ///< number of elements

  /// Where the host writes them.
  T* host(const upload_block& block) const { return reinterpret_cast<T*>(block.host + at); }
  /// Where the policy reads them, after the block has been sent.
  const T* resident(const upload_block& block) const { return reinterpret_cast<const T*>(block.resident + at); }
  /// Writes all of them.
  void copy(const upload_block& block, const T* source) const {
    if (size != 0) std::memcpy(block.host + at, source, size * sizeof(T));
  }
};

/// Lays out a block.
class packed_inputs {
 public:
  /// Reserves room for `n` elements, aligned to block_alignment.
  template <class T>
  input_slot<T> place(std::size_t n) {
    const input_slot<T> slot{bytes_, n};
    bytes_ = align_up(bytes_ + n * sizeof(T));
    return slot;
  }
  /// Size of the block.
  std::size_t bytes() const { return bytes_; }

 private:
  std::size_t bytes_ = 0;
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a search has found, as a list on the host. A search leaves a result for each of its indices, and most of them found
/// nothing: those that did are listed where the policy computes, in the order of the indices, and only the list is copied.

#include <cstddef>
#include <cstdint>

#include "array.hpp"
#include "config.hpp"
#include "context.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The number of entries, and from `header` bytes on the entries.
template <class Entry>
struct packed_list {
  static constexpr std::size_t header = block_alignment;  ///< bytes before the entries

  std::byte* bytes;  ///< of the list

  /// How many entries there are.
  TURBOMAP_HD std::int32_t* size() const { return reinterpret_cast<std::int32_t*>(bytes); }
  /// The first of them.
  TURBOMAP_HD Entry* entries() const { return reinterpret_cast<Entry*>(bytes + header); }
};

/// The memory of such lists. Make one and use it for every call. Move-only.
template <class Entry, class Policy>
class found_list {
  static constexpr bool on_host = is_host_accessible_v<memory_of_t<Policy>>;

 public:
  /// Takes its memory from the context.
  explicit found_list(const context<Policy>& ctx) : resident_(ctx.resource()), host_(ctx.staging_resource()) {}

  /// Lists the entries of those indices in [0, count) that found something, in their order. Waits for the policy. O(count).
  /// \param found   found(i, entry): whether index i did, and then its entry; plain data in the memory of the policy
  /// \param result  overwritten
  template <class Found, class List>
  void read(context<Policy>& ctx, int count, const Found& found, List& result) {
    if constexpr (on_host) {
      ctx.synchronize();
      result.clear();
      for (int i = 0; i < count; ++i) {
        Entry entry;
        if (found(i, entry)) result.push_back(entry);
      }
    } else {
      result.clear();
      if (count <= 0) return;
      const auto most = static_cast<std::size_t>(count);
      const packed_list<Entry> list = launch_list_found(ctx.policy(), count, found, resident_);  // of a device only
      // As many as last time, and some more, come along with their number: mostly there is one copy and one wait.
      std::size_t copied = expected_ < most ? expected_ : most;
      fetch(ctx, list, copied);
      const std::size_t size = static_cast<std::size_t>(*reinterpret_cast<const std::int32_t*>(host_.data()));
      expected_ = size + size / 4 + fewest_expected;
      if (size > copied) fetch(ctx, list, size);
      const auto* const entries = reinterpret_cast<const Entry*>(host_.data() + packed_list<Entry>::header);
      result.assign(entries, entries + size);
    }
  }

 private:
  static constexpr std::size_t fewest_expected = 1024;

  /// The header and the first `n` entries.
  template <class L>
  void fetch(context<Policy>& ctx, const L& list, std::size_t n) {
    const std::size_t bytes = L::header + n * sizeof(Entry);
    host_.resize_discard(bytes);
    copy_out(ctx.policy(), host_.data(), list.bytes, bytes);
    ctx.synchronize();
  }

  array<std::byte, memory_of_t<Policy>> resident_;
  array<std::byte, host_memory> host_;
  std::size_t expected_ = fewest_expected;
};

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/list_found.cuh"
#endif

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Arrays that are filled on the host and read where the policy computes.

#include <cstddef>
#include <vector>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A host vector, and under CUDA its copy on the device.
template <class T, class Memory>
class uploaded {
 public:
  explicit uploaded(std::pmr::memory_resource* resource) : resident_(resource) {}

  std::vector<T>& host() { return host_; }
  const std::vector<T>& host() const { return host_; }

  /// Makes what the host holds readable to the policy. Enqueued under CUDA; the host's must stay until it has passed.
  template <class Policy>
  void send(const Policy& policy) {
    send_from(policy, host_.data(), host_.size());
  }
  /// The same from elsewhere, for what is only read in place under a host policy.
  template <class Policy>
  void send_from(const Policy& policy, const T* from, std::size_t n) {
    if constexpr (std::is_same_v<Memory, host_memory>) {
      data_ = from;
    } else {
      resident_.resize_discard(n);
      copy_in(policy, resident_.data(), from, n * sizeof(T));
      data_ = resident_.data();
    }
  }

  /// Where the policy computes; null before the first send().
  const T* data() const { return data_; }

 private:
  std::vector<T> host_;
  array<T, Memory> resident_;
  const T* data_ = nullptr;
};

TURBOMAP_END_NAMESPACE

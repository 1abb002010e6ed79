// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A growable buffer of plain elements in the memory of a policy: results stay there until they are asked for on the host.
/// Growing discards the content; elements are not initialised.

#include <cstddef>
#include <memory_resource>
#include <type_traits>
#include <utility>

#include "memory.hpp"
#include "span.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Owns `size()` elements of `T` in `Memory` (host_memory or device_memory). Move-only. Capacity never shrinks, so a buffer
/// that is used again with the same size allocates nothing.
template <class T, class Memory>
class array {
  static_assert(std::is_trivially_copyable_v<T>, "turbomap::array holds plain data only: it crosses the bus as bytes");

 public:
  explicit array(std::pmr::memory_resource* resource = default_resource(Memory{})) : resource_(resource) {}
  array(array&& other) noexcept
      : resource_(other.resource_),
        data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  array& operator=(array&& other) noexcept {
    std::swap(resource_, other.resource_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }
  ~array() { release(); }

  /// Makes room for `n` elements of unspecified value. Throws what the resource throws; the buffer is then unchanged.
  void resize_discard(std::size_t n) {
    if (n > capacity_) {
      const std::size_t capacity = n + n / 4;
      T* grown = static_cast<T*>(resource_->allocate(capacity * sizeof(T), block_alignment));
      release();
      data_ = grown;
      capacity_ = capacity;
    }
    size_ = n;
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  std::size_t size() const { return size_; }
  std::size_t capacity() const { return capacity_; }

 private:
  void release() {
    if (data_ != nullptr) resource_->deallocate(data_, capacity_ * sizeof(T), block_alignment);
    data_ = nullptr;
  }

  std::pmr::memory_resource* resource_;
  T* data_ = nullptr;
  std::size_t size_ = 0;
  std::size_t capacity_ = 0;
};

TURBOMAP_END_NAMESPACE

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A growable buffer of plain elements in the memory of a policy: results stay there until they are asked for on the
/// host. Growing discards the content; elements are not initialised.

#include <cstddef>
#include <memory_resource>

#include "memory.hpp"
#include "span.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The bytes of an array: everything that needs no element type, compiled once for all of them.
class array_bytes {
 protected:
  /// Empty; bytes will come from `resource`, which must outlive this.
  explicit array_bytes(std::pmr::memory_resource* resource) : resource_(resource) {}
  /// Takes the bytes and the resource of another, which is left empty.
  array_bytes(array_bytes&& other) noexcept : resource_(other.resource_) { exchange(other); }
  /// Exchanges bytes and resources.
  array_bytes& operator=(array_bytes&& other) noexcept {
    std::pmr::memory_resource* const resource = resource_;
    resource_ = other.resource_;
    other.resource_ = resource;
    exchange(other);
    return *this;
  }
  ~array_bytes() { release(); }

  /// In place of what was there.
  [[gnu::noinline]] void allocate(std::size_t bytes) {
    void* const grown = resource_->allocate(bytes, block_alignment);
    release();
    data_ = grown;
    room_ = bytes;
  }

  std::pmr::memory_resource* resource_;  ///< where the bytes come from; outlives this
  void* data_ = nullptr;                 ///< the first byte; null: none were allocated
  std::size_t size_ = 0;                 ///< elements
  std::size_t room_ = 0;                 ///< bytes

 private:
  [[gnu::noinline]] void release() {
    if (data_ != nullptr) resource_->deallocate(data_, room_, block_alignment);
    data_ = nullptr;
  }
  /// All but the resources.
  void exchange(array_bytes& other) noexcept {
    void* const data = data_;
    const std::size_t size = size_, room = room_;
    data_ = other.data_, size_ = other.size_, room_ = other.room_;
    other.data_ = data, other.size_ = size, other.room_ = room;
  }
};

/// Owns `size()` elements of `T` in `Memory` (host_memory or device_memory). Move-only. Capacity never shrinks, so a
/// buffer that is used again with the same size allocates nothing.
template <class T, class Memory>
class array : public array_bytes {
  static_assert(__is_trivially_copyable(T), "turbomap::array holds plain data only: it crosses the bus as bytes");

 public:
  /// Empty. \param resource  where elements come from; must outlive this
  explicit array(std::pmr::memory_resource* resource = default_resource(Memory{})) : array_bytes(resource) {}

  /// Makes room for `n` elements of unspecified value. Throws what the resource throws; the buffer is then unchanged.
  void resize_discard(std::size_t n) {
    if (n * sizeof(T) > room_) allocate((n + n / 4) * sizeof(T));
    size_ = n;
  }

  /// @{
  /// The first element, in `Memory`: to be read on the host only where is_host_accessible_v<Memory>.
  T* data() { return static_cast<T*>(data_); }
  const T* data() const { return static_cast<const T*>(data_); }
  /// @}
  /// Number of elements.
  std::size_t size() const { return size_; }
  /// Where elements come from.
  std::pmr::memory_resource* resource() const { return resource_; }
  /// Number of elements that fit without an allocation.
  std::size_t capacity() const { return room_ / sizeof(T); }
};

TURBOMAP_END_NAMESPACE

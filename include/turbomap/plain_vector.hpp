// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A growable list of plain data on the host. It does what std::vector does; what it does with memory is compiled once for
/// all element types, not once for each. The library has some sixty lists, so that halves what a user's unit compiles.

#include <cstddef>
#include <cstring>
#include <initializer_list>
#include <new>
#include <type_traits>
#include <vector>

namespace turbomap {

/// The bytes of a plain_vector: everything that needs no element type.
class plain_bytes {
 public:
  void clear() { end_ = begin_; }
  bool empty() const { return begin_ == end_; }

 protected:
  plain_bytes() = default;
  plain_bytes(const plain_bytes& other) { append_bytes(other.begin_, other.bytes()); }
  plain_bytes(plain_bytes&& other) noexcept { exchange(other); }
  plain_bytes& operator=(const plain_bytes& other) {
    if (this != &other) {
      end_ = begin_;
      append_bytes(other.begin_, other.bytes());
    }
    return *this;
  }
  plain_bytes& operator=(plain_bytes&& other) noexcept {
    plain_bytes taken;
    taken.exchange(other);
    exchange(taken);
    return *this;
  }
  ~plain_bytes() { ::operator delete(begin_); }

  /// Bytes of `n` elements. Throws std::bad_alloc when that is no number.
  static std::size_t bytes_of(std::size_t n, std::size_t element) {
    if (n > static_cast<std::size_t>(-1) / 2 / element) throw std::bad_alloc();
    return n * element;
  }
  std::size_t bytes() const { return static_cast<std::size_t>(end_ - begin_); }
  std::size_t room() const { return static_cast<std::size_t>(room_ - begin_); }

  /// Room for `n` bytes in all. Throws std::bad_alloc with nothing changed.
  void reserve_bytes(std::size_t n) {
    if (n <= room()) return;
    auto* const grown = static_cast<std::byte*>(::operator new(n));
    const std::size_t used = bytes();
    if (used != 0) std::memcpy(grown, begin_, used);
    ::operator delete(begin_);
    begin_ = grown;
    end_ = grown + used;
    room_ = grown + n;
  }
  /// `n` more bytes of unspecified value; the room at least doubles when it does not suffice.
  /// \returns the first of them
  std::byte* extend(std::size_t n) {
    if (n > static_cast<std::size_t>(room_ - end_)) reserve_bytes(bytes() + (n > bytes() ? n : bytes()));
    std::byte* const first = end_;
    end_ += n;
    return first;
  }
  /// `source` is outside of this list.
  void append_bytes(const void* source, std::size_t n) {
    if (n != 0) std::memcpy(extend(n), source, n);
  }
  void exchange(plain_bytes& other) noexcept {
    swap_pointers(begin_, other.begin_);
    swap_pointers(end_, other.end_);
    swap_pointers(room_, other.room_);
  }

  std::byte* begin_ = nullptr;
  std::byte* end_ = nullptr;
  std::byte* room_ = nullptr;

 private:
  static void swap_pointers(std::byte*& a, std::byte*& b) noexcept {
    std::byte* const other = a;
    a = b;
    b = other;
  }
};

// __is_trivially_copyable: what std::is_trivially_copyable_v asks, without instantiating five templates per type.

/// A list of `T`, trivially copyable. Members as those of std::vector, to which it converts; pointers are its iterators.
template <class T>
class plain_vector : public plain_bytes {
  static_assert(__is_trivially_copyable(T), "turbomap::plain_vector holds plain data only: it is copied as bytes");
  static_assert(alignof(T) <= __STDCPP_DEFAULT_NEW_ALIGNMENT__);

 public:
  using value_type = T;
  using iterator = T*;
  using const_iterator = const T*;

  plain_vector() = default;
  explicit plain_vector(std::size_t n) { resize(n); }
  plain_vector(std::size_t n, const T& value) { resize(n, value); }
  plain_vector(std::initializer_list<T> values) { append(values.begin(), values.size()); }
  plain_vector(const T* first, const T* last) { append(first, static_cast<std::size_t>(last - first)); }

  T* data() { return reinterpret_cast<T*>(begin_); }
  const T* data() const { return reinterpret_cast<const T*>(begin_); }
  std::size_t size() const { return bytes() / sizeof(T); }
  std::size_t capacity() const { return room() / sizeof(T); }
  T* begin() { return reinterpret_cast<T*>(begin_); }
  T* end() { return reinterpret_cast<T*>(end_); }
  const T* begin() const { return reinterpret_cast<const T*>(begin_); }
  const T* end() const { return reinterpret_cast<const T*>(end_); }
  T& operator[](std::size_t i) { return reinterpret_cast<T*>(begin_)[i]; }
  const T& operator[](std::size_t i) const { return reinterpret_cast<const T*>(begin_)[i]; }
  T& front() { return *reinterpret_cast<T*>(begin_); }
  const T& front() const { return *reinterpret_cast<const T*>(begin_); }
  T& back() { return reinterpret_cast<T*>(end_)[-1]; }
  const T& back() const { return reinterpret_cast<const T*>(end_)[-1]; }

  void reserve(std::size_t n) { reserve_bytes(bytes_of(n, sizeof(T))); }
  void push_back(const T& value) {
    const T copy = value;  // may be an element
    ::new (static_cast<void*>(extend(sizeof(T)))) T(copy);
  }
  void push_back() = delete;  // nvcc 13 misreads push_back({a, b}) where there is no other overload
  void pop_back() { end_ -= sizeof(T); }
  /// New elements are T().
  void resize(std::size_t n) {
    const std::size_t before = size();
    if (n <= before) {
      end_ = begin_ + n * sizeof(T);
    } else {
      T* const first = reinterpret_cast<T*>(extend(bytes_of(n - before, sizeof(T))));
      for (std::size_t i = 0; i < n - before; ++i) ::new (static_cast<void*>(first + i)) T();
    }
  }
  void resize(std::size_t n, const T& value) {
    const T copy = value;
    const std::size_t before = size();
    if (n <= before) {
      end_ = begin_ + n * sizeof(T);
    } else {
      T* const first = reinterpret_cast<T*>(extend(bytes_of(n - before, sizeof(T))));
      for (std::size_t i = 0; i < n - before; ++i) ::new (static_cast<void*>(first + i)) T(copy);
    }
  }
  void assign(std::size_t n, const T& value) {
    const T copy = value;
    clear();
    resize(n, copy);
  }
  /// The elements of [first, last), which are not of this list.
  void assign(const T* first, const T* last) {
    clear();
    append(first, static_cast<std::size_t>(last - first));
  }
  /// `n` elements from `first` on, which are not of this list.
  void append(const T* first, std::size_t n) { append_bytes(first, n * sizeof(T)); }
  void swap(plain_vector& other) noexcept { exchange(other); }
  operator std::vector<T>() const { return {begin(), end()}; }
};

/// The same elements as any list has.
template <class T, class List>
bool operator==(const plain_vector<T>& a, const List& b) {
  bool same = a.size() == b.size();
  for (std::size_t i = 0; same && i < a.size(); ++i) same = a[i] == b[i];
  return same;
}

/// A list of what a user names: their pointers and indices are plain data, their std::shared_ptr is not.
template <class T>
using list_of = std::conditional_t<__is_trivially_copyable(T), plain_vector<T>, std::vector<T>>;

}  // namespace turbomap

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
  /// No elements; the memory stays.
  void clear() { end_ = begin_; }
  /// Whether there are no elements.
  bool empty() const { return begin_ == end_; }

 protected:
  plain_bytes() = default;
  /// A copy of the bytes; no spare room.
  [[gnu::noinline]] plain_bytes(const plain_bytes& other) { append_bytes(other.begin_, other.bytes()); }
  /// Takes the bytes of another, which is left empty.
  plain_bytes(plain_bytes&& other) noexcept { exchange(other); }
  /// Copies; the memory is used again where it suffices.
  [[gnu::noinline]] plain_bytes& operator=(const plain_bytes& other) {
    if (this != &other) {
      end_ = begin_;
      append_bytes(other.begin_, other.bytes());
    }
    return *this;
  }
  /// Takes the bytes of another, which is left empty.
  [[gnu::noinline]] plain_bytes& operator=(plain_bytes&& other) noexcept {
    plain_bytes taken;
    taken.exchange(other);
    exchange(taken);
    return *this;
  }
  [[gnu::noinline]] ~plain_bytes() { ::operator delete(begin_); }

  /// Size of all elements in bytes.
  std::size_t bytes() const { return static_cast<std::size_t>(end_ - begin_); }
  /// Bytes that fit without an allocation.
  std::size_t room() const { return static_cast<std::size_t>(room_ - begin_); }

  // What allocates or copies is a call: its body is compiled once, not into each of the hundreds of places that append.

  /// Room for `n` elements in all. Throws std::bad_alloc, with nothing changed, also where the bytes of `n` are no number.
  [[gnu::noinline]] void reserve_elements(std::size_t n, std::size_t element) {
    if (n > static_cast<std::size_t>(-1) / 2 / element) throw std::bad_alloc();
    n *= element;
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
    if (n > static_cast<std::size_t>(room_ - end_)) reserve_elements(bytes() + (n > bytes() ? n : bytes()), 1);
    std::byte* const first = end_;
    end_ += n;
    return first;
  }
  /// `n` elements in all, new ones of unspecified value.
  /// \returns the first new one, or the end
  [[gnu::noinline]] std::byte* resize_elements(std::size_t n, std::size_t element) {
    const std::size_t before = bytes();
    if (n > static_cast<std::size_t>(-1) / 2 / element) throw std::bad_alloc();
    if (n * element > before) return extend(n * element - before);
    return end_ = begin_ + n * element;
  }
  /// `source` is outside of this list.
  [[gnu::noinline]] void append_bytes(const void* source, std::size_t n) {
    if (n != 0) std::memcpy(extend(n), source, n);
  }
  /// Room for `n` more bytes than there is.
  [[gnu::noinline, gnu::cold]] void grow(std::size_t n) {
    extend(n);
    end_ -= n;
  }
  /// Swaps the bytes of two lists.
  [[gnu::noinline]] void exchange(plain_bytes& other) noexcept {
    swap_pointers(begin_, other.begin_);
    swap_pointers(end_, other.end_);
    swap_pointers(room_, other.room_);
  }

  std::byte* begin_ = nullptr;  ///< the first byte; null: nothing was allocated
  std::byte* end_ = nullptr;    ///< behind the last byte in use
  std::byte* room_ = nullptr;   ///< behind the last byte of the memory

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
  /// @{
  /// As the member of this name of std::vector.
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

  void reserve(std::size_t n) { reserve_elements(n, sizeof(T)); }
  void push_back(const T& value) {
    // No call is given the address of the value: it stays in registers until it is written here.
    if (static_cast<std::size_t>(room_ - end_) < sizeof(T)) {
      const T copy = value;  // may be an element, which moves
      grow(sizeof(T));
      ::new (static_cast<void*>(end_)) T(copy);
    } else {
      ::new (static_cast<void*>(end_)) T(value);
    }
    end_ += sizeof(T);
  }
  void push_back() = delete;  // nvcc 13 misreads push_back({a, b}) where there is no other overload
  void pop_back() { end_ -= sizeof(T); }
  /// New elements are T().
  [[gnu::noinline]] void resize(std::size_t n) {
    auto* t = reinterpret_cast<T*>(resize_elements(n, sizeof(T)));
    for (T* const last = end(); t != last; ++t) ::new (static_cast<void*>(t)) T();
  }
  [[gnu::noinline]] void resize(std::size_t n, const T& value) {
    const T copy = value;  // may be an element
    auto* t = reinterpret_cast<T*>(resize_elements(n, sizeof(T)));
    for (T* const last = end(); t != last; ++t) ::new (static_cast<void*>(t)) T(copy);
  }
  [[gnu::noinline]] void assign(std::size_t n, const T& value) {
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
  /// @}
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

/// Room for `size` elements in all, and for half as many again where it is made: so the lists of several that grow together are
/// moved seldom. Throws std::bad_alloc.
template <class List>
void make_room(List& list, std::size_t size) {
  if (list.capacity() < size) list.reserve(size + size / 2);
}

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A non-owning view of contiguous elements; C++17 has no std::span.

#include <cstddef>
#include <type_traits>

#include "config.hpp"

namespace turbomap {

/// Pointer and length; where the elements live (host or device) is known from where the span came from.
template <class T>
class span {
  static void accept(T*);  // which pointers convert, without a dozen templates of the standard library per container

 public:
  /// Of the elements, without const.
  using value_type = std::remove_const_t<T>;

  constexpr span() = default;
  /// `size` elements from `data` on; nothing is checked.
  TURBOMAP_HD constexpr span(T* data, std::size_t size) : data_(data), size_(size) {}
  /// From any container with data() and size(); a span of const may be made of one of non-const.
  template <class Container, class = decltype(accept(static_cast<Container*>(nullptr)->data()))>
  constexpr span(Container& container) : data_(container.data()), size_(container.size()) {}
  /// From a const container, also a temporary one: the elements must live as long as the span is used.
  template <class Container, class = decltype(accept(static_cast<const Container*>(nullptr)->data()))>
  constexpr span(const Container& container) : data_(container.data()), size_(container.size()) {}

  /// The first element.
  TURBOMAP_HD constexpr T* data() const { return data_; }
  /// How many elements.
  TURBOMAP_HD constexpr std::size_t size() const { return size_; }
  /// True when there are none.
  TURBOMAP_HD constexpr bool empty() const { return size_ == 0; }
  /// \param i  below size(); not checked
  TURBOMAP_HD constexpr T& operator[](std::size_t i) const { return data_[i]; }
  /// The first element.
  TURBOMAP_HD constexpr T* begin() const { return data_; }
  /// Behind the last one.
  TURBOMAP_HD constexpr T* end() const { return data_ + size_; }
  /// `count` elements from number `offset` on; not checked.
  TURBOMAP_HD constexpr span subspan(std::size_t offset, std::size_t count) const { return {data_ + offset, count}; }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace turbomap

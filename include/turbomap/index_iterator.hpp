// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Counts 0, 1, 2... for Thrust's loops. thrust::counting_iterator does the same, and takes 0.5 s to compile.

#include <cstddef>
#include <iterator>

#include "config.hpp"

namespace turbomap {

namespace plain_detail {

/// A random access iterator over indices.
class index_iterator {
 public:
  using iterator_category = std::random_access_iterator_tag;
  using value_type = int;
  using difference_type = std::ptrdiff_t;
  using pointer = const int*;
  using reference = int;

  index_iterator() = default;
  explicit index_iterator(int at) : at_(at) {}

  int operator*() const { return at_; }
  int operator[](difference_type n) const { return at_ + static_cast<int>(n); }
  index_iterator& operator++() { return ++at_, *this; }
  index_iterator& operator--() { return --at_, *this; }
  index_iterator operator++(int) { return index_iterator(at_++); }
  index_iterator operator--(int) { return index_iterator(at_--); }
  index_iterator& operator+=(difference_type n) { return at_ += static_cast<int>(n), *this; }
  index_iterator& operator-=(difference_type n) { return at_ -= static_cast<int>(n), *this; }
  friend index_iterator operator+(index_iterator i, difference_type n) { return i += n; }
  friend index_iterator operator+(difference_type n, index_iterator i) { return i += n; }
  friend index_iterator operator-(index_iterator i, difference_type n) { return i -= n; }
  friend difference_type operator-(index_iterator a, index_iterator b) { return difference_type{a.at_} - b.at_; }
  friend bool operator==(index_iterator a, index_iterator b) { return a.at_ == b.at_; }
  friend bool operator!=(index_iterator a, index_iterator b) { return a.at_ != b.at_; }
  friend bool operator<(index_iterator a, index_iterator b) { return a.at_ < b.at_; }
  friend bool operator>(index_iterator a, index_iterator b) { return b < a; }
  friend bool operator<=(index_iterator a, index_iterator b) { return !(b < a); }
  friend bool operator>=(index_iterator a, index_iterator b) { return !(a < b); }

 private:
  int at_ = 0;
};

}  // namespace plain_detail

}  // namespace turbomap

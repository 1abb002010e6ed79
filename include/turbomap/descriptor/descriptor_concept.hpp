// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a descriptor type is. It is a description, never an object: descriptors themselves are rows of elements.
///
///     struct my_descriptor {
///       using element = float;                  // trivially copyable
///       static constexpr int elements = 64;     // of one descriptor
///       static constexpr int bytes = 256;       // elements * sizeof(element)
///       using distance_type = float;            // arithmetic; smaller is more alike
///       static constexpr distance_type worst = std::numeric_limits<float>::max();  // no distance is larger
///       // Optional, for integers from 0: no distance between two descriptors is larger. Up to 65,000 it makes medoids faster.
///       static constexpr distance_type greatest = 256;
///       static TURBOMAP_HD distance_type distance(const element* a, const element* b);
///       // Optional: a bound that costs less and is never more than the distance. Searches on the host ask it first.
///       static TURBOMAP_HD distance_type at_least(const element* a, const element* b);
///       // Optional: distance() gives the square of a distance. Ratios of options are of distances.
///       static constexpr bool squared = true;
///     };
///
/// The distance is symmetric, and must not depend on the compiler if results are to be equal on all execution policies:
/// whole numbers, or a fixed order of explicitly rounded operations (see descriptor/real.hpp).

#include <type_traits>
#include <utility>

#include "../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class D, class = void>
struct has_element : std::false_type {};
template <class D>
struct has_element<D, std::void_t<typename D::element>> : std::is_trivially_copyable<typename D::element> {};

template <class D, class = void>
struct has_elements : std::false_type {};
template <class D>
struct has_elements<D, std::void_t<typename D::element, decltype(D::elements), decltype(D::bytes)>>
    : std::bool_constant<(D::elements > 0) && D::bytes == D::elements* static_cast<int>(sizeof(typename D::element))> {
};

template <class D, class = void>
struct has_distance_type : std::false_type {};
template <class D>
struct has_distance_type<D, std::void_t<typename D::distance_type, decltype(D::worst)>>
    : std::is_arithmetic<typename D::distance_type> {};

template <class D, class = void>
struct has_distance : std::false_type {};
template <class D>
struct has_distance<
    D, std::void_t<typename D::distance_type, decltype(D::distance(std::declval<const typename D::element*>(),
                                                                   std::declval<const typename D::element*>()))>>
    : std::is_same<typename D::distance_type, decltype(D::distance(std::declval<const typename D::element*>(),
                                                                   std::declval<const typename D::element*>()))> {};

template <class D, class = void>
struct has_at_least : std::false_type {};
template <class D>
struct has_at_least<D, std::void_t<decltype(D::at_least(std::declval<const typename D::element*>(),
                                                        std::declval<const typename D::element*>()))>>
    : std::true_type {};
template <class D>
inline constexpr bool has_at_least_v = has_at_least<D>::value;

template <class D, class = void>
struct is_squared : std::false_type {};
template <class D>
struct is_squared<D, std::enable_if_t<D::squared>> : std::true_type {};
/// Of what distance() gives, by a ratio of distances.
template <class D>
TURBOMAP_HD constexpr double ratio_of(double ratio) {
  return is_squared<D>::value ? ratio * ratio : ratio;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

namespace turbomap {

/// True when D is a descriptor type.
template <class D>
inline constexpr bool is_descriptor_v = detail::has_element<D>::value&& detail::has_elements<D>::value&&
    detail::has_distance_type<D>::value&& detail::has_distance<D>::value;

/// Explains in words what a type lacks to be a descriptor: `static_assert(require_descriptor<D>());`.
template <class D>
constexpr bool require_descriptor() {
  static_assert(
      detail::has_element<D>::value,
      "turbomap: a descriptor type needs `using element = ...;`, trivially copyable: rows of it are copied as bytes");
  static_assert(detail::has_elements<D>::value,
                "turbomap: a descriptor type needs `static constexpr int elements` > 0 and "
                "`static constexpr int bytes` = elements * sizeof(element)");
  static_assert(detail::has_distance_type<D>::value,
                "turbomap: a descriptor type needs an arithmetic `using distance_type = ...;` and "
                "`static constexpr distance_type worst`, larger than any distance");
  static_assert(detail::has_distance<D>::value,
                "turbomap: a descriptor type needs `static TURBOMAP_HD distance_type distance(const element* a, "
                "const element* b)`; see descriptor/descriptor_concept.hpp");
  return is_descriptor_v<D>;
}

}  // namespace turbomap

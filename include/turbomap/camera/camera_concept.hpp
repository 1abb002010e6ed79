// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a camera model is, and how the library asks for its optional parts.
///
/// A model is a trivially copyable struct, passed to kernels by value:
///
///     struct my_camera {
///       using scalar = float;                                                                        // of its parameters
///       template <class S> TURBOMAP_HD bool project(const vec3<S>& point, vec2<S>& pixel) const;     // required
///       template <class S> TURBOMAP_HD bool unproject(const vec2<S>& pixel, vec3<S>& bearing) const; // required
///       template <class S> TURBOMAP_HD bool jacobian(const vec3<S>& point, mat23<S>& derivative) const; // optional
///       template <class S>                                                                           // both of them, to the bit:
///       TURBOMAP_HD bool project_with_jacobian(const vec3<S>& point, vec2<S>& pixel,                 // optional, where they
///                                              mat23<S>& derivative) const;                          // share their work
///       TURBOMAP_HD bool as_pinhole(pinhole<double>& equivalent) const;                              // optional
///       double min_pixels_per_radian(const image_bounds& bounds) const;                              // optional, host
///       void validate() const;                                                                       // optional, host
///     };
///
/// Points and rays are in camera coordinates (x right, y down, z along the optical axis), rays have unit length, pixels
/// are (u right, v down). Each function returns false, and leaves its result alone, where the model is not defined. S
/// is float, double, strict<double> (same bits on host and device) or a dual number: use S's arithmetic and, after
/// `using std::sqrt;` and so on, sqrt, atan2, sin, cos; convert parameters by S(fx).

#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../types.hpp"
#include "pinhole.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class C, class S>
using project_result =
    decltype(std::declval<const C&>().project(std::declval<const vec3<S>&>(), std::declval<vec2<S>&>()));
template <class C, class S>
using unproject_result =
    decltype(std::declval<const C&>().unproject(std::declval<const vec2<S>&>(), std::declval<vec3<S>&>()));

template <class C, class = void>
struct has_scalar : std::false_type {};
template <class C>
struct has_scalar<C, std::void_t<typename C::scalar>> : std::is_floating_point<typename C::scalar> {};
template <class C, class S, class = void>
struct has_project : std::false_type {};
template <class C, class S>
struct has_project<C, S, std::void_t<project_result<C, S>>> : std::is_same<project_result<C, S>, bool> {};
template <class C, class S, class = void>
struct has_unproject : std::false_type {};
template <class C, class S>
struct has_unproject<C, S, std::void_t<unproject_result<C, S>>> : std::is_same<unproject_result<C, S>, bool> {};

template <class C, class = void>
struct has_jacobian : std::false_type {};
template <class C>
struct has_jacobian<C, std::void_t<decltype(std::declval<const C&>().jacobian(
                           std::declval<const vec3<double>&>(), std::declval<mat23<double>&>()))>> : std::true_type {};
template <class C, class = void>
struct has_project_with_jacobian : std::false_type {};
template <class C>
struct has_project_with_jacobian<
    C, std::void_t<decltype(std::declval<const C&>().project_with_jacobian(
           std::declval<const vec3<double>&>(), std::declval<vec2<double>&>(), std::declval<mat23<double>&>()))>>
    : std::true_type {};
template <class C, class = void>
struct has_as_pinhole : std::false_type {};
template <class C>
struct has_as_pinhole<C, std::void_t<decltype(std::declval<const C&>().as_pinhole(std::declval<pinhole<double>&>()))>>
    : std::true_type {};
template <class C, class = void>
struct has_min_pixels_per_radian : std::false_type {};
template <class C>
struct has_min_pixels_per_radian<
    C, std::void_t<decltype(std::declval<const C&>().min_pixels_per_radian(std::declval<const image_bounds&>()))>>
    : std::true_type {};
template <class C, class = void>
struct has_validate : std::false_type {};
template <class C>
struct has_validate<C, std::void_t<decltype(std::declval<const C&>().validate())>> : std::true_type {};

}  // namespace detail

TURBOMAP_END_NAMESPACE

namespace turbomap {

/// True when C is a camera model: the required members, for double and strict<double>.
template <class C>
inline constexpr bool is_camera_v = std::is_trivially_copyable_v<C>&& detail::has_scalar<C>::value&&
    detail::has_project<C, double>::value&& detail::has_project<C, strict<double>>::value&&
        detail::has_unproject<C, double>::value&& detail::has_unproject<C, strict<double>>::value;

/// True when the model brings its own derivative; without it, dual numbers go through project().
template <class C>
inline constexpr bool has_jacobian_v = detail::has_jacobian<C>::value;
/// True when it computes a pixel and its derivative in one go.
template <class C>
inline constexpr bool has_project_with_jacobian_v = detail::has_project_with_jacobian<C>::value;

/// Explains in words what a type lacks to be a camera model: `static_assert(require_camera<C>());`.
template <class C>
constexpr bool require_camera() {
  static_assert(
      std::is_trivially_copyable_v<C>,
      "turbomap: a camera model must be trivially copyable (plain scalars): it is copied to the device as bytes");
  static_assert(detail::has_scalar<C>::value,
                "turbomap: a camera model needs `using scalar = float;` or double, the type of its parameters");
  static_assert(detail::has_project<C, double>::value && detail::has_project<C, strict<double>>::value,
                "turbomap: a camera model needs `template <class S> TURBOMAP_HD bool project(const vec3<S>& point, "
                "vec2<S>& pixel) const`; see camera/camera_concept.hpp");
  static_assert(detail::has_unproject<C, double>::value && detail::has_unproject<C, strict<double>>::value,
                "turbomap: a camera model needs `template <class S> TURBOMAP_HD bool unproject(const vec2<S>& pixel, "
                "vec3<S>& bearing) const`; see camera/camera_concept.hpp");
  return is_camera_v<C>;
}

/// True, with the pinhole, when the camera's image is rectilinear (straight lines stay straight): the epipolar curves
/// are lines then. False when the model does not say.
template <class C>
TURBOMAP_HD bool as_pinhole(const C& camera, pinhole<double>& equivalent) {
  if constexpr (detail::has_as_pinhole<C>::value)
    return camera.as_pinhole(equivalent);
  else
    return false;
}

/// A lower bound, over the image and 16 px around it, of the distance in px between two pixels per radian between their
/// rays. 0, no bound, when the model does not say: searches then look at every candidate.
template <class C>
double min_pixels_per_radian(const C& camera, const image_bounds& bounds) {
  if constexpr (detail::has_min_pixels_per_radian<C>::value)
    return camera.min_pixels_per_radian(bounds);
  else
    return 0;
}

/// Throws std::invalid_argument when the model checks its parameters and finds one that no camera can have.
template <class C>
void validate_camera(const C& camera) {
  if constexpr (detail::has_validate<C>::value) camera.validate();
}

}  // namespace turbomap

// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How the library reads the user's keyframes, whatever they are: a small struct that they specialise once.
///
/// This is the interface, as code. A specialisation has static members only; they run on the host, never in a kernel:
///
///     template <>
///     struct turbomap::keyframe_traits<my::KeyFrame> {
///       using descriptor = turbomap::binary_descriptor<256>;         // what a descriptor is: see descriptor/
///       using rig = turbomap::stereo_rig<turbomap::pinhole<float>>;  // or std::vector<rig_camera<Camera>>, ...: has
///                                                                    // size() and [i], which is a rig_camera<Camera>
///       static rig cameras(const my::KeyFrame&);                             // by value or const reference
///       static std::size_t keypoint_count(const my::KeyFrame&);              // of all cameras together
///       static turbomap::keypoint keypoint(const my::KeyFrame&, std::size_t i);
///       static const std::uint8_t* descriptor_data(const my::KeyFrame&, std::size_t i);  // const descriptor::element*
///
///       // Optional:
///       static turbomap::image_bounds bounds(const my::KeyFrame&);       // else what the keypoints span
///       static std::unique_lock<std::mutex> guard(const my::KeyFrame&);  // held while the keyframe is read
///     };
///
/// See docs/traits.md for complete examples, pointer-rich and flat.

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "config.hpp"
#include "types.hpp"

namespace turbomap {

/// Specialise this for your keyframe type: see above.
template <class KeyFrame>
struct keyframe_traits {
  using turbomap_not_specialised = void;
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Whether `Member<K, T>` is well formed: keyframe type K, its traits T.
template <template <class, class> class Member, class K, class T, class = void>
struct has_member : std::false_type {};
template <template <class, class> class Member, class K, class T>
struct has_member<Member, K, T, std::void_t<Member<K, T>>> : std::true_type {};
template <class From, class To>
using if_converts = std::enable_if_t<std::is_convertible_v<From, To>>;

template <class K, class T>
using not_specialised_member = typename T::turbomap_not_specialised;
template <class K, class T>
using descriptor_member = std::void_t<typename T::descriptor::element, decltype(T::descriptor::elements)>;
template <class K, class T>
using rig_member = std::void_t<decltype(std::declval<const typename T::rig&>().size()),
                               decltype(std::declval<const typename T::rig&>()[0].T_camera_body)>;
template <class K, class T>
using cameras_member = if_converts<decltype(T::cameras(std::declval<const K&>())), const typename T::rig&>;
template <class K, class T>
using keypoint_count_member = if_converts<decltype(T::keypoint_count(std::declval<const K&>())), std::size_t>;
template <class K, class T>
using keypoint_member = if_converts<decltype(T::keypoint(std::declval<const K&>(), std::size_t{})), turbomap::keypoint>;
template <class K, class T>
using descriptor_data_member = if_converts<decltype(T::descriptor_data(std::declval<const K&>(), std::size_t{})),
                                           const typename T::descriptor::element*>;
template <class K, class T>
using bounds_member = if_converts<decltype(T::bounds(std::declval<const K&>())), image_bounds>;
template <class K, class T>
using guard_member = decltype(T::guard(std::declval<const K&>()));

template <class K, class T, template <class, class> class... Members>
inline constexpr bool has_members_v = (has_member<Members, K, T>::value && ...);

}  // namespace detail

/// True when keyframe_traits<KeyFrame> has every required member.
template <class KeyFrame>
inline constexpr bool has_keyframe_traits_v =
    detail::has_members_v<KeyFrame, keyframe_traits<KeyFrame>, detail::descriptor_member, detail::rig_member,
                          detail::cameras_member, detail::keypoint_count_member, detail::keypoint_member,
                          detail::descriptor_data_member>;

/// Explains in words what keyframe_traits<KeyFrame> lacks: `static_assert(require_keyframe_traits<KeyFrame>());`.
template <class KeyFrame>
constexpr bool require_keyframe_traits() {
  using K = KeyFrame;
  using T = keyframe_traits<KeyFrame>;
  constexpr bool there = !detail::has_member<detail::not_specialised_member, K, T>::value;  // says one thing at a time
  static_assert(there, "turbomap: specialise turbomap::keyframe_traits for your keyframe type; see docs/traits.md");
  static_assert(!there || detail::has_member<detail::descriptor_member, K, T>::value,
                "turbomap: keyframe_traits needs `using descriptor = ...`, with `element` and `elements`, e.g. "
                "binary_descriptor<256>; see docs/traits.md");
  static_assert(
      !there || detail::has_member<detail::rig_member, K, T>::value,
      "turbomap: keyframe_traits needs `using rig = ...`, with size() and operator[] giving rig_camera<Camera>, e.g. "
      "mono_rig<pinhole<float>>; see docs/traits.md");
  static_assert(!there || detail::has_member<detail::cameras_member, K, T>::value,
                "turbomap: keyframe_traits needs `static rig cameras(const KeyFrame&)`; see docs/traits.md");
  static_assert(
      !there || detail::has_member<detail::keypoint_count_member, K, T>::value,
      "turbomap: keyframe_traits needs `static std::size_t keypoint_count(const KeyFrame&)`; see docs/traits.md");
  static_assert(
      !there || detail::has_member<detail::keypoint_member, K, T>::value,
      "turbomap: keyframe_traits needs `static turbomap::keypoint keypoint(const KeyFrame&, std::size_t)`; see "
      "docs/traits.md");
  static_assert(!there || detail::has_member<detail::descriptor_data_member, K, T>::value,
                "turbomap: keyframe_traits needs `static const descriptor::element* descriptor_data(const KeyFrame&, "
                "std::size_t)`; see docs/traits.md");
  return has_keyframe_traits_v<KeyFrame>;
}

TURBOMAP_END_NAMESPACE

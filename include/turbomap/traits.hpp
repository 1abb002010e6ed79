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
///       static const std::uint8_t* descriptor_data(const my::KeyFrame&, std::size_t i);  // const descriptor::element*, or an
///                                                        // object with data(), e.g. std::array, by value or reference
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
  using turbomap_not_specialised = void;  ///< only here, so that a missing specialisation is found.
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

/// What a member should give where only its arguments matter.
struct anything {};
template <class Got, class Wanted>
struct fits {  // has no base class, which g++ would name in its place
  static constexpr bool value = std::is_convertible_v<Got, Wanted>;
};
template <class Got>
struct fits<Got, anything> {
  static constexpr bool value = true;
};
/// No function of that name takes these arguments, or there is none of that name.
struct no_such_function {
  static constexpr bool value = false;
};

/// fits<...> of a member, or no_such_function.
template <template <class, class> class Member, class M, class T, class = void>
struct fit_of_member {
  using type = no_such_function;
};
template <template <class, class> class Member, class M, class T>
struct fit_of_member<Member, M, T, std::void_t<Member<M, T>>> {
  using type = Member<M, T>;
};

template <class M, class Given>
using has_size = if_converts<decltype(std::declval<const Given&>().size()), std::size_t>;
/// Where the elements of a descriptor are that traits gave: at a pointer, or in an object that has data(), by value too; null where
/// that has too few. The object must live as long as they are read.
template <class Descriptor, class Given>
const typename Descriptor::element* elements_of(const Given& given) {
  if constexpr (std::is_convertible_v<const Given&, const typename Descriptor::element*>) {
    return given;
  } else {
    if constexpr (has_member<has_size, void, Given>::value)
      if (static_cast<std::size_t>(given.size()) < static_cast<std::size_t>(Descriptor::elements)) return nullptr;
    return given.data();
  }
}
/// The elements of one descriptor: a pointer, or an object that has data(), with enough elements where its type tells.
template <class Element, std::size_t Elements>
struct elements_at {};
template <class Descriptor>
using elements_in = elements_at<typename Descriptor::element, static_cast<std::size_t>(Descriptor::elements)>;
template <class Given, class = void>
struct fixed_size {
  static constexpr std::size_t value = static_cast<std::size_t>(-1);  // known at run time
};
template <class Given>
struct fixed_size<Given, std::void_t<decltype(std::tuple_size<Given>::value)>> : std::tuple_size<Given> {};
template <class Element, class Given>
using has_data = if_converts<decltype(std::declval<const Given&>().data()), const Element*>;
template <class Got, class Element, std::size_t Elements>
struct fits<Got, elements_at<Element, Elements>> {
  static constexpr bool value =
      std::is_convertible_v<Got, const Element*> ||
      (has_member<has_data, Element, std::decay_t<Got>>::value && fixed_size<std::decay_t<Got>>::value >= Elements);
};

/// Whether class T has a member of this name, whatever it takes. `Name<void, X>` is decltype(&X::name) and Names a class with that
/// member: a class that inherits from both cannot tell which is meant. False for a final class, which cannot be asked.
template <class T, class Names>
struct named_twice : T, Names {};
template <template <class, class> class Name, class T, class Names>
constexpr bool has_name() {
  if constexpr (std::is_final_v<T>)
    return false;
  else
    return !has_member<Name, void, named_twice<T, Names>>::value;
}

/// A lock is an object that is held while it lives: not nothing, and not the mutex itself.
template <class Lock>
using if_lock = std::enable_if_t<std::is_class_v<Lock>>;
struct guard_names {
  int guard, bounds;
};
template <class M, class T>
using guard_name = decltype(&T::guard);
template <class M, class T>
using bounds_name = decltype(&T::bounds);

template <class K, class T>
using not_specialised_member = typename T::turbomap_not_specialised;
template <class K, class T>
using descriptor_type_member = std::void_t<typename T::descriptor::element, decltype(T::descriptor::elements)>;
template <class K, class T>
using rig_member = std::void_t<decltype(std::declval<const typename T::rig&>().size()),
                               decltype(std::declval<const typename T::rig&>()[0].T_camera_body)>;
template <class K, class T>
using cameras_member = fits<decltype(T::cameras(std::declval<const K&>())), const typename T::rig&>;
template <class K, class T>
using keypoint_count_member = fits<decltype(T::keypoint_count(std::declval<const K&>())), std::size_t>;
template <class K, class T>
using keypoint_member = fits<decltype(T::keypoint(std::declval<const K&>(), std::size_t{})), turbomap::keypoint>;
template <class K, class T>
using descriptor_data_member =
    fits<decltype(T::descriptor_data(std::declval<const K&>(), std::size_t{})), elements_in<typename T::descriptor>>;
template <class K, class T>
using bounds_member = if_converts<decltype(T::bounds(std::declval<const K&>())), image_bounds>;
template <class K, class T>
using guard_member = if_lock<decltype(T::guard(std::declval<const K&>()))>;
template <class K, class T>
using near_keyframe_lock = decltype(T::lock(std::declval<const K&>()));
template <class K, class T>
using near_keyframe_get_guard = decltype(T::get_guard(std::declval<const K&>()));

template <class K, template <class, class> class Member>
inline constexpr bool keyframe_has_v = has_member<Member, K, keyframe_traits<K>>::value;
template <class K, template <class, class> class Member>
using keyframe_fit = typename fit_of_member<Member, K, keyframe_traits<K>>::type;

}  // namespace detail

/// True when keyframe_traits<KeyFrame> has every required member.
template <class KeyFrame>
inline constexpr bool has_keyframe_traits_v =
    detail::keyframe_has_v<KeyFrame, detail::descriptor_type_member>&& detail::keyframe_has_v<
        KeyFrame, detail::rig_member>&& detail::keyframe_fit<KeyFrame, detail::cameras_member>::value&&
        detail::keyframe_fit<KeyFrame, detail::keypoint_count_member>::value&&
            detail::keyframe_fit<KeyFrame, detail::keypoint_member>::value&&
                detail::keyframe_fit<KeyFrame, detail::descriptor_data_member>::value;

/// Explains in words what is wrong with keyframe_traits<KeyFrame>: `static_assert(require_keyframe_traits<KeyFrame>());`. The
/// compiler prints what it found beside it: `fits<what the member gives, what it should give>`, or `no_such_function`.
template <class KeyFrame>
constexpr bool require_keyframe_traits() {
  using K = KeyFrame;
  using T = keyframe_traits<KeyFrame>;
  constexpr bool specialised = !detail::keyframe_has_v<K, detail::not_specialised_member>;  // says one thing at a time
  static_assert(specialised,
                "turbomap: specialise turbomap::keyframe_traits for your keyframe type; see docs/traits.md");
  constexpr bool described = detail::keyframe_has_v<K, detail::descriptor_type_member>;
  static_assert(!specialised || described,
                "turbomap: keyframe_traits needs `using descriptor = ...`, with `element` and `elements`, e.g. "
                "binary_descriptor<256>; see docs/traits.md");
  constexpr bool has_rig = detail::keyframe_has_v<K, detail::rig_member>;
  static_assert(
      !specialised || has_rig,
      "turbomap: keyframe_traits needs `using rig = ...`, with size() and operator[] giving rig_camera<Camera>, e.g. "
      "mono_rig<pinhole<float>>; see docs/traits.md");
  if constexpr (described && has_rig) {
    static_assert(detail::keyframe_fit<K, detail::cameras_member>::value,
                  "turbomap: keyframe_traits needs `static rig cameras(const KeyFrame&)`; see docs/traits.md");
    static_assert(
        detail::keyframe_fit<K, detail::keypoint_count_member>::value,
        "turbomap: keyframe_traits needs `static std::size_t keypoint_count(const KeyFrame&)`; see docs/traits.md");
    static_assert(
        detail::keyframe_fit<K, detail::keypoint_member>::value,
        "turbomap: keyframe_traits needs `static turbomap::keypoint keypoint(const KeyFrame&, std::size_t)`; see "
        "docs/traits.md");
    static_assert(detail::keyframe_fit<K, detail::descriptor_data_member>::value,
                  "turbomap: keyframe_traits needs `static const descriptor::element* descriptor_data(const KeyFrame&, "
                  "std::size_t)`; see docs/traits.md");
    static_assert(
        detail::keyframe_has_v<K, detail::bounds_member> ||
            !detail::has_name<detail::bounds_name, T, detail::guard_names>(),
        "turbomap: keyframe_traits::bounds must be `static image_bounds bounds(const KeyFrame&)`; see docs/traits.md");
    constexpr bool guarded = detail::keyframe_has_v<K, detail::guard_member>;
    static_assert(
        guarded || !detail::has_name<detail::guard_name, T, detail::guard_names>(),
        "turbomap: keyframe_traits::guard must be `static Lock guard(const KeyFrame&)`, and return by value what "
        "holds the lock while it lives, e.g. std::unique_lock<std::mutex>; see docs/traits.md");
    static_assert(
        guarded || !(detail::keyframe_has_v<K, detail::near_keyframe_lock> ||
                     detail::keyframe_has_v<K, detail::near_keyframe_get_guard>),
        "turbomap: keyframe_traits has no `guard`, but a function of a similar name (lock, get_guard): rename it; "
        "see docs/traits.md");
  }
  return true;  // an error has been said
}

TURBOMAP_END_NAMESPACE

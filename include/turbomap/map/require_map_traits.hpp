// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether a specialisation of map_traits is right, member by member: `static_assert(require_map_traits<my::Map>());`. Where it is
/// not, the error names the member as it should be; beside it the compiler prints what it found there: fits<what it gives, what
/// it should give>, or no_such_function. An optional member that cannot be called, and a function whose name looks like that of
/// an optional member, are errors too: else a map would be used without its guard, and nobody would know. A part of map_traits.hpp.

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../traits.hpp"
#include "../types.hpp"
#include "map_members.hpp"
#include "optional_traits.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

struct observation_probe {
  template <class Keyframe>
  void operator()(Keyframe, std::size_t) const {}
};

// What a member should give, where it is not one type.
struct three_numbers_xyz {};
struct quaternion_and_translation {};

template <class M, class T>
using xyz_of = std::void_t<decltype(std::declval<T>().x), decltype(std::declval<T>().y), decltype(std::declval<T>().z)>;
template <class M, class T>
using transform_of =
    std::void_t<decltype(std::declval<T>().qx), decltype(std::declval<T>().qw), decltype(std::declval<T>().tz)>;

template <class Got>
struct fits<Got, three_numbers_xyz> {
  static constexpr bool value = has_member<xyz_of, void, Got>::value;
};
template <class Got>
struct fits<Got, quaternion_and_translation> {
  static constexpr bool value = has_member<transform_of, void, Got>::value;
};
template <class Map, template <class, class> class Member>
using fit = typename fit_of_member<Member, Map, map_traits<Map>>::type;

template <class M, class T>
using equal_names = std::void_t<
    if_converts<decltype(std::declval<const keyframe_of<T>&>() == std::declval<const keyframe_of<T>&>()), bool>,
    if_converts<decltype(std::declval<const point_of<T>&>() == std::declval<const point_of<T>&>()), bool>>;
template <class M, class T>
using map_names = std::void_t<typename T::keyframe, typename T::point, typename T::descriptor, typename T::camera>;
template <class M, class T>
using needed_id_of_keyframe = fits<decltype(T::id(read_map<M>(), a_keyframe<T>())), std::uint64_t>;
template <class M, class T>
using needed_alive_of_keyframe = fits<decltype(T::alive(read_map<M>(), a_keyframe<T>())), bool>;
template <class M, class T>
using needed_pose = fits<decltype(T::pose(read_map<M>(), a_keyframe<T>())), quaternion_and_translation>;
template <class M, class T>
using needed_point_at = fits<decltype(T::point_at(read_map<M>(), a_keyframe<T>(), std::size_t{})), point_of<T>>;
template <class M, class T>
using needed_id_of_point = fits<decltype(T::id(read_map<M>(), a_point<T>())), std::uint64_t>;
template <class M, class T>
using needed_alive_of_point = fits<decltype(T::alive(read_map<M>(), a_point<T>())), bool>;
template <class M, class T>
using needed_replacement = fits<decltype(T::replacement(read_map<M>(), a_point<T>())), point_of<T>>;
template <class M, class T>
using needed_position = fits<decltype(T::position(read_map<M>(), a_point<T>())), three_numbers_xyz>;
template <class M, class T>
using needed_normal = fits<decltype(T::normal(read_map<M>(), a_point<T>())), three_numbers_xyz>;
template <class M, class T>
using needed_min_distance = fits<decltype(T::min_distance(read_map<M>(), a_point<T>())), float>;
template <class M, class T>
using needed_max_distance = fits<decltype(T::max_distance(read_map<M>(), a_point<T>())), float>;
template <class M, class T>
using needed_descriptor_data =
    fits<decltype(T::descriptor_data(read_map<M>(), a_point<T>())), elements_in<typename T::descriptor>>;
template <class M, class T>
using needed_reference = fits<decltype(T::reference(read_map<M>(), a_point<T>())), keyframe_of<T>>;
template <class M, class T>
using needed_for_each_observation =
    fits<decltype(T::for_each_observation(read_map<M>(), a_point<T>(), observation_probe{})), anything>;
template <class M, class T>
using needed_add_point =
    fits<decltype(T::add_point(write_map<M>(), std::declval<const vec3<double>&>(), a_keyframe<T>())), point_of<T>>;
template <class M, class T>
using needed_set_appearance =
    fits<decltype(T::set_appearance(write_map<M>(), a_point<T>(), std::declval<const vec3<float>&>(), float{}, float{},
                                    std::declval<const typename T::descriptor::element*>())),
         anything>;
template <class M, class T>
using needed_set_reference = fits<decltype(T::set_reference(write_map<M>(), a_point<T>(), a_keyframe<T>())), anything>;
template <class M, class T>
using needed_set_point =
    fits<decltype(T::set_point(write_map<M>(), a_keyframe<T>(), std::size_t{}, a_point<T>())), anything>;
template <class M, class T>
using needed_add_observation =
    fits<decltype(T::add_observation(write_map<M>(), a_point<T>(), a_keyframe<T>(), std::size_t{})), anything>;
template <class M, class T>
using needed_erase_observation =
    fits<decltype(T::erase_observation(write_map<M>(), a_point<T>(), a_keyframe<T>(), std::size_t{})), anything>;
template <class M, class T>
using needed_retire = fits<decltype(T::retire(write_map<M>(), a_point<T>(), a_point<T>())), anything>;
template <class M, class T>
using needed_erase_keyframe = fits<decltype(T::erase_keyframe(write_map<M>(), a_keyframe<T>())), anything>;

template <class KeyFrame>
inline constexpr bool has_keyframe_specialisation_v =
    !std::is_void_v<KeyFrame> && !keyframe_has_v<KeyFrame, not_specialised_member>;
template <class Map, template <class, class> class... Members>
inline constexpr bool fit_all_v = (fit<Map, Members>::value && ...);

}  // namespace detail

/// True when map_traits<Map> has every required member.
template <class Map>
inline constexpr bool has_map_traits_v =
    detail::map_has_v<Map, detail::map_names>&& detail::map_has_v<Map, detail::equal_names>&&
        detail::map_has_v<Map, detail::descriptor_type_member>&& detail::describes_keypoints_v<Map>&& detail::fit_all_v<
            Map, detail::needed_id_of_keyframe, detail::needed_alive_of_keyframe, detail::needed_pose,
            detail::needed_point_at, detail::needed_id_of_point, detail::needed_alive_of_point,
            detail::needed_replacement, detail::needed_position, detail::needed_normal, detail::needed_min_distance,
            detail::needed_max_distance, detail::needed_descriptor_data, detail::needed_reference,
            detail::needed_for_each_observation, detail::needed_add_point, detail::needed_set_appearance,
            detail::needed_set_reference, detail::needed_set_point, detail::needed_add_observation,
            detail::needed_erase_observation, detail::needed_retire, detail::needed_erase_keyframe>;

namespace detail {

/// The name of a keyframe; where there is none, a type that draws no second error.
template <class Map, bool = map_has_v<Map, map_names>>
struct named_keyframe {
  using type = typename map_traits<Map>::keyframe;
};
template <class Map>
struct named_keyframe<Map, false> {
  using type = no_such_function;
};
template <class Map>
using named_keyframe_t = typename named_keyframe<Map>::type;

}  // namespace detail

#define TURBOMAP_NEEDS(member, signature)                                                         \
  static_assert(detail::fit<Map, detail::member>::value, "turbomap: map_traits needs `" signature \
                                                         "`; see "                                \
                                                         "docs/map.md")
/// Explains in words what is wrong with map_traits<Map>: `static_assert(require_map_traits<Map>());`.
template <class Map>
constexpr bool require_map_traits() {
  constexpr bool specialised = !detail::map_has_v<Map, detail::not_specialised_member>;  // says one thing at a time
  constexpr bool changeable = specialised || !std::is_const_v<Map>;
  static_assert(changeable,
                "turbomap: the map is const: the library changes it, so give it as `Map&`; see docs/map.md");
  static_assert(specialised || !changeable,
                "turbomap: specialise turbomap::map_traits for your map type; see docs/map.md");
  constexpr bool named = detail::map_has_v<Map, detail::map_names>;
  static_assert(
      !specialised || named,
      "turbomap: map_traits needs `using keyframe`, `using point`, `using descriptor` and `using camera`; see "
      "docs/map.md");
  if constexpr (named) {
    static_assert(detail::map_has_v<Map, detail::equal_names>,
                  "turbomap: the names `keyframe` and `point` of map_traits need `operator==`; see docs/map.md");
    constexpr bool described = detail::map_has_v<Map, detail::descriptor_type_member>;
    static_assert(
        described,
        "turbomap: map_traits::descriptor must have `element` and `elements`, e.g. binary_descriptor<256>; see "
        "docs/map.md");
    if constexpr (described) {
      TURBOMAP_NEEDS(needed_id_of_keyframe, "static std::uint64_t id(const Map&, keyframe)");
      TURBOMAP_NEEDS(needed_alive_of_keyframe, "static bool alive(const Map&, keyframe)");
      TURBOMAP_NEEDS(needed_pose, "static rigid_transform<double> pose(const Map&, keyframe)");
      TURBOMAP_NEEDS(needed_point_at, "static point point_at(const Map&, keyframe, std::size_t)");
      TURBOMAP_NEEDS(needed_id_of_point, "static std::uint64_t id(const Map&, point)");
      TURBOMAP_NEEDS(needed_alive_of_point, "static bool alive(const Map&, point)");
      TURBOMAP_NEEDS(needed_replacement, "static point replacement(const Map&, point)");
      TURBOMAP_NEEDS(needed_position, "static vec3<double> position(const Map&, point)");
      TURBOMAP_NEEDS(needed_normal, "static vec3<float> normal(const Map&, point)");
      TURBOMAP_NEEDS(needed_min_distance, "static float min_distance(const Map&, point)");
      TURBOMAP_NEEDS(needed_max_distance, "static float max_distance(const Map&, point)");
      TURBOMAP_NEEDS(needed_descriptor_data, "static const descriptor::element* descriptor_data(const Map&, point)");
      TURBOMAP_NEEDS(needed_reference, "static keyframe reference(const Map&, point)");
      TURBOMAP_NEEDS(needed_for_each_observation,
                     "template <class F> static void for_each_observation(const Map&, point, F)");
      TURBOMAP_NEEDS(needed_add_point, "static point add_point(Map&, const vec3<double>&, keyframe)");
      TURBOMAP_NEEDS(needed_set_appearance,
                     "static void set_appearance(Map&, point, const vec3<float>& normal, float, float, const "
                     "descriptor::element*)");
      TURBOMAP_NEEDS(needed_set_reference, "static void set_reference(Map&, point, keyframe)");
      TURBOMAP_NEEDS(needed_set_point, "static void set_point(Map&, keyframe, std::size_t, point)");
      TURBOMAP_NEEDS(needed_add_observation, "static void add_observation(Map&, point, keyframe, std::size_t)");
      TURBOMAP_NEEDS(needed_erase_observation, "static void erase_observation(Map&, point, keyframe, std::size_t)");
      TURBOMAP_NEEDS(needed_retire, "static void retire(Map&, point, point replacement)");
      TURBOMAP_NEEDS(needed_erase_keyframe, "static void erase_keyframe(Map&, keyframe)");
      using described_keyframe = typename detail::pointee<detail::keyframe_of<map_traits<Map>>>::type;
      if constexpr (!detail::map_has_v<Map, detail::map_keypoint_member> &&
                    detail::has_keyframe_specialisation_v<described_keyframe>)
        static_assert(require_keyframe_traits<described_keyframe>());
      else
        static_assert(
            detail::describes_keypoints_v<Map>,
            "turbomap: map_traits needs `static std::size_t keypoint_count(const Map&, keyframe)` and `static keypoint "
            "keypoint(const Map&, keyframe, std::size_t)`, unless a keyframe is named by a pointer to a type with "
            "keyframe_traits; see docs/map.md");
      if constexpr (!detail::map_has_v<Map, detail::map_look_member>) detail::check_optional_members<Map>();
    }
  }
  return true;  // an error has been said
}

#undef TURBOMAP_NEEDS

TURBOMAP_END_NAMESPACE
